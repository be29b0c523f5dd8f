"""The face of a fit: what it refuses, what it shows, and where it goes on."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from piezoest.fitting import FORMS, Fitter
from piezoest.fitting.flaws import flawed
from piezoest.fitting.play_columns import PlayColumns
from tests.fitting.stages import RATE, N, T, noise, rms, stage, voltage

U = voltage(np.random.default_rng(0))
X = stage(np.random.default_rng(1)).simulate(U)
SIGMA = 1e-3 * float(np.ptp(X))
Y = X + noise(SIGMA)


def fit(u: Any = U, x: Any = Y, **options: Any) -> Any:
    return pz.fit(u, x, **{"sample_rate": RATE, **options})


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "lengths": ({"x": Y[:-1]}, "u and x must have one length, got 5000 and 4999"),
    "shape": ({"u": U[:, None]}, r"u must have shape \(N,\)"),
    "text": ({"x": ["a"] * N}, "x must"),
    "few": ({"u": U[:49], "x": Y[:49]}, "49 samples in common"),
    "few in common": ({"x": np.where(np.arange(N) < 40, Y, np.nan)}, "40 samples in common"),
    "no number": ({"x": np.full(N, np.nan)}, "0 samples in common"),
    "constant voltage": ({"u": np.full(N, 5.0)}, "u must move, it stays at 5 V"),
    "falling": ({"x": -Y}, "x must rise with u.* change the sign"),
    "another run": ({"u": voltage(np.random.default_rng(1))}, "x must rise with u.* leaves .* of one run"),
    "constant displacement": ({"x": np.full(N, 2.0)}, "x must move with u, it stays at 2 µm"),
    "model": ({"model": "spline"}, "model must be one of line, .*, got 'spline'"),
    "delay too long": ({"delay": 30.5}, "delay must"),
    "delay no number": ({"delay": np.nan}, "delay must"),
    "delay in words": ({"delay": "soon"}, "delay must be 'auto' or a number of samples, got 'soon'"),
    "settle": ({"settle": 10.0}, "settle must"),
    "sample rate": ({"sample_rate": 0.0}, "sample_rate must"),
    "flaws of another log": ({"flaws": flawed(U[:100], Y[:100])}, "flaws must be those of u and x"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_refused(name: str) -> None:
    options, words = REFUSED[name]
    with pytest.raises(ValueError, match=words):
        fit(**options)


@pytest.mark.parametrize("model", FORMS)
def test_every_kind_is_fitted_and_the_same_record_gives_the_same_bits(model: str) -> None:
    found, again = fit(model=model), fit(model=model)
    assert found.label == FORMS[model].label
    assert found.solver
    assert found.model.is_admissible
    prediction = found.predict()
    np.testing.assert_array_equal(again.predict().x, prediction.x)
    assert again.standard_errors == found.standard_errors
    assert prediction.x.shape == U.shape
    assert np.all(prediction.lower < prediction.upper)
    state = {} if found.initial_state is None else {"initial_state": found.initial_state}
    x = found.model.simulate(U, **state) + found.drift * np.arange(N) / N
    np.testing.assert_allclose(x, prediction.x, atol=1e-9)


def test_a_delay_counts_as_a_parameter_where_it_is_fitted() -> None:
    def parameters(**options: Any) -> int:
        return Fitter(U, Y, sample_rate=RATE, **options).form("coleman-hodgdon").parameters

    assert (parameters(delay=0.0), parameters(delay="auto")) == (5, 6)
    assert parameters(delay="auto", tells_lag=False) == 5


def test_lists_and_flaws_may_be_given_and_nothing_is_changed() -> None:
    u, x = U.copy(), Y.copy()
    x[[5, 700]] = np.nan
    before, flaws = x.copy(), flawed(u, x)
    found = fit(u, x)
    np.testing.assert_array_equal(u, U)
    np.testing.assert_array_equal(x, before)
    np.testing.assert_array_equal(fit(u.tolist(), x.tolist(), flaws=flaws).predict().x, found.predict().x)
    assert not fit(u, x, flaws=flaws._replace(spikes=np.arange(N) < 100)).counts[:100].any()
    assert fit(settle=0.2).left_out == 200


KINDS = [("plays", 2e-3), ("plays-creep", 3e-3), ("coleman-hodgdon", 3e-3)]


@pytest.mark.parametrize(("model", "most"), KINDS)
def test_another_record_is_predicted_from_rest_whatever_its_voltage(model: str, most: float) -> None:
    """Another one comes from 0 V, at once, though that of plays, which is fitted, comes from elsewhere."""
    creep = pz.Creep([0.05], [2.5]) if model == "plays-creep" else None
    loop, plays = pz.ColemanHodgdon(0.03, 0.12, 0.0066), stage(np.random.default_rng(1), creep=creep)
    jumps = {"allow_jumps": True} if model == "coleman-hodgdon" else {}
    true: Any = loop if jumps else plays
    before = np.concatenate([np.full(5, 45.0), np.linspace(45.0, U[0], 50)]) if model == "plays" else U[:0]
    x = true.simulate(np.concatenate([before, U]), **jumps)[before.size :]
    found = fit(U, x + noise(1e-3 * float(np.ptp(x))), model=model)
    for v in (voltage(np.random.default_rng(5)), voltage(np.random.default_rng(6), 15.0, 20.0)):
        expected = true.simulate(np.concatenate([[0.0, v[0]], v]), **jumps)[2:]
        assert rms(found.predict(v).x - expected) < most * np.ptp(x)


def test_another_record_may_have_another_sample_rate() -> None:
    model = stage(np.random.default_rng(1), creep=pz.Creep([0.06], [0.25]))
    x = model.simulate(np.interp(np.arange(N) - 4.0, np.arange(N), U))
    found = fit(U, x + noise(SIGMA), model="plays-creep", delay=4.0)
    whole = found.elsewhere(U)
    np.testing.assert_array_equal(found.predict(U).x, whole)
    assert rms(found.elsewhere(U[::2], sample_rate=0.5 * RATE) - whole[::2]) < 2.0 * SIGMA
    assert rms(found.elsewhere(U[::2]) - whole[::2]) > 4.0 * SIGMA


def test_a_voltage_without_a_number_is_refused() -> None:
    found = fit(model="line")
    for predict in (found.predict, found.continued, found.elsewhere):
        with pytest.raises(ValueError, match="u must hold a voltage"):
            predict(np.full(10, np.nan))
    assert np.all(np.isfinite(found.predict([1.0, np.nan, 3.0]).x))


def test_what_is_continued_begins_as_the_fitted_record() -> None:
    half = N // 2
    found = fit(U[:half], Y[:half] + 0.02 * np.arange(half) / half)
    whole = found.continued(U)
    np.testing.assert_allclose(whole.x[:half], found.predict().x, atol=1e-12)
    # What has drifted stays, and the interval does not get narrower.
    assert rms(whole.x[half:] - X[half:] - 0.02) < 0.02
    widths = whole.upper - whole.lower
    assert widths[-1] >= widths[0]


def growing(seed: int, centre: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Swings that grow from 0.35 of 40 V to all of it, and what a stage makes of them."""
    rng = np.random.default_rng(seed)
    wave = np.sin(2.0 * np.pi * 1.7 * T + rng.uniform(0.0, 6.0))
    u = centre + 40.0 * np.linspace(0.35, 1.0, N) * wave
    return u, stage(rng, 40.0, plays=25).simulate(u)


@pytest.mark.parametrize("model", ["plays", "plays-asymmetric"])
@pytest.mark.slow_but_first
def test_plays_that_go_on_foresee_a_growing_amplitude(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of stages whose plays go on beyond the fitted range, from rest at 0 V."""

    def missed(seed: int) -> float:
        u, x = growing(seed)
        y = (x + noise(1e-3 * float(np.ptp(x)), seed))[: N // 2]
        return rms((fit(u[: N // 2], y, model=model).continued(u).x - x)[N // 2 :])

    own = [missed(seed) for seed in range(3)]
    monkeypatch.setattr(PlayColumns, "beyond", lambda basis, w: (basis, w, 0.0))
    assert np.max(np.divide(own, [missed(seed) for seed in range(3)])) < 0.95


@pytest.mark.parametrize("centre", [0.0, 40.0])
def test_a_prediction_beyond_the_record_is_that_of_the_model(centre: float) -> None:
    u, x = growing(0, centre)
    found: Any = fit(u[: N // 2], x[: N // 2], model="plays")
    expected = found.model.simulate(u, initial_state=found.initial_state)
    np.testing.assert_allclose(found.continued(u).x, expected, atol=1e-9)
