"""A recorded log to a model: parameters with standard errors, free-running error, advice."""

from piezoest.identification.choice import Candidate, ModelChoice, choose_model
from piezoest.identification.procedure import identify
from piezoest.identification.residual import Misfit, Whiteness
from piezoest.identification.result import Identification
from piezoest.identification.streamed import StreamedIdentification, identify_stream

__all__ = [
    "Candidate",
    "Identification",
    "Misfit",
    "ModelChoice",
    "StreamedIdentification",
    "Whiteness",
    "choose_model",
    "identify",
    "identify_stream",
]
