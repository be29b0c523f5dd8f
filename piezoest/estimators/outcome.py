"""What `piezoest.track` needs of an estimator, and the status and the trace that estimators return."""

from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from piezoest._checks import FloatArray
from piezoest.models import Model


@runtime_checkable
class Estimator(Protocol):
    """What `piezoest.track` needs of an estimator: a method ``step(u, x)`` and an attribute ``model``.

    An estimator may also have ``run(u, x)``, which `track` then prefers to a loop of ``step``.
    """

    @property
    def model(self) -> Model:
        """The current model."""

    def step(self, u: float, x: float | None) -> None:
        """Process one sample.

        Parameters
        ----------
        u : float
            Voltage [V].
        x : float or None
            Measured displacement [µm]; None if it is missing.
        """


@dataclass(frozen=True, slots=True)
class Status:
    """Counts of the samples that an estimator has used, skipped or left out.

    Parameters
    ----------
    samples : int
        Samples seen.
    updates : int
        Samples that changed the estimate.
    missing : int
        Samples without a usable voltage or displacement (None, NaN, infinite).
    held : int
        Samples with a measurement that changed nothing: too little excitation, or an update that would not
        be a reasonable number.
    resets : int
        Number of covariance resets, also after a numerical failure.
    projected : bool
        Whether `model` is the nearest admissible one and not `theta` itself.
    last : str
        What happened to the last sample: ``"waiting"``, ``"updated"``, ``"missing"``, ``"held"``
        or ``"rejected"``.
    outliers : int
        Measurements that were rejected as impossible.

    Examples
    --------
    >>> import piezoest as pz
    >>> estimator = pz.HysteresisRLS(1000.0)
    >>> estimator.step(1.0, None)
    >>> estimator.status.missing
    1
    """

    samples: int
    updates: int
    missing: int
    held: int
    resets: int
    projected: bool
    last: str
    outliers: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """History of an estimator over a `run`, every k-th sample.

    Parameters
    ----------
    index : ndarray of int, shape (M,)
        Indices in the record.
    theta : ndarray, shape (M, n)
        Parameters after that sample.
    parameter_names : tuple of str
        Names of the columns of `theta`.
    y, S : ndarray or None, shape (M,)
        Innovation and its variance, if asked for.
    P : ndarray or None, shape (M, n, n)
        Covariance, if asked for.

    Examples
    --------
    >>> import piezoest as pz
    >>> u = pz.signals.triangle(35.0, 5.0, 4, 1000.0).values
    >>> x = pz.ColemanHodgdon(0.02, 0.12, 0.0036).simulate(u)
    >>> pz.HysteresisRLS(1000.0).run(u, x, every=100).theta.shape
    (8, 4)
    """

    index: np.ndarray[Any, np.dtype[np.int64]] = field(repr=False)
    theta: FloatArray = field(repr=False)
    parameter_names: tuple[str, ...]
    y: FloatArray | None = field(default=None, repr=False)
    S: FloatArray | None = field(default=None, repr=False)
    P: FloatArray | None = field(default=None, repr=False)
