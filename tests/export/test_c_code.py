"""Generated controllers: clean to compilers, equal to the library, safe with any input."""

import functools
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.scenarios import SCENARIOS
from tests.export.building import compile_strictly, under_sanitizers
from tests.wild import wild

FS = 50_000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
LINE = pz.LinearGain(0.15)
LIMITS = pz.VoltageLimits(-60.0, 60.0)
PLAYS = pz.PrandtlIshlinskii(0.1, np.linspace(0.5, 30.0, 12), np.full(12, 4e-3), 0.1)
BENT = pz.PrandtlIshlinskii(
    0.1, np.linspace(2.0, 30.0, 7), np.full(7, 6e-3), 0.1, creep=pz.Creep([0.01, 0.02], [0.01, 1.0]),
    bends=[-10.0, 12.0], bend_weights=np.full((2, 8), 5e-4), sample_rate=FS,
)  # fmt: skip
SLEWED = pz.VoltageLimits(-60.0, 60.0, slew_rate=1e4, sample_rate=FS)


def inverse(**options: Any) -> Any:
    return pz.InverseCompensator(START, LIMITS, **options)


def rls(**options: Any) -> Any:
    return pz.HysteresisRLS(FS, **{"initial_model": START, **options})


def ekf(**options: Any) -> Any:
    return pz.HysteresisEKF(FS, **{"initial_model": START, **options})


def cold_start(periods: int) -> Any:
    return SCENARIOS["cold-start"].build(0, after=periods, sample_rate=FS, updates=200)


RESETTING = (pz.policies.CovarianceResetting(1e-3), pz.policies.DeadZone())
PAIRS: dict[str, Any] = {
    "inverse": lambda: (None, inverse()),
    "plays": lambda: (None, pz.InverseCompensator(PLAYS, LIMITS)),
    "plays-bent": lambda: (None, pz.InverseCompensator(BENT, SLEWED)),
    "line": lambda: (None, pz.LinearCompensator(LINE, LIMITS)),
    "rls": lambda: (rls(), inverse()),
    "rls-paper": lambda: (rls(memory=0.4, offset=False), inverse()),
    "rls-continuous": lambda: (rls(time_base="continuous"), inverse(method="bogacki-shampine")),
    "rls-delay-highpass": lambda: (rls(delay=2.3, high_pass=0.5, memory=0.2), inverse(transfer_samples=0)),
    "rls-resetting": lambda: (rls(memory=0.05, policies=RESETTING), inverse()),
    "rls-line-offset": lambda: (rls(initial_model=LINE, offset=True), pz.LinearCompensator(LINE, LIMITS)),
    "ekf": lambda: (ekf(), inverse()),
    "ekf-offset": lambda: (ekf(offset=True, delay=1.5), inverse()),
    "output-error": lambda: (pz.OutputErrorRLS(FS, initial_model=START), inverse()),
    "ekf-free": lambda: (ekf(offset=True, project=False), inverse()),
    "ekf-line": lambda: (ekf(initial_model=LINE), pz.InverseCompensator(LINE, SLEWED)),
}


@functools.cache
def code(name: str, precision: Any = "double") -> Any:
    return pz.export.c(*PAIRS[name](), precision=precision, name="controller")


@pytest.fixture(scope="module")
def log() -> tuple[Any, Any]:
    """Reference, and measurement before each sample of it."""
    case = cold_start(2)
    compensator = pz.InverseCompensator(case.start, LIMITS)
    record = pz.track(case.reference, stage=case.new_stage(), compensator=compensator)
    return record.reference, np.concatenate([[np.nan], record.measured[:-1]])


@pytest.mark.parametrize(
    ("cc", "precision", "names"),
    [("gcc", "float", PAIRS), ("clang", "double", ("rls", "rls-continuous", "ekf-offset", "plays-bent"))],
)
@pytest.mark.slow
def test_compiles_without_a_warning(cc: str, precision: str, names: Any, tmp_path: Path) -> None:
    for name in names:
        compile_strictly(cc, code(name, precision), tmp_path, "-O1")


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.slow_but_first
def test_double_equals_the_library(name: str, log: tuple[Any, Any]) -> None:
    r, x = (values.copy() for values in log)
    x[5000:5100], x[7000], r[9000] = np.nan, 40.0, np.inf
    if name == "ekf-offset":
        # The log is another controller's: on so foreign a one this filter runs away, past any number.
        r, x = r[:3500], x[:3500]
    theirs = pz.export.Controller(*PAIRS[name]()).run(r, x)
    ours = pz.export.CompiledController(code(name)).run(r, x)
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("name", ["rls", "ekf"])
def test_freeze_holds_the_model_as_in_python(name: str) -> None:
    case, x = cold_start(2), None
    stage, ours = case.new_stage(), pz.export.CompiledController(code(name))
    theirs = pz.export.Controller(*PAIRS[name]())
    parts = np.split(case.reference.values, [8000, 12_000])
    for part, frozen in zip(parts, (False, True, False), strict=True):
        before = ours.parameters
        ours.frozen = theirs.frozen = frozen
        assert ours.frozen == theirs.frozen == frozen
        for value in part.tolist():
            u = theirs.step(value, x)
            assert ours.step(value, x) == u
            x = stage.step(u)
        assert np.array_equal(before, ours.parameters) == frozen


