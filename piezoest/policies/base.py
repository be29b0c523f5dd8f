"""A policy of recursive least squares: named numbers and compiled hooks.

A policy is a frozen dataclass in a file of its own, with those of these functions beside it that it has
something to do in. Those of the policies that are on are called once for each sample, as
``hook(own, fixed, state, settings)``, with what the policy keeps (`Policy.keeps`), the numbers it was given
(`Policy.numbers`), and state and settings of the whole estimator:

``prepare``
    Before a sample's update, in order: forgetting factor and noise of the sample (``state.law.forgetting``,
    ``state.law.noise``) may be set, P may grow.
``permits``
    Whether the sample may move the estimate; every policy is asked. Else it counts as held.
``before_update``
    When it may, before the innovation is formed.
``after_update``
    When the estimate has moved.

Every estimator has ``state.law``, ``state.phi`` and ``settings.law``: see `law_layout` and
`law_settings_layout` of `piezoest.estimators.recursive_least_squares_kernel`. Only `HysteresisRLS` follows a
voltage: ``state.u_last``, which is this sample's already, beside ``state.samples`` and what else `layout` of
`piezoest.estimators.rls_kernel` has. A policy that reads of it sets `Policy.needs_swings`, and is refused
elsewhere. What it keeps is shown and saved by `field_name`: ``state["policies"]["excitation_gate"]``.
"""

from __future__ import annotations

import dataclasses
import inspect
import linecache
import re
import sys
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import inlined
from piezoest.layout import ABSENT, FIXED, Field, Record, record
from piezoest.machine_code import note_source

#: Every policy by its name in state and settings, in the order in which hooks are called.
REGISTERED: dict[str, type[Policy]] = {}

HOOKS = ("prepare", "permits", "before_update", "after_update")
_ARGUMENTS = ["own", "fixed", "state", "settings"]
# What the estimator follows that moves samples out of the way without a hook.
_ACTING = frozenset({"belief"})
# Functions that compiled code calls, by hook and policy: those there were when it was made.
_chained: dict[str, dict[str, Any]] = {}


@dataclass(frozen=True)
class Conditions:
    """What the numbers of a policy may depend on."""

    step: float  # time between samples [s], or in the unit of a memory
    P_0: FloatArray  # (n, n): initial covariance
    discrete: bool = True  # whether the law is the discrete one
    by_period: bool = False  # whether memory is counted in periods of the reference
    has_swings: bool = False  # whether the estimator follows a voltage
    has_loop: bool = False  # whether its model has hysteresis


class Policy:
    """A named rule of recursive least squares; see `piezoest.policies.base` for what a subclass brings."""

    __slots__ = ()

    #: Whether it is a way to forget: there can be one.
    forgets: ClassVar[bool] = False
    #: Whether it needs the swings of a voltage, the discrete law, a model with hysteresis, memory="period".
    needs_swings: ClassVar[bool] = False
    needs_discrete: ClassVar[bool] = False
    needs_loop: ClassVar[bool] = False
    needs_period: ClassVar[bool] = False
    #: What the estimator has to follow for it: "noise", "belief", "products", "energy".
    follows: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        name, module = field_name(cls), cls.__module__
        for other, policy in REGISTERED.items():
            if (other == name) != (policy.__module__ == module):
                raise TypeError(
                    f"{module}.{cls.__name__} must have a name and a file of its own: "
                    f"there is {policy.__module__}.{policy.__name__}"
                )
        REGISTERED[name] = cls

    def check(self, at: Conditions) -> None:
        """Refuse what the policy does not go with.

        Parameters
        ----------
        at : Conditions
            Of the estimator.

        Raises
        ------
        ValueError
            Naming what it needs.
        """
        name = type(self).__name__
        if self.needs_discrete and not at.discrete:
            raise ValueError(f"policies: {name} goes with the discrete time base")
        if self.needs_swings and not at.has_swings:
            raise ValueError(f"policies: {self!r} needs the swings of a voltage: see HysteresisRLS")
        if self.needs_loop and not at.has_loop:
            raise ValueError(f"policies: {name} goes with a ColemanHodgdon, not with a LinearGain")
        if self.needs_period and not at.by_period:
            raise ValueError(f"policies: {name} goes with memory='period' and the discrete time base")

    def law(self, at: Conditions) -> dict[str, float]:
        """Numbers of the law itself that it sets: ``forgetting``, ``rate``, ``bound``, ``normalised``.

        Parameters
        ----------
        at : Conditions
            Of the estimator.
        """
        return {}

    def numbers(self, at: Conditions) -> dict[str, float]:
        """Numbers that its hooks are given, as ``fixed``: by default its fields that are numbers.

        Parameters
        ----------
        at : Conditions
            Of the estimator.
        """
        return {
            each.name: float(value)
            for each in dataclasses.fields(self)  # type: ignore[arg-type]
            if np.ndim(value := getattr(self, each.name)) == 0 and np.asarray(value).dtype.kind in "biuf"
        }

    def keeps(self, n: int) -> Field:
        """Layout of what it keeps between samples.

        Parameters
        ----------
        n : int
            Number of the estimator's parameters.
        """
        return ABSENT


