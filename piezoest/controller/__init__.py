"""Adaptive feed-forward as one object: the line, the candidates, the readings, the start."""
