"""
When the stage changes
======================

The gain of the stage falls by 20 % while it runs. How fast an estimator follows depends on its memory.
"""

import matplotlib.pyplot as plt
import numpy as np

import piezoest as pz

fs = 10_000.0  # Hz
r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=20, sample_rate=fs)  # µm
model = pz.ColemanHodgdon(alpha=0.02, beta=0.15, gamma=0.0042)


def gain(t: np.ndarray) -> np.ndarray:
    return np.where(t < 2.05, 1.0, 0.8)


# %%
# By default the memory is counted in periods of the reference. A number is a time constant in seconds.

estimators = {
    "default": pz.HysteresisRLS(fs, initial_model=model),
    "memory=0.4 s": pz.HysteresisRLS(fs, initial_model=model, memory=0.4),
    "memory=1.6 s": pz.HysteresisRLS(fs, initial_model=model, memory=1.6),
    "HysteresisEKF": pz.HysteresisEKF(fs, initial_model=model),
}
errors = {}
for name, estimator in estimators.items():
    record = pz.track(
        r,
        stage=pz.PaperStage(fs, seed=0, gain_schedule=gain),
        compensator=pz.InverseCompensator(model),
        estimator=estimator,
    )
    errors[name] = record.max_error_per_period()
    print(f"{name:>14}: {errors[name][-2:].max():.3f} µm in the last periods")

# %%
# The largest error of each period:

figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
for name, error in errors.items():
    axes.semilogy(np.arange(1, error.size + 1), error, "o-", ms=4, label=name)
axes.axvline(2.05 * 5.0 + 0.5, color="0.6", lw=0.8)
axes.set(xlabel="period", ylabel="largest error [µm]")
axes.grid(alpha=0.3, which="both")
axes.legend()