@pytest.mark.parametrize("name", ["rls-continuous", "rls-delay-highpass", "ekf-offset", "plays-bent"])
@pytest.mark.slow
def test_sanitizers_are_silent(name: str, tmp_path: Path, log: tuple[Any, Any]) -> None:
    precision = "float" if name in ("rls-continuous", "ekf-offset") else "double"
    pairs = np.column_stack(log)
    pairs[3000:3200, 1] = np.nan
    pairs[4000, 1], pairs[4001, 1], pairs[4002, 0] = np.inf, 1e30, -np.inf
    call = f"controller_step(&state, ({precision})pair[0], ({precision})pair[1])"
    done = under_sanitizers(code(name, precision), pairs, tmp_path, call=call, low="-60.0", high="60.0")
    assert done == (0, b"")


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((pz.FilterPyEKF(FS), inverse()), "FilterPyEKF"),
        ((None, START), "compensator"),
        ((3,), r"give an AdaptiveFeedforward alone, or .* got 3 and None"),
        ((rls(), pz.LinearCompensator(LINE)), "LinearGain"),
        ((pz.PrandtlIshlinskiiRLS(FS), inverse()), r"export it fixed: c\(None"),
        ((rls(), pz.InverseCompensator(PLAYS)), "no other model"),
    ],
)
def test_what_has_no_kernel_is_refused(parts: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pz.export.c(*parts)


@pytest.mark.parametrize("name", ["rls", "ekf"])
@pytest.mark.slow_but_first
def test_float_settles_to_the_same_error(name: str) -> None:
    case = cold_start(10)
    estimator, compensator = PAIRS[name]()
    single = pz.export.CompiledController(code(name, "float"))
    library = pz.track(case.reference, stage=case.new_stage(), compensator=compensator, estimator=estimator)
    own = pz.track(case.reference, stage=case.new_stage(), compensator=single)
    assert own.max_error(2) == pytest.approx(library.max_error(2), rel=0.03)


def test_parameters_and_limits_can_be_set(log: tuple[Any, Any]) -> None:
    r, x = log
    ours, compensator = pz.export.CompiledController(code("inverse")), inverse()
    ours.run(r[:500], x[:500])
    compensator.run(r[:500])
    ours.parameters = [0.021, 0.14, 0.0042, 0.1]
    compensator.model = pz.ColemanHodgdon(0.021, 0.14, 0.0042, 0.1)
    np.testing.assert_array_equal(ours.run(r[500:], x[500:]), compensator.run(r[500:]))
    # An inadmissible model becomes its nearest admissible one; one that is no number is refused.
    ours.parameters = [0.021, 0.14, 0.1, 0.0]
    assert pz.ColemanHodgdon(*ours.parameters).is_admissible
    for wrong in ([np.nan, 0.1, 0.1, 0.0], [0.02, np.inf, 0.1, 0.0]):
        with pytest.raises(ValueError, match="parameters"):
            ours.parameters = wrong
    ours.reset()
    ours.set_limits(-5.0, 4.0)
    u = ours.run(r, x)
    assert (u.min(), u.max()) == (-5.0, 4.0)
    with pytest.raises(ValueError, match="below"):
        ours.set_limits(3.0, 3.0)


@pytest.mark.parametrize(
    ("name", "precision"), list(zip(PAIRS, itertools.cycle(("float", "double")), strict=False))
)
@pytest.mark.slow_but_first
def test_of_any_bits_it_makes_numbers(name: str, precision: Any) -> None:
    made = pz.export.CompiledController(code(name, precision))
    rng, bits = np.random.default_rng(0), np.uint32 if precision == "float" else np.uint64
    for _ in range(100):
        made.reset()
        for count in rng.integers(1, 80, 4).tolist():
            with np.errstate(all="ignore"):
                u = made.run(wild(rng, count, 5.0, bits), wild(rng, count, 5.0, bits))
            assert np.all(np.abs(u) <= 60.0)
            parameters = made.parameters
            assert np.all(np.isfinite(parameters)), parameters
            if "line" in name:
                assert parameters[0] >= 0.9e-3 * LINE.gain, parameters
            elif not name.startswith("plays"):
                assert parameters[2] / parameters[0] >= 0.9e-3 * START.c, parameters
