"""A recorded log to a model: does it make sense, what fits it best, how far to trust that."""

from piezoest.identification.candidate import Candidate
from piezoest.identification.finding import Finding
from piezoest.identification.procedure import identify
from piezoest.identification.residual import Misfit, Whiteness
from piezoest.identification.result import Identification, Validation
from piezoest.identification.sense import findings
from piezoest.identification.streamed import StreamedIdentification, identify_stream

__all__ = [
    "Candidate", "Finding", "Identification", "Misfit", "StreamedIdentification", "Validation", "Whiteness",
    "findings", "identify", "identify_stream",
]  # fmt: skip
