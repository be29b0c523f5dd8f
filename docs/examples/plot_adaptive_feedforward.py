"""
A complete controller
=====================

`AdaptiveFeedforward` measures the gain of a stage, moves to the reference, learns the hysteresis, and reports
implausible readings.
"""

import matplotlib.pyplot as plt
import numpy as np

import piezoest as pz

fs = 10_000.0  # Hz
r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=20, sample_rate=fs)  # µm
limits = pz.VoltageLimits(minimum=-50.0, maximum=100.0)  # V: with the sample rate all that it is told
broken = (1.9, 2.5)  # s: the sensor repeats its last reading

# %%
# The same loop for the controller and for the straight line alone, ``estimators=()``.


def drive(controller: pz.AdaptiveFeedforward) -> np.ndarray:
    stage = pz.PaperStage(sample_rate=fs, seed=0)
    error, reading = np.empty(len(r)), 0.0
    for k, r_k in enumerate(r):
        u = controller.step(r_k)
        x = stage.step(u)
        if not broken[0] <= k / fs < broken[1]:
            reading = x
        controller.learn(u, reading)
        error[k] = r_k - stage.displacement  # of the true displacement
    return error


controller = pz.AdaptiveFeedforward(fs, limits=limits)
errors = {
    "straight line alone": drive(pz.AdaptiveFeedforward(fs, limits=limits, estimators=())),
    "AdaptiveFeedforward": drive(controller),
}

# %%
# The events, and the models at the end:

for event in controller.events:
    print(f"{event.time:.2f} s, {event.action}: {event.reason}")
for candidate in controller.candidates:
    print(f"{candidate.name:>21} missed {candidate.missed:.4f} µm{', drives' * candidate.drives}")

# %%
# The true error. While the sensor hangs, nothing is learnt and the straight line drives.

figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
for name, error in errors.items():
    axes.plot(np.arange(len(r)) / fs, error, lw=0.8, label=name)
axes.axvspan(*broken, color="0.88", label="the sensor hangs")
axes.set(xlabel="time [s]", ylabel="error [µm]", ylim=(-1.2, 1.2))
axes.grid(alpha=0.3)
axes.legend(loc="upper right")
