"""From a model and a reference to the voltage."""

from piezoest.compensators.base import Compensator, CompensatorStatus
from piezoest.compensators.feedback import IntegralFeedback
from piezoest.compensators.inverse import InverseCompensator
from piezoest.compensators.lead import LeadFilter
from piezoest.compensators.limits import VoltageLimits
from piezoest.compensators.linear import LinearCompensator

__all__ = [
    "Compensator", "CompensatorStatus", "IntegralFeedback", "InverseCompensator", "LeadFilter",
    "LinearCompensator", "VoltageLimits",
]  # fmt: skip
