"""How functions become parts of compiled loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import overload

# For `njit` of loops over given arrays: references to arrays are not counted, nor in what is called.
# Each view of an array costs two atomic operations else, more than the arithmetic. Such functions make
# no arrays of their own. A division by zero gives infinity, as in NumPy and C, and is not asked about.
UNCOUNTED: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}

Function = TypeVar("Function", bound=Callable[..., Any])


def unrolled(function: Function) -> Function:
    """Register a function for compiled loops, compiled anew for each whole number that is a constant.

    As `numba.extending.register_jitable`, which returns the function itself too; but where a caller
    passes a literal size, such as 3, the size is known at compile time: loops over it are unrolled,
    and nothing is left of the indices. Each of them is put in its caller's place.
    """

    @overload(function, jit_options={"forceinline": True}, strict=False, prefer_literal=True)
    def _same(*args: Any, **kwargs: Any) -> Any:
        return function

    return function
