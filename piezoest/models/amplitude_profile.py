"""Models per size of the voltage's swing: what was learnt at each amplitude, as a file."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from piezoest._checks import FloatArray, array_1d, as_floats, dictionary, fields, positive
from piezoest._files import read_object, write_text
from piezoest.models.coleman_hodgdon import ColemanHodgdon

_FORMAT = 1


@dataclass(frozen=True, slots=True, eq=False)
class AmplitudeProfile:
    """Coleman-Hodgdon parameters per swing of the voltage.

    Parameters
    ----------
    swings : array_like, shape (M,)
        Size of each swing, turning point to turning point [V]; in ascending order.
    theta : array_like, shape (M, 3)
        alpha [1/V], beta [µm/V] and gamma [µm/V²] at each.

    Raises
    ------
    ValueError
        If the shapes do not match, a swing is not above the one before, or a value is not finite.

    Notes
    -----
    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), last paragraph of
    sec. IV: parameters scheduled by the reference's amplitude.

    Examples
    --------
    >>> import piezoest as pz
    >>> profile = pz.AmplitudeProfile(swings=[20.0, 60.0], theta=[[0.03, 0.13, 0.006], [0.02, 0.15, 0.004]])
    >>> profile.swings
    array([20., 60.])
    """

    swings: FloatArray
    theta: FloatArray

    def __post_init__(self) -> None:
        swings = array_1d("swings", self.swings).copy()
        theta = as_floats("theta", self.theta).copy()
        if theta.size == swings.size == 0:
            theta = theta.reshape(-1, 3)
        if theta.shape != (swings.size, 3) or not np.all(np.isfinite(theta)):
            raise ValueError(f"theta must be finite with shape ({swings.size}, 3), got {theta.shape}")
        if np.any(np.diff(swings, prepend=0.0) <= 0.0):
            raise ValueError(f"swings must be above zero and ascend, got {swings.tolist()}")
        object.__setattr__(self, "swings", swings)
        object.__setattr__(self, "theta", theta)

    def __eq__(self, other: object) -> bool:
        return self.to_dict() == other.to_dict() if isinstance(other, AmplitudeProfile) else NotImplemented

    def __hash__(self) -> int:
        return hash(repr(self.to_dict()))

    def at(self, swing: float) -> ColemanHodgdon:
        """Model for a size of swing: interpolated, and beyond the ends that of the nearest.

        Parameters
        ----------
        swing : float
            [V].

        Raises
        ------
        ValueError
            If the profile is empty, or swing is not above zero.
        """
        if self.swings.size == 0:
            raise ValueError("the profile is empty: let an estimator with AmplitudeMemory learn first")
        swing = positive("swing", swing)
        values = [float(np.interp(swing, self.swings, self.theta[:, i])) for i in range(3)]
        return ColemanHodgdon(*values)

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary; its ``"model"`` is that of the largest swing."""
        data: dict[str, Any] = {
            "profile": type(self).__name__,
            "format": _FORMAT,
            "swings": self.swings.tolist(),
            "theta": self.theta.tolist(),
        }
        if self.swings.size:
            data["model"] = self.at(float(self.swings[-1])).to_dict()
        return data

    @classmethod
    def from_dict(cls, data: Any) -> Self:
        """Make the profile from what `to_dict` gave.

        Parameters
        ----------
        data : dict
            The dictionary.

        Raises
        ------
        ValueError
            If it describes no profile, or one of another format.
        """
        described = dictionary(data)
        if (described.get("profile"), described.get("format")) != (cls.__name__, _FORMAT):
            raise ValueError(f"data is no {cls.__name__} of format {_FORMAT}: write it with save()")
        fields("profile", data, ("profile", "format", "swings", "theta"), ("model",))
        return cls(data["swings"], data["theta"])

    def save(self, path: str | Path) -> None:
        """Write the profile as JSON.

        Parameters
        ----------
        path : str or Path
            File to write. `piezoest compensate` and `piezoest export` take it for the model of its largest
            swing.
        """
        write_text(path, json.dumps(self.to_dict(), indent=2) + "\n")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Parameters
        ----------
        path : str or Path
            The file.

        Raises
        ------
        ValueError
            If the file holds no profile.
        """
        data = read_object(path, "profile")
        try:
            return cls.from_dict(data)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
