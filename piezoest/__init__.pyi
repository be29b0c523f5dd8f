from . import export, models, policies, records, report, signals
from ._version import __version__
from .compensators import (
    CompensatorStatus,
    IntegralFeedback,
    InverseCompensator,
    LeadFilter,
    LinearCompensator,
    VoltageLimits,
)
from .controller.adaptive_feedforward import AdaptiveFeedforward
from .controller.shown import Event
from .estimators.bank import EstimatorBank
from .estimators.base import Estimator, Status, Trace
from .estimators.batch import BatchFit
from .estimators.batch_result import BatchFitResult
from .estimators.ekf import HysteresisEKF
from .estimators.filterpy_baselines import FilterPyEKF, FilterPyUKF
from .estimators.horizon import MovingHorizon
from .estimators.output_error import OutputErrorRLS
from .estimators.play_rls import PrandtlIshlinskiiRLS
from .estimators.recursive_least_squares import RecursiveLeastSquares
from .estimators.rls import HysteresisRLS
from .fitting import Fit, fit
from .identification import (
    Identification,
    StreamedIdentification,
    identify,
    identify_stream,
)
from .models import (
    AmplitudeProfile,
    ColemanHodgdon,
    Creep,
    LinearGain,
    MassSpringDamper,
    PrandtlIshlinskii,
    Preisach,
)
from .records import Record, RecordStream, read_record, stream_record
from .signals import Signal
from .stage import Amplifier, Gauge, PaperStage, PreisachStage, SimulatedStage, TemperatureLaw
from .tracking import TrackingRecord, track
from .warming import warmup

__all__ = [
    "AdaptiveFeedforward",
    "Amplifier",
    "AmplitudeProfile",
    "BatchFit",
    "BatchFitResult",
    "ColemanHodgdon",
    "CompensatorStatus",
    "Creep",
    "Estimator",
    "EstimatorBank",
    "Event",
    "FilterPyEKF",
    "FilterPyUKF",
    "Gauge",
    "OutputErrorRLS",
    "HysteresisEKF",
    "HysteresisRLS",
    "Fit",
    "Identification",
    "IntegralFeedback",
    "InverseCompensator",
    "LeadFilter",
    "LinearCompensator",
    "LinearGain",
    "MassSpringDamper",
    "MovingHorizon",
    "PaperStage",
    "PrandtlIshlinskii",
    "PrandtlIshlinskiiRLS",
    "Preisach",
    "PreisachStage",
    "Record",
    "RecordStream",
    "RecursiveLeastSquares",
    "Signal",
    "SimulatedStage",
    "Status",
    "StreamedIdentification",
    "TemperatureLaw",
    "Trace",
    "TrackingRecord",
    "VoltageLimits",
    "__version__",
    "export",
    "fit",
    "identify",
    "identify_stream",
    "models",
    "policies",
    "read_record",
    "records",
    "report",
    "signals",
    "stream_record",
    "track",
    "warmup",
]
