"""README and documentation: numbers are those of docs/data and rightly counted, links and tests are there."""

import importlib
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from piezoest.bench.origin import code_of_parts, origin
from piezoest.bench.zoo.families import FAMILIES
from piezoest.bench.zoo.faults import FAULTS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Any:
    def load(name: str, folder: str = "docs") -> Any:
        monkeypatch.syspath_prepend(str(ROOT / folder))
        return importlib.import_module(name)

    return load


def test_readme_has_the_figures_of_the_data(program: Any) -> None:
    readme = program("readme")
    _, inside, _ = readme.parts((ROOT / "README.md").read_text(encoding="utf-8"))
    # A change of the code does not need the README anew, but new figures do.
    notes = re.compile(r"\s+\(since then .*?changed\)", re.DOTALL)
    made, kept = (notes.sub("", text) for text in (readme.figures(), inside))
    assert made.split() == kept.split(), "run python docs/readme.py"


def test_a_page_says_that_it_is_older_than_the_code(
    program: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = program("page_parts")
    page = SimpleNamespace(__name__="tuning_page", pieces=lambda document: {})
    monkeypatch.setattr(parts, "DOCS", tmp_path)
    (tmp_path / "data").mkdir()
    for other, changed in (({}, []), ({"stage": "0", "cli": "0"}, ["stage"])):
        text = json.dumps(origin() | {"code": code_of_parts() | other})
        (tmp_path / "data" / "tuning.json").write_text(text, encoding="utf-8")
        document = parts.read("tuning")
        assert document["changed"] == changed
        parts.write_page(page)
        for said in (capsys.readouterr().out, parts.replacements("tuning", {}, document)):
            assert ("code of stage" in said) == bool(changed)


LINKS = {
    '<a href="none.html">': "none.html does not exist",
    '<a href="other.html#gone">': "other.html#gone: no such anchor",
    '<a href="#lost">': "#lost: no such anchor",
    '<img src="none.png">': "none.png does not exist",
    '<script src="https://cdn.example.org/x.js"></script>': "x.js comes from elsewhere",
    '<link rel="stylesheet" href="//cdn.example.org/x.css">': "x.css comes from elsewhere",
}


def test_links_that_lead_nowhere_are_found(program: Any, tmp_path: Path) -> None:
    broken = program("check_links").broken
    good = '<p id="top"><a href="other.html#there">x</a><a href="https://example.org">y</a></p>'
    (tmp_path / "other.html").write_text('<p id="there">z</p>', encoding="utf-8")
    for links, ends in (((), []), (LINKS, LINKS.values())):
        (tmp_path / "index.html").write_text(good + "".join(links), encoding="utf-8")
        found = list(broken(tmp_path))
        assert len(found) == len(links)
        assert all(said.endswith(end) for said, end in zip(found, ends, strict=True))


def test_tests_that_pages_name_are_there() -> None:
    pages = [*DOCS.glob("*.rst"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    named = [found for text in texts for found in re.findall(r"(tests/[\w/]+\.py)::(\w+)", text)]
    assert named
    for file, test in named:
        assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8")


def row(seed: int, ratio: float | None = 0.5, **given: Any) -> dict[str, Any]:
    numbers = dict.fromkeys(("amplitude", "gain", "width", "sensor_noise", "creep"), 1.0)
    return {
        **numbers, "seed": seed, "family": "duhem", "reference": "sine", "fault": "none", "mode": "none",
        "mechanics": "none", "sample_rate": 1000.0, "frequency": 5.0, "block": 1, "delay": 0, "low": 0.0,
        "high": 100.0, "failure": None, "finite": True, "within_limits": True, "rail": 0.0,
        "rests_at_rail": False, "ratio": ratio, "last_ratio": ratio, "cycle_ratio": ratio,
        "named_right": None, "recovery": False, "recovered": None, **given,
    }  # fmt: skip


def test_safety_counts_what_is_judged_only(program: Any) -> None:
    safety = program("safety", "benchmarks")
    rows = [
        row(0), row(1, 2.0, fault="gap", mode="permanent"), row(2, None, fault="gap", mode="from-start"),
        row(3, 3.0, block=50), row(4, None),
    ]  # fmt: skip
    found = safety.summed_up(rows)
    every = found["all"]
    assert (every["runs"], every["judged"], every["violations"]["ratio"]) == (5, 3, 2)
    assert (every["quantiles"]["ratio"]["100 %"], every["curve"][0]) == (3.0, 0.5)
    assert len(every["curve"]) == len(safety.LEVELS)
    assert (found["healthy"]["runs"], found["often"]["runs"]) == (3, 4)
    by_fault = [(each["fault"], each["judged"], each["over"]) for each in found["by_fault"]]
    assert by_fault == [("gap", 1, 1), ("none", 2, 1)]
    assert [each["seed"] for each in found["worst"]][:2] == [3, 1]
    assert safety.drawn(rows)["fault"] == {"gap": 2, "none": 3}
    # 100 samples in a leg: 6 in a block are 16.7 calls, 7 are 14.3; 6 samples late is below a sixteenth.
    often = [
        safety.often(row(0, **given)) for given in ({"block": 6, "delay": 6}, {"block": 7}, {"delay": 7})
    ]
    assert often == [True, False, False]


def test_everything_drawn_is_described() -> None:
    text = (DOCS / "safety.rst").read_text(encoding="utf-8")
    described = set(re.findall(r"^   \* - ``([\w-]+)``$", text, re.M))
    assert described == {*FAMILIES, *FAULTS}


def test_coverage_counts_readings_without_spikes_and_later_jumps(program: Any) -> None:
    judging, trained, k = program("log_judging", "benchmarks"), 2000, np.arange(4000)
    truth = np.sin(0.02 * k)
    # Jumps count up to the end of the fitted part.
    log: Any = SimpleNamespace(truth=truth, jumps=1.5 * (k >= 500) + 4.0 * (k >= 3000), spikes=k >= 3500)
    np.testing.assert_array_equal(judging.expected(log, trained), truth[trained:] + 1.5)
    log.x = truth + log.jumps + 50.0 * log.spikes
    log.x[trained : trained + 500] = np.nan
    lower, upper = truth + 0.5, truth + 2.5
    assert judging.coverage(log, trained, lower, upper) == 1.0
    # Of 1000 that count, 250 are below.
    lower[3250:] += 3.0
    assert judging.coverage(log, trained, lower, upper) == 0.75
