"""An exported `AdaptiveFeedforward`: the library's voltages to the last bit, whatever happens on a rig."""

import shutil
import subprocess
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import piezoest as pz
from piezoest.bench.zoo import draw
from piezoest.bench.zoo.faults import NONE
from piezoest.controller import team
from piezoest.controller.faults import FAULTS
from piezoest.controller.shown import STAGES
from tests.controller.shared import DRIFTING
from tests.export.building import compile_strictly, under_sanitizers

FS = 1e4
LIMITS, SLEWED = (pz.VoltageLimits(-100.0, 100.0, slew, FS) for slew in (None, 2e4))
ESTIMATORS: dict[str, Any] = {"line": (), "default": None, "ekf": (pz.HysteresisEKF,)}


def controller(name: str, limits: pz.VoltageLimits = LIMITS, **options: Any) -> Any:
    return pz.AdaptiveFeedforward(FS, limits=limits, estimators=ESTIMATORS[name], **options)


def exported(library: Any, precision: Any = "double") -> Any:
    return pz.export.CompiledFeedforward(pz.export.c(library, precision=precision))


def rig(family: str, mechanics: str = "none") -> Any:
    return draw(
        0, family=family, mechanics=mechanics, limits="±100", gain=0.2, sample_rate=FS, reference="triangle",
        amplitude=8.0, frequency=20.0, waves=14.0, block=1, fault=NONE, noise=0.004, creep=0.0, volts=0.0,
        delay=0, resolution=0.0, slew=np.inf, hum=0.0, drift=0.0,
    )  # fmt: skip


def drive(library: Any, board: Any, own: Any, wrong: Any = float, count: int = 10**6) -> set[Any]:
    """Let both go round a rig, readings `wrong` for a while, some missing: same voltages; each status."""
    rng, stage, seen = np.random.default_rng(0), own.stage(), set()
    x: Any
    for k, r in enumerate(own.reference.tolist()[:count]):
        missing, other = rng.random(2) < 0.01
        r = np.nan if missing else r
        u = library.step(r)
        assert board.step(r) == u
        written = 0.9 * u if other else u
        x = float(stage.step(written))
        x = None if missing else wrong(x) if 3000 < k < 4500 else x
        for each in (library, board):
            each.learn(written, x)
        seen.add(board.status)
        if k % 7 == 0:  # it takes long to ask the library
            shown = STAGES[board.status[0]], FAULTS[board.status[2]]
            assert shown == (library.status.stage, library.status.fault)
            assert library.candidates[board.status[1]].drives
    return seen


@pytest.mark.parametrize("name", ESTIMATORS)
@pytest.mark.slow
def test_voltages_are_the_librarys_over_all_stages_and_faults(name: str) -> None:
    library = controller(name)
    board, seen = exported(library), set()
    for own, wrong in (
        (rig("bouc-wen"), lambda x: 3.0),
        (rig("preisach", "lag"), lambda x: -x),
        (rig("relays", "400 Hz"), lambda x: 9.0 * x),
        (rig("backlash"), lambda x: 0.02 * x),
        (rig("coleman-hodgdon"), lambda x: x + 5.0),
        (rig("duhem", "200 Hz"), float),
    ):
        library.reset()
        board.reset()
        seen |= drive(library, board, own, wrong)
    stages, models, faults = (set(values) for values in zip(*seen, strict=True))
    assert stages == {0, 1, 2}
    assert models == set(range(len(library.candidates)))
    assert len(faults) >= 4


def test_c_says_that_no_readings_come() -> None:
    library = controller("line")
    board = exported(library)
    for k in range(int(1.5 * FS)):
        for each in (library, board):
            each.learn(each.step(0.001 * k), np.nan)
    assert FAULTS[board.status[2]] == library.status.fault == "no readings"


@pytest.mark.slow
def test_it_goes_on_from_where_it_was_exported() -> None:
    library, own = controller("line", SLEWED), rig("duhem")
    stage = own.stage()
    for r in own.reference[:1500].tolist():
        u = library.step(r)
        library.learn(u, stage.step(u))
    board = exported(library)
    assert board.status[0] == 2
    drive(library, board, own, count=1000)
    library.reset(20.0)
    board.reset(20.0)
    assert board.status[0] == 0
    drive(library, board, own, count=2500)


@pytest.mark.parametrize("gain", [0.2, -0.2])
@pytest.mark.slow
def test_a_gain_that_is_known_need_not_be_right(gain: float) -> None:
    library = controller("line", gain=gain, feedback=5.0)
    seen = drive(library, exported(library), rig("duhem", "lag"))
    assert {stage for stage, _, _ in seen} == {0, 1, 2}
    assert any(event.reason.startswith("gain") for event in library.events) == (gain < 0.0)


@pytest.mark.parametrize("begin", [0, 2500])
@pytest.mark.slow
def test_it_homes_and_resumes(begin: int) -> None:
    library = controller("line", SLEWED)
    board, own = exported(library), rig("duhem")
    drive(library, board, own, count=begin)
    for each in (library, board):
        each.home(40.0, 50.0, 4)
    seen = drive(library, board, own, count=3000)
    assert {stage for stage, _, _ in seen} == ({0, 1, 2, 3} if begin == 0 else {1, 2, 3})
    for each in (library, board):
        each.resume(10.0, 2.0)
    drive(library, board, own, count=1500)
    for wrong in ((101.0, 0.0), (np.nan, 0.0), (0.0, np.nan), (0.0, 1e30)):
        with pytest.raises(ValueError, match="voltage must"):
            board.resume(*wrong)
    for sweep in ((101.0, 50.0, 4), (40.0, 1e4, 4), (40.0, 50.0, 0), (np.nan, 50.0, 4)):
        with pytest.raises(ValueError, match="no sweep"):
            board.home(*sweep)


