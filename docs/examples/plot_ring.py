"""
Linear against adaptive compensation
====================================

The paper's experiment on its simulated stage. The reference is a triangle. First a gain is learnt while the
stage runs, then a hysteresis model, whose inverse computes the voltage.
"""

import matplotlib.pyplot as plt
import numpy as np

import piezoest as pz

fs = 50_000.0  # Hz
r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=10, sample_rate=fs)  # µm

# %%
# The same reference and the same stage, twice. Both runs start with parameters that are wrong for this stage.

start = {
    "linear": pz.LinearGain(0.12),
    "adaptive inverse": pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036),
}
records = {}
for name, model in start.items():
    records[name] = pz.track(
        r,
        stage=pz.PaperStage(sample_rate=fs, seed=0),
        compensator=pz.InverseCompensator(model),
        estimator=pz.HysteresisRLS(sample_rate=fs, initial_model=model),
    )

# %%
# The largest true error of the last two periods:

for name, record in records.items():
    print(f"{name:>16}: {record.max_error(last_periods=2):.3f} µm")

# %%
# The error while the parameters are learnt, and displacement over reference in the last period, as in the
# paper's Fig. 4.

figure, (series, loop) = plt.subplots(1, 2, figsize=(6.4, 3.2), width_ratios=[1.6, 1], layout="constrained")
last = slice(-int(r.period), None)
for name, record in records.items():
    series.plot(np.arange(len(r)) / fs, record.error, lw=0.8, label=name)
    loop.plot(record.reference[last], record.displacement[last], lw=0.8, label=name)
series.set(xlabel="time [s]", ylabel="error [µm]")
series.legend()
loop.set(xlabel="reference [µm]", ylabel="displacement [µm]")

# %%
# The parameters, relative to their start values:

record = records["adaptive inverse"]
figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
axes.plot(np.arange(len(r)) / fs, record.theta / start["adaptive inverse"].theta)
axes.set(xlabel="time [s]", ylabel="parameter / its start")
axes.legend(start["adaptive inverse"].parameter_names)
