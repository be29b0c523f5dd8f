"""What is said of a dictionary that is none of a controller."""

from __future__ import annotations

from typing import Any

import pytest

import piezoest as pz


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, 'data has no "controller": pass what to_dict'),
        ({"a": 1}, 'data has no "controller": pass what to_dict'),
        ({"estimator": "HysteresisRLS", "format": 1}, 'data has no "controller": pass what to_dict'),
        ({"controller": "Other"}, "data is of a 'Other', not of a AdaptiveFeedforward"),
        ({"controller": None}, "data is of a None"),
        ({"controller": "AdaptiveFeedforward", "format": 0}, "data has format 0, this version reads"),
    ],
)
def test_what_is_no_controller_is_named(data: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pz.AdaptiveFeedforward.from_dict(data)
