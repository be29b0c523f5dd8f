"""The third-order Runge-Kutta method of Bogacki and Shampine.

P. Bogacki, L. F. Shampine, A 3(2) pair of Runge-Kutta formulas, Appl. Math. Lett. 2 (1989)
321-325: the fixed-step method the paper runs at 50 kHz (Sec. IV).
"""

from numba.extending import register_jitable

# Nodes of the stages and weights of the third-order solution.
NODES = (0.0, 0.5, 0.75)
WEIGHTS = (2.0 / 9.0, 3.0 / 9.0, 4.0 / 9.0)


@register_jitable
def bogacki_shampine(derivative, y, h, arguments):
    """y after a step h of y' = derivative(y, *arguments), y a number, arguments constant."""
    k_1 = derivative(y, *arguments)
    k_2 = derivative(y + NODES[1] * h * k_1, *arguments)
    k_3 = derivative(y + NODES[2] * h * k_2, *arguments)
    return y + h * (WEIGHTS[0] * k_1 + WEIGHTS[1] * k_2 + WEIGHTS[2] * k_3)
