"""How a simulated stage changes with temperature."""

from dataclasses import dataclass

from piezoest._checks import FloatArray, finite
from piezoest.equations.temperature import thermal_factor


@dataclass(frozen=True, slots=True)
class TemperatureLaw:
    r"""Law of gain and shape over temperature.

    With T the temperature and T_0 the reference, at which the stage is as its parts say, the
    hysteresis w = c u + p of straight line and remainder (the plays of a `PrandtlIshlinskii`,
    w_h of a `ColemanHodgdon`) becomes::

        w(T) = g(T) (c u + h(T) p)
        g(T) = exp(gain (T - T_0)),   h(T) = exp(hysteresis (T - T_0))

    so that `gain` [1/K] changes the size of the response and `hysteresis` [1/K] its shape.
    Thermal expansion, which would add a drift, is not in it.

    Parameters
    ----------
    reference : float
        T_0 [°C].
    gain : float
        Relative change of the whole response [1/K].
    hysteresis : float
        Relative change of the hysteretic part against the straight line [1/K].

    Raises
    ------
    ValueError
        If a value is not finite.

    Notes
    -----
    The defaults are assumptions, chosen for their signs and order of magnitude. The stroke of stack actuators
    rises steadily with temperature (Smart Mater. Struct. 17, 015049 (2008): -30 to 125 °C). The coercive
    field falls, domain walls move more easily, and less of the response lags. With 0.25 %/K and -0.5 %/K the
    stage of the paper gains about 0.1 % a kelvin at 5 µm, where plays make a quarter to a third of the
    displacement, and its loop becomes thinner.

    Examples
    --------
    >>> import piezoest as pz
    >>> warming = {"temperature": [[0.0, 20.0], [60.0, 30.0]]}  # s, °C
    >>> law, hysteresis = pz.TemperatureLaw(gain=0.002), pz.ColemanHodgdon(0.02, 0.12, 0.0036)
    >>> stage = pz.SimulatedStage(1000.0, hysteresis=hysteresis, temperature_law=law, **warming)
    """

    reference: float = 20.0
    gain: float = 2.5e-3
    hysteresis: float = -5.0e-3

    def __post_init__(self) -> None:
        for name in ("reference", "gain", "hysteresis"):
            object.__setattr__(self, name, finite(name, getattr(self, name)))

    def gain_factor(self, temperature: FloatArray) -> FloatArray:
        """Factor g of the whole response.

        Parameters
        ----------
        temperature : ndarray, shape (N,)
            [°C].

        Returns
        -------
        ndarray, shape (N,)
        """
        return thermal_factor(temperature, self.reference, self.gain)

    def hysteresis_factor(self, temperature: FloatArray) -> FloatArray:
        """Factor h of the hysteretic part.

        Parameters
        ----------
        temperature : ndarray, shape (N,)
            [°C].

        Returns
        -------
        ndarray, shape (N,)
        """
        return thermal_factor(temperature, self.reference, self.hysteresis)
