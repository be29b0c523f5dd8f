"""Models of a stage: frozen parameters with names and units."""

from typing import Any

from piezoest.models._base import Model
from piezoest.models.amplitude_profile import AmplitudeProfile
from piezoest.models.coleman_hodgdon import ColemanHodgdon
from piezoest.models.creep import Creep
from piezoest.models.linear_gain import LinearGain
from piezoest.models.mechanics import MassSpringDamper
from piezoest.models.prandtl_ishlinskii import PrandtlIshlinskii
from piezoest.models.preisach import Preisach

__all__ = [
    "AmplitudeProfile",
    "ColemanHodgdon",
    "Creep",
    "LinearGain",
    "MassSpringDamper",
    "Model",
    "PrandtlIshlinskii",
    "Preisach",
    "model_from_dict",
]


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
    kinds: dict[str, type[Model]] = {
        kind.__name__: kind for kind in (ColemanHodgdon, LinearGain, PrandtlIshlinskii, Preisach)
    }
    name = data.get("model") if isinstance(data, dict) else data
    if not isinstance(name, str) or name not in kinds:
        raise ValueError(f"model {name!r} is unknown: choose of {sorted(kinds)}")
    return kinds[name].from_dict(data)
