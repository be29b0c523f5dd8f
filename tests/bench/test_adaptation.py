"""The benchmark of adaptation: candidates, runs, summaries and the command, on tiny selections."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import piezoest as pz
from piezoest.bench import adaptation as bench
from piezoest.bench import policy_figures, targets
from piezoest.bench.candidates import candidate
from piezoest.bench.cases import RIGHT_MODEL
from piezoest.bench.combinations import COMBINATIONS, Combination
from piezoest.bench.scenarios import SCENARIOS
from piezoest.bench.targets import criteria
from piezoest.cli import app
from piezoest.policies import DeadZone, NormBound

FS = 4000.0
SMALL: dict[str, Any] = {"sample_rate": FS, "before": 2, "after": 4, "rest": 0.4, "drift": 1.0, "updates": 40}

OWN = """
class Still:
    def __init__(self, sample_rate, initial_model, size=1.0):
        self.model = initial_model
        self.size = size

    model = None

    def step(self, u, x):
        pass

class Broken(Still):
    def step(self, u, x):
        raise RuntimeError("no idea")
"""


def run(*arguments: object) -> Result:
    words = ["bench", "adaptation", *(str(argument) for argument in arguments)]
    return CliRunner().invoke(app, words, env={"COLUMNS": "80"})


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own_estimators_of_adaptation.py").write_text(OWN, encoding="utf-8")
    return "own_estimators_of_adaptation"


def test_candidates(own: str) -> None:
    made = candidate("HysteresisRLS(memory=0.2, policies=(NormBound(limit=50.0), DeadZone()))")(
        FS, RIGHT_MODEL
    )
    expected = pz.HysteresisRLS(
        FS, initial_model=RIGHT_MODEL, memory=0.2, policies=(NormBound(50.0), DeadZone())
    )
    assert made.to_dict() == expected.to_dict()
    plain = candidate("HysteresisEKF")(FS, RIGHT_MODEL)
    assert plain.to_dict() == pz.HysteresisEKF(FS, initial_model=RIGHT_MODEL).to_dict()
    mine = candidate(f"{own}:Still(size=-2)")(FS, RIGHT_MODEL)
    assert (mine.model, mine.size) == (RIGHT_MODEL, -2)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("NoSuch", "choose of"),
        ("HysteresisRLS(0.2)", "needs its name"),
        ("HysteresisRLS(memory=)", "invalid syntax"),
        ("HysteresisRLS(memory=0.2", "never closed"),
        ("HysteresisRLS(memory=0.2) + 1", "write it as"),
        ("HysteresisRLS(memory=later)", "no number"),
        ("HysteresisRLS(memory=open())", "no policy"),
        ("HysteresisRLS(policies=(DeadZone(size=1),))", "size"),
        ("HysteresisRLS(memry=0.2)", "takes no memry"),
        ("nonsense:", "module:Class"),
    ],
)
def test_refuses_what_is_no_candidate(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        candidate(text)


def test_default_estimators() -> None:
    names = bench.default_estimators()
    assert names[:6] == ("HysteresisRLS", *(f"HysteresisRLS(memory={m})" for m in (0.05, 0.1, 0.2, 0.4, 1)))
    assert "HysteresisEKF" in names
    assert ("OutputErrorRLS" in names) == hasattr(pz, "OutputErrorRLS")


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_runs(name: str) -> None:
    runs = bench.play(bench.Job(name, 1, ("HysteresisEKF",), SMALL))
    assert [each.estimator for each in runs] == ["linear feed-forward", "HysteresisEKF"]
    for each in runs:
        assert each.failure is None
        assert each.metrics is not None
        assert math.isfinite(each.metrics.settled_max)
        assert len(each.metrics.errors) == (5 if name == "drift" else 4)
    linear, adaptive = (each.metrics for each in runs)
    assert linear is not None
    assert adaptive is not None
    assert linear.ratio == linear.run_ratio == linear.worst_ratio == 1.0
    assert adaptive.linear_settled_max == linear.settled_max
    assert (adaptive.rest_excursion is not None) == (name == "dwell")
    json.dumps([each.to_dict() for each in runs], allow_nan=False)


def test_voltage_stays_within_the_stage() -> None:
    case = SCENARIOS["cold-start"].build(0, **{**SMALL, "amplitude": 30.0})
    for estimator in (None, "HysteresisRLS(memory=0.02)"):
        assert np.max(np.abs(bench.follow(case, estimator).voltage)) <= 100.0


def test_jobs_and_processes_give_the_same_runs() -> None:
    jobs = bench.jobs_for(["cold-start", "noise"], ["HysteresisEKF"], range(2), SMALL)
    assert [(job.scenario, job.seed) for job in jobs] == [
        ("cold-start", 0), ("noise", 0), ("cold-start", 1), ("noise", 1),
    ]  # fmt: skip
    here = [each for some in bench.in_parallel(jobs, 1) for each in some]
    there = [each for some in bench.in_parallel(jobs, 2) for each in some]
    assert sorted(map(repr, here)) == sorted(map(repr, there))
    assert bench.summarise(here) == bench.summarise(there)
    with pytest.raises(ValueError, match="nowhere"):
        bench.jobs_for(["nowhere"], [], range(1), {})


def test_summary_counts_what_did_not_settle_as_infinite(own: str) -> None:
    job = bench.Job("cold-start", 0, (f"{own}:Broken", f"{own}:Still"), SMALL)
    runs = bench.play(job)
    rows = {row["estimator"]: row for row in bench.summarise(runs)}
    broken, still = rows[f"{own}:Broken"], rows[f"{own}:Still"]
    assert runs[1].failure == "RuntimeError: no idea"
    assert (broken["failures"], broken["diverged"], broken["settled_soon"]) == (1, 1, 0.0)
    assert broken["settled_max"] == {"median": None, "q95": None}
    assert broken["transient"] == []
    assert (still["failures"], still["runs"]) == (0, 1)
    assert still["settling_periods"]["median"] is None
    assert still["excursion"]["median"] == 0.0
    assert still["rest_excursion"] == {"median": None, "q95": None}
    assert len(still["transient"]) == 4


def row(scenario: str, estimator: str, **values: float | None) -> dict[str, Any]:
    numbers = {"settled_max": 0.02, "ratio": 0.02, "rest_excursion": 1e-4, "first_after_rest": 1.0, **values}
    found: dict[str, Any] = {key: {"median": value, "q95": value} for key, value in numbers.items()}
    return {"scenario": scenario, "estimator": estimator, "settled_soon": 1.0, "diverged": 0, **found}


def test_criteria() -> None:
    rows = [
        row("cold-start", "HysteresisRLS"),
        row("cold-start", "HysteresisRLS(memory=0.4)", settled_max=0.018),
        row("cold-start", "HysteresisRLS(memory=1)", settled_max=None),
        row("cold-start", "OutputErrorRLS", ratio=0.04),
        row("dwell", "HysteresisRLS", first_after_rest=2.0),
    ]
    found = {each["what"]: (each["value"], each["met"]) for each in criteria(rows)}
    assert found == {
        "cold-start: part settled within 2 periods": (1.0, True),
        "cold-start: settled error over the best fixed memory's": (pytest.approx(0.02 / 0.018), True),
        "cold-start, OutputErrorRLS: settled error over linear feed-forward's": (0.04, False),
        "dwell: parameters' excursion": (1e-4, True),
        "dwell: first error after over last before": (2.0, False),
        "runs that diverged, without the guard": (0.0, True),
    }
    assert criteria([]) == []


def test_targets_are_planned_and_their_rows_are_found() -> None:
    jobs = targets.target_jobs(30, {"sample_rate": FS})
    titles = [job.title or "" for job in jobs]
    assert {title: titles.count(title) for title in titles} == {
        one.title: one.seeds or 30 for one in targets.SITUATIONS
    }
    assert list(targets.describe(titles)) == [one.title for one in targets.SITUATIONS]
    # At the paper's rate and amplitudes, whatever is chosen for the rest.
    triangles = [job for job in jobs if (job.title or "").startswith("triangle")]
    assert {job.overrides["sample_rate"] for job in triangles} == {50_000.0}
    assert {(job.overrides["amplitude"], job.overrides["frequency"]) for job in triangles} == set(
        targets.TRIANGLES
    )
    creepless = next(job for job in jobs if job.title == targets.WITHOUT_CREEP)
    assert (creepless.scenario, creepless.overrides) == ("dwell", {"sample_rate": FS, "creep": False})
    rows = [
        row(title, name)
        for title in dict.fromkeys(titles)
        for name in (targets.DEFAULT, targets.OUTPUT_ERROR)
    ]
    rows += [row(name, fixed) for name in targets.CHANGES for fixed in targets.FIXED]
    found = criteria(rows)
    assert [each["kind"] for each in found] == [
        *["settling"] * 4, *["hindsight"] * 4, *["linear"] * 5, *["rest"] * 4, "divergence",
    ]  # fmt: skip
    assert all(each["met"] for each in found)


def test_the_best_fixed_memory_is_that_with_the_least_settled_error() -> None:
    names = targets.FIXED
    rows = {
        ("cold-start", names[0]): row("cold-start", names[0], settled_max=0.03),
        ("cold-start", names[1]): row("cold-start", names[1], settled_max=0.01),
        ("cold-start", names[2]): row("cold-start", names[2], settled_max=None),
    }
    best = targets.best_fixed(rows, "cold-start")
    assert best is not None
    assert best["estimator"] == names[1]
    assert targets.best_fixed(rows, "gain-step") is None


def test_a_dwell_moves_no_parameter_of_the_model_in_use() -> None:
    """Models are handed over by the reference's travel, whatever an estimator makes of creep."""
    for creep in (True, False):
        job = bench.Job("dwell", 0, ("HysteresisRLS",), {**SMALL, "rest": 4.0, "creep": creep}, title="rest")
        runs = bench.play(job)
        assert {each.scenario for each in runs} == {"rest"}
        metrics = runs[1].metrics
        assert metrics is not None
        assert metrics.rest_excursion == metrics.rest_excursion_later == 0.0


