"""A zoo of rigs: stages of many kinds, and what goes wrong on somebody's rig.

>>> from piezoest.bench.zoo import draw, traced
>>> rig = draw(7)
>>> row, traces = traced(rig, factory)  # doctest: +SKIP
"""

from piezoest.bench.zoo.drawing import draw
from piezoest.bench.zoo.judging import play, traced

__all__ = ["draw", "play", "traced"]