@pytest.mark.slow
def test_whatever_comes_in_a_number_within_the_limits_goes_out() -> None:
    single, rng = exported(controller("ekf"), "float"), np.random.default_rng(1)
    wild = np.array([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e30, -1e30, 9e8, -9e8, 1e5, 0.0, 1e-45])
    n, stages = 4000, set()
    for gain in (1e-6, 0.15, 1e4):
        single.reset(0.0)
        r = 40.0 * gain * np.sin(np.arange(n) * 0.01)
        odd = (rng.random((3, n)) < 0.02) & (np.arange(n) > 1500)
        drawn = rng.choice(wild, (3, n))
        for k in range(n):
            u = single.step(drawn[0, k] if odd[0, k] else r[k])
            assert -100.0 <= u <= 100.0
            x = gain * (u + 0.01 * rng.normal())
            single.learn(drawn[1, k] if odd[1, k] else u, drawn[2, k] if odd[2, k] else x)
            stages.add(single.status[0])
    assert stages == {0, 1, 2}


@pytest.mark.slow
def test_the_duhem_model_learns_in_single_precision_too() -> None:
    """Rounding could spoil its covariance; the motion does not repeat, so that no recorded loop drives."""
    t = np.arange(60_000) / FS
    r = 0.5 * (np.sin(10.0 * np.pi * t) + 0.6 * np.sin(14.6 * np.pi * t) + 0.3 * np.sin(22.2 * np.pi * t))
    library, worst = controller("default"), list[float]()
    number = [each.name for each in library.candidates].index(team.DUHEM)
    for precision in ("double", "float"):
        board = exported(library, precision)
        stage = pz.SimulatedStage(FS, DRIFTING, gauge=pz.Gauge(noise=2e-4), seed=2)
        x, drove = np.empty_like(r), 0
        for k, r_k in enumerate(r.tolist()):
            u = board.step(r_k)
            x[k] = stage.step(u)
            board.learn(u, float(x[k]))
            drove += board.status[1] == number
        assert drove > 0.8 * r.size
        worst.append(float(np.abs(x - r)[20_000:].max()))
    assert worst[0] < 0.003
    assert worst[1] < 2.0 * worst[0]


@pytest.mark.parametrize(
    ("name", "precision", "cc"),
    [
        ("line", "double", "gcc"),
        ("default", "double", "clang"),
        ("default", "float", "gcc"),
        ("ekf", "float", "gcc"),
    ],
)
@pytest.mark.slow
def test_compiles_without_a_warning(name: str, precision: Any, cc: str, tmp_path: Path) -> None:
    library = controller(name)
    code = pz.export.c(library, name="stage", precision=precision)
    assert code == pz.export.c(library, name="stage", precision=precision)
    for word in ("malloc", "calloc", "goto"):
        assert word not in code.source
    compile_strictly(cc, code, tmp_path, "-O1")
    if shutil.which("nm") is None:
        return
    done = subprocess.run(["nm", "stage.o"], cwd=tmp_path, capture_output=True, text=True, check=True)
    held = [line.split()[-2:] for line in done.stdout.splitlines()]
    assert not {kind for kind, _ in held} & set("bBdDC"), "global state"
    needed = {name.split("@")[0].rstrip("f") for kind, name in held if kind == "U"}
    own = {"exp", "expm1", "log", "pow", "sqrt", "exp2", "ldexp", "memcpy", "memmove", "memset"}
    assert needed <= own | {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}


@pytest.mark.slow
def test_sanitizers_are_silent(tmp_path: Path) -> None:
    library, own = controller("default"), rig("bouc-wen")
    stage, pairs = own.stage(), np.zeros((own.reference.size, 2))
    for k, r in enumerate(own.reference.tolist()):
        u = library.step(r)
        pairs[k] = r, stage.step(u)
        library.learn(u, pairs[k, 1])
    library.reset()
    pairs[4000:4003] = [[np.inf, 1.0], [0.0, 1e30], [1e30, -np.inf]]
    done = under_sanitizers(
        pz.export.c(library, name="stage"), pairs, tmp_path, call="stage_step(&state, pair[0])",
        low="-100.0", high="100.0", then="stage_learn(&state, u, pair[1]);", end="stage_get_stage(&state)",
    )  # fmt: skip
    assert done == (2, b"")


def test_what_does_not_go_together_is_refused() -> None:
    library, c, odd = controller("line"), pz.export.c, cast("Any", None)
    inverse = pz.InverseCompensator(pz.ColemanHodgdon(0.02, 0.12, 0.0036), LIMITS)
    calls: list[tuple[Any, str]] = [
        (lambda: c(library, inverse), "leave out"),
        (lambda: c(library, update_interval=20), "leave out"),
        (lambda: pz.export.fmu(library, odd, "stage.fmu"), "AdaptiveFeedforward"),
        (lambda: c(library, name="double-u"), "name"),
        (lambda: c(library, precision=odd), "precision"),
        (lambda: pz.export.CompiledController(c(library)), "CompiledFeedforward"),
        (lambda: pz.export.CompiledFeedforward(c(None, inverse)), "CompiledController"),
        (lambda: c(pz.HysteresisRLS(FS)), "compensator"),
    ]
    for call, words in calls:
        with pytest.raises(ValueError, match=words):
            call()
