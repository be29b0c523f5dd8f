"""A profile of models over the swing."""

import numpy as np

from piezoest import AmplitudeProfile


def test_a_profile_keeps_its_own_swings() -> None:
    swings = np.array([1.0, 2.0])
    profile = AmplitudeProfile(swings, np.full((2, 3), 0.1))
    swings[0] = 99.0
    np.testing.assert_array_equal(profile.swings, [1.0, 2.0])
