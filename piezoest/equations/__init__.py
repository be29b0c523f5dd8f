"""The mathematics: each equation once, plain functions on numbers and flat arrays.

Every function here runs as ordinary Python, inside a Numba loop and on CasADi symbols.
"""
