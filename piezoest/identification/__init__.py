"""A recorded log to a model: parameters with standard errors, free-running error, advice."""

from piezoest.identification.procedure import identify
from piezoest.identification.result import Identification, Misfit, Whiteness

__all__ = ["Identification", "Misfit", "Whiteness", "identify"]
