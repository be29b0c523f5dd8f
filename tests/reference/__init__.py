"""Textbook versions of the algorithms, written from the sources and independent of the kernels."""
