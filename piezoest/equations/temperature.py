"""The effect of temperature on a coefficient.

An assumption: no law is given in Eielsen, Gravdahl and Pettersen (2012), who only name
temperature among the causes of a changing gain (Sec. I). To first order every material
coefficient changes by so many parts per kelvin; the exponential has that slope at the
reference temperature and never changes sign.
Symbols: temperature [°C], coefficient [1/K].
"""

import numpy as np
from numba.extending import register_jitable


@register_jitable
def thermal_factor(temperature, reference, coefficient):
    """exp(coefficient (temperature - reference)): 1 at the reference temperature."""
    return np.exp(coefficient * (temperature - reference))
