from . import export, models, policies, signals
from ._version import __version__
from .compensators import (
    CompensatorStatus,
    IntegralFeedback,
    InverseCompensator,
    LinearCompensator,
    VoltageLimits,
)
from .estimators.base import Estimator, Status, Trace
from .estimators.batch import BatchFit
from .estimators.batch_result import BatchFitResult
from .estimators.ekf import HysteresisEKF
from .estimators.filterpy_baselines import FilterPyEKF, FilterPyUKF
from .estimators.horizon import MovingHorizon
from .estimators.recursive_least_squares import RecursiveLeastSquares
from .estimators.rls import HysteresisRLS
from .identification import Identification, identify
from .models import ColemanHodgdon, Creep, LinearGain, MassSpringDamper, PrandtlIshlinskii
from .records import Record, read_record
from .signals import Signal
from .stage import Amplifier, Gauge, PaperStage, SimulatedStage, TemperatureLaw
from .supervisor import Event, Supervisor
from .tracking import TrackingRecord, track

__all__ = [
    "Amplifier",
    "BatchFit",
    "BatchFitResult",
    "ColemanHodgdon",
    "CompensatorStatus",
    "Creep",
    "Estimator",
    "Event",
    "FilterPyEKF",
    "FilterPyUKF",
    "Gauge",
    "HysteresisEKF",
    "HysteresisRLS",
    "Identification",
    "IntegralFeedback",
    "InverseCompensator",
    "LinearCompensator",
    "LinearGain",
    "MassSpringDamper",
    "MovingHorizon",
    "PaperStage",
    "PrandtlIshlinskii",
    "Record",
    "RecursiveLeastSquares",
    "Signal",
    "SimulatedStage",
    "Status",
    "Supervisor",
    "TemperatureLaw",
    "Trace",
    "TrackingRecord",
    "VoltageLimits",
    "__version__",
    "export",
    "identify",
    "models",
    "policies",
    "read_record",
    "signals",
    "track",
]