@pytest.mark.parametrize("one", COMBINATIONS, ids=lambda one: f"{one.name}, {one.said}")
def test_combinations_hold_the_policy_they_are_named_by(one: Combination) -> None:
    made = candidate(one.estimator)(FS, RIGHT_MODEL).to_dict()["arguments"]
    kinds = {policy["policy"] for policy in made["policies"]}
    if one.name.startswith("no "):
        assert one.name.removeprefix("no ") not in kinds
    elif one.name in public_policies():
        # An exponential forgetting is said by its memory.
        assert one.name in kinds or (one.name == "Forgetting" and made["memory"] == 0.4)


def public_policies() -> set[str]:
    return set(pz.policies.__all__)


def test_every_policy_is_in_a_combination() -> None:
    said = " ".join(f"{one.name} {one.estimator}" for one in COMBINATIONS)
    assert [name for name in public_policies() if name not in said] == []


SHORT = ("--scenario", "cold-start", "--sample-rate", 4000, "--periods", 4, "--jobs", 1)


def test_command_end_to_end(own: str) -> None:
    own_one = f"{own}:Broken"
    result = run(
        *SHORT, "--seeds", 2, "--estimator", "HysteresisEKF", "--estimator", own_one, "--json", "a.json"
    )
    assert result.exit_code == 0, result.output
    for word in ("cold-start", "linear feed-forward", "HysteresisEKF", "2 seeds at 4000 Hz", "no idea"):
        assert word in result.stdout
    assert "2 of 2 cases" in result.stderr
    document = json.loads(Path("a.json").read_text(encoding="utf-8"))
    assert document["suite"] == "adaptation"
    assert {"cpu", "cores", "platform", "python"} <= set(document["machine"])
    assert document["versions"]["piezoest"] == pz.__version__
    assert document["date"].endswith("+00:00")
    assert document["seeds"] == 2
    assert document["conditions"] == {"sample_rate": 4000.0, "after": 4}
    assert document["estimators"] == ["HysteresisEKF", own_one]
    assert [each["seed"] for each in document["runs"]] == [0, 0, 0, 1, 1, 1]
    assert len(document["failures"]) == 2
    assert len(document["summary"]) == 3


