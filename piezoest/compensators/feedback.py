"""Integral feedback around a feed-forward (last remark of Sec. I of the paper)."""

import math

from piezoest._checks import WILDEST, number_or_nan, positive
from piezoest.compensators import corridor
from piezoest.compensators.base import AroundCompensator, Compensator

# Times the sample rate: from this gain on each correction overshoots by more than what it corrects.
UNSTABLE = 2.0


class IntegralFeedback(AroundCompensator):
    """Integral action on the tracking error around a feed-forward compensator.

    The reference handed to the compensator is r + i, with di/dt = gain (r - x).

    Parameters
    ----------
    compensator : LinearCompensator or InverseCompensator
        The feed-forward.
    gain : float
        Integral gain [1/s], which is the bandwidth of the correction in rad/s. Keep it far below
        2 zeta omega_0 of the lowest resonance.
    sample_rate : float
        [Hz].

    Raises
    ------
    ValueError
        If the compensator is none or for another sample rate, the sample rate is not above zero, or the gain
        does not lie between zero and twice the sample rate.

    Notes
    -----
    The integral does not grow while the voltage is limited in that direction, and stays constant in samples
    without a measurement. No reading counts for more than an error of the whole range of the voltage, or of
    100 V if that is less, times the slope of the first model.
    Source: K. J. Åström, R. M. Murray, Feedback Systems, Princeton 2008, sec. 10.4.

    Examples
    --------
    >>> import piezoest as pz
    >>> compensator = pz.LinearCompensator(pz.LinearGain(0.15))
    >>> feedback = pz.IntegralFeedback(compensator, gain=5.0, sample_rate=1000.0)
    >>> u = feedback.step(1.5, None)  # reference and last reading [µm]; None: no reading yet
    """

    __slots__ = ("_integral", "_reach", "_step_gain")

    #: The loop must hand each measurement back: `piezoest.track` steps sample by sample.
    needs_measurement = True

    def __init__(self, compensator: Compensator, *, gain: float, sample_rate: float) -> None:
        super().__init__(compensator, sample_rate)
        self._step_gain = positive("gain", gain) / self._sample_rate
        if self._step_gain >= UNSTABLE:
            raise ValueError(f"gain must be below {UNSTABLE:g} times the sample rate, got {gain:g} 1/s")
        self._begin()
        # One wild reading winds nothing up.
        self._reach = float(compensator.state["corridor"]["least"]) / corridor.LEAST

    def _begin(self) -> None:
        self._integral = 0.0

    @property
    def integral(self) -> float:
        """Correction of the reference [µm]."""
        return self._integral

    def step(self, r: float | None, x: float | None) -> float:
        """Voltage [V] for the next sample, within the compensator's limits.

        Parameters
        ----------
        r : float
            Reference displacement [µm], as in `InverseCompensator.step`.
        x : float or None
            Displacement measured last [µm]; None, NaN, infinity or anything that is not a number if there
            is none.
        """
        r, x = number_or_nan(r), number_or_nan(x)
        if abs(x) <= WILDEST and math.isfinite(r):
            growth = self._step_gain * min(max(r - x, -self._reach), self._reach)
            limited = self._compensator.limited
            # Where the stage falls as the voltage rises, more displacement is less voltage.
            if not limited or growth * limited * self._compensator.model.slope <= 0.0:
                self._integral += growth
        return self._compensator.step(r + self._integral)
