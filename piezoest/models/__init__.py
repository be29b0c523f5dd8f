"""Models of a stage: frozen parameters with names and units.

A model is registered by the import of its file, here.
"""

import inspect
from typing import Any

from piezoest._checks import class_named
from piezoest.models._base import REGISTERED
from piezoest.models._base import Model as Model
from piezoest.models.amplitude_profile import AmplitudeProfile as AmplitudeProfile
from piezoest.models.coleman_hodgdon import ColemanHodgdon as ColemanHodgdon
from piezoest.models.creep import Creep as Creep
from piezoest.models.free_running import FreeRunning as FreeRunning
from piezoest.models.linear_gain import LinearGain as LinearGain
from piezoest.models.mechanics import MassSpringDamper as MassSpringDamper
from piezoest.models.prandtl_ishlinskii import PrandtlIshlinskii as PrandtlIshlinskii
from piezoest.models.preisach import Preisach as Preisach
from piezoest.models.step_model import StepModel as StepModel


def model_from_dict(data: Any) -> Model:
    """Make the model that its `to_dict` described, of whichever class.

    Parameters
    ----------
    data : dict
        With the name of the class under ``"model"``.

    Raises
    ------
    ValueError
        If the name is unknown or the fields do not fit.
    """
    classes = [each for each in REGISTERED.values() if not inspect.isabstract(each)]
    model: Model = class_named(data, "model", classes).from_dict(data)
    return model


__all__ = sorted(["AmplitudeProfile", "Creep", "MassSpringDamper", "Model", "model_from_dict", *REGISTERED])