def test_policies_are_drawn(own: str) -> None:
    names = [one.estimator for one in COMBINATIONS[:2]]
    jobs = [bench.Job(name, 0, tuple(names), SMALL) for name in ("cold-start", "gain-step")]
    rows = bench.summarise([each for job in jobs for each in bench.play(job)])
    rows[1]["transient"][0] = None
    document = {"summary": rows, "scenarios": {"cold-start": "", "gain-step": ""}}
    figure = policy_figures.transients(document, ["cold-start", "gain-step"])
    assert len(figure.axes) == 4
    assert [axes.get_title() for axes in figure.axes[:2]] == ["cold-start", "gain-step"]
    assert "else the default" in figure.axes[2].get_ylabel()
    drawn = np.asarray(figure.axes[0].lines[0].get_ydata())
    assert drawn[0] == pytest.approx(100.0 * rows[0]["transient"][0] / rows[0]["amplitude"])
    (path,) = policy_figures.write_policies(document, Path("there"))
    assert path == Path("there/changes.png")
    assert path.stat().st_size > 10_000


def test_command_leaves_single_runs_out(own: str) -> None:
    result = run(*SHORT, "--seeds", 1, "--estimator", "HysteresisEKF", "--no-runs", "--json", "-")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["runs"] == []
    assert {each["runs"] for each in document["summary"]} == {1}


def test_command_prints_json_alone() -> None:
    result = run(*SHORT, "--seeds", 1, "--estimator", "HysteresisRLS", "--json", "-")
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert {each["what"] for each in document["criteria"]} == {
        "cold-start: part settled within 2 periods",
        "runs that diverged, without the guard",
    }


def test_command_refuses_wrong_words(tmp_path: Path) -> None:
    for arguments in (
        ("--scenario", "nowhere"),
        ("--estimator", "NoSuch"),
        ("--seeds", 0),
        ("--asked", "--policies"),
        ("--asked", "--scenario", "dwell"),
        ("--policies", "--estimator", "HysteresisRLS"),
        ("--figures", tmp_path),
        ("--json", tmp_path / "nowhere" / "a.json"),
    ):
        assert run(*arguments).exit_code == 2, arguments
