"""The default estimator over a hundred million samples: half an hour of a stage at 50 kHz."""

import numpy as np
import pytest

import piezoest as pz

SAMPLE_RATE, NOISE = 50_000.0, 1.2e-3
TRUE = pz.ColemanHodgdon(alpha=0.021, beta=0.147, gamma=0.00429)
BLOCKS, RUN_IN, FIRST = 200, 4, 20
# Standard deviations: of so few blocks an estimate of these is itself uncertain.
WITHIN = 8.0


@pytest.mark.slow
def test_it_neither_winds_up_nor_drifts() -> None:
    rng, estimator = np.random.default_rng(0), pz.HysteresisRLS(SAMPLE_RATE)
    u = pz.signals.triangle(35.0, 5.0, 50, SAMPLE_RATE).values
    loop = TRUE.simulate(np.tile(u, 2))[u.size :]
    found = []
    for _ in range(BLOCKS):
        estimator.run(u, loop + NOISE * rng.standard_normal(u.size), every=u.size)
        found.append(estimator.theta)
        P = estimator.P
        scale = np.sqrt(np.diag(P))
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P / np.outer(scale, scale))[0] > 0.0
    settled = np.array(found[RUN_IN:])  # the noise of the sensor is learnt over a hundred periods
    start, scatter = settled[:FIRST].mean(axis=0), settled[:FIRST].std(axis=0, ddof=1)
    deviation = (settled - start) / scatter
    assert np.max(np.abs(deviation)) < WITHIN
    trend = np.polyfit(np.linspace(0.0, 1.0, len(settled)), deviation, 1)[0]
    assert np.max(np.abs(trend)) < WITHIN