def field_name(policy: type[Policy]) -> str:
    """Name of a policy in state and settings: ``dead_zone`` of `DeadZone`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", policy.__name__).lower()


def _arguments_of(function: Any) -> list[str]:
    code = function.__code__
    return list(code.co_varnames[: code.co_argcount])


def hooks_of(policy: type[Policy]) -> dict[str, Any]:
    """Functions that a policy's file has for compiled code, by their hooks."""
    here = vars(sys.modules[policy.__module__])
    if odd := sorted(name for name in HOOKS if name in here and not inspect.isfunction(here[name])):
        raise ValueError(f"{policy.__name__}: {', '.join(odd)} must be a plain function, marked @inlined")
    own = {name: value for name, value in here.items() if inspect.isfunction(value)}
    functions = {name: value for name, value in own.items() if _arguments_of(value) == _ARGUMENTS}
    if wrong := sorted(set(HOOKS) & own.keys() - functions.keys()):
        raise ValueError(
            f"{policy.__name__}: {', '.join(wrong)} must have the arguments {', '.join(_ARGUMENTS)}, so named"
        )
    if unknown := sorted(functions.keys() - set(HOOKS)):
        raise ValueError(
            f"{policy.__name__}: {', '.join(unknown)} are no hooks, these are {', '.join(HOOKS)}"
        )
    return functions


def check_is_carried_out(policy: type[Policy]) -> None:
    """Refuse a policy that would change nothing."""
    name, hooks = field_name(policy), hooks_of(policy)
    if not (hooks or policy.law is not Policy.law or policy.follows & _ACTING):
        raise ValueError(f"{policy.__name__} does nothing: its file has none of {', '.join(HOOKS)}")
    for hook in HOOKS:
        if hooks.get(hook) is not _chained.get(hook, {}).get(name):
            raise ValueError(
                f"{policy.__name__} was defined after the estimators, which do not call its {hook}: "
                "import its file before the first estimator"
            )


def layouts(policies: tuple[Policy, ...], at: Conditions) -> tuple[Record, Record, dict[str, Any]]:
    """Layouts of what policies keep and of what they are given, and the latter's numbers."""
    for policy in policies:
        check_is_carried_out(type(policy))
    kept: dict[str, Field] = dict.fromkeys(REGISTERED, ABSENT)
    given: dict[str, Field] = dict.fromkeys(REGISTERED, ABSENT)
    values: dict[str, Any] = {}
    for policy in policies:
        name = field_name(type(policy))
        numbers = {"on": 1.0, **policy.numbers(at)}
        kept[name] = policy.keeps(len(at.P_0))
        given[name], values[name] = record(**dict.fromkeys(numbers, FIXED)), numbers
    return record(**kept), record(**given), values


def chain(hook: str) -> Any:
    """``chain(state, settings)``: a hook of every registered policy, one after the other; for compiled code.

    Machine code has the hooks of the policies that are on, and nothing of the others. It is written out, as
    Numba compiles no loop over functions. ``permits`` is True where all are; all are asked.
    """
    called = {name: found for name, policy in REGISTERED.items() if (found := hooks_of(policy).get(hook))}
    for function in called.values():
        note_source(function)
    _chained[hook] = called
    text = f"def {hook}(state, settings):\n    permitted = True\n"
    for name in called:
        call = f"{name}_{hook}(state.policies.{name}, settings.policies.{name}, state, settings)"
        result = f"permitted = {call} and permitted" if hook == "permits" else call
        text += f"    if settings.policies.{name} is not None:\n        {result}\n"
    text += "    return permitted\n"
    functions: dict[str, Any] = {f"{name}_{hook}": function for name, function in called.items()}
    place = f"<{hook} of {', '.join(called)}>"
    # Where tracebacks, and whoever translates functions, look for its text.
    linecache.cache[place] = (len(text), None, text.splitlines(True), place)
    exec(compile(text, place, "exec"), functions)
    return inlined(functions[hook])
