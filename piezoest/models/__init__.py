"""Models of a stage: frozen parameters with names and units.

A model is registered by the import of its file, here.
"""

from piezoest.models._base import REGISTERED
from piezoest.models._base import Model as Model
from piezoest.models.amplitude_profile import AmplitudeProfile as AmplitudeProfile
from piezoest.models.coleman_hodgdon import ColemanHodgdon as ColemanHodgdon
from piezoest.models.creep import Creep as Creep
from piezoest.models.free_running import FreeRunning as FreeRunning
from piezoest.models.learnt_on import LearntOn as LearntOn
from piezoest.models.linear_gain import LinearGain as LinearGain
from piezoest.models.mechanics import MassSpringDamper as MassSpringDamper
from piezoest.models.prandtl_ishlinskii import PrandtlIshlinskii as PrandtlIshlinskii
from piezoest.models.preisach import Preisach as Preisach
from piezoest.models.reading import LearntModel as LearntModel
from piezoest.models.reading import model_from_dict as model_from_dict
from piezoest.models.step_model import StepModel as StepModel

__all__ = sorted(
    [
        "AmplitudeProfile",
        "Creep",
        "LearntModel",
        "LearntOn",
        "MassSpringDamper",
        "Model",
        "model_from_dict",
        *REGISTERED,
    ]
)
