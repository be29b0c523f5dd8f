"""
Minor loops
===========

A sum of two tones makes small loops within larger ones. Plays remember such loops; a Coleman-Hodgdon model
does not.
"""

import matplotlib.pyplot as plt
import numpy as np

import piezoest as pz

fs = 10_000.0  # Hz
r = pz.signals.two_tone([3.5, 1.5], [2.0, 7.0], 4.0, fs)  # µm

# %%
# The same loop with two estimators, on a Preisach stage, which is neither of the two models:

records = {}
for estimator in (pz.HysteresisRLS(fs), pz.PrandtlIshlinskiiRLS(fs)):
    name = type(estimator).__name__
    records[name] = pz.track(
        r,
        stage=pz.PreisachStage(fs, seed=0),
        compensator=pz.InverseCompensator(pz.ColemanHodgdon(0.02, 0.12, 0.0036)),
        estimator=estimator,
    )
    print(f"{name:>21}: {records[name].max_error(last_periods=1):.4f} µm")

# %%
# The path of the voltage in the last period, and the error with either:

figure, (loop, series) = plt.subplots(1, 2, figsize=(6.4, 3.2), width_ratios=[1, 1.6], layout="constrained")
last = slice(-int(fs), None)
voltage = records["PrandtlIshlinskiiRLS"].voltage[last]
loop.plot(voltage, r.values[last], lw=0.8)
loop.set(xlabel="voltage [V]", ylabel="reference [µm]")
for name, record in records.items():
    series.plot(np.arange(len(r))[last] / fs, record.error[last], lw=0.8, label=name)
series.set(xlabel="time [s]", ylabel="error [µm]")
series.legend()
