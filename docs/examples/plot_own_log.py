"""
A recorded log
==============

From a file of another program to a compensated stage: name columns and units, identify a model, and use its
inverse on the recorded stage.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import piezoest as pz

# %%
# A log as a data logger may write it: millivolts of the controller, volts of the sensor, a sample rate, and
# missing readings.

fs = 5000.0  # Hz
u = pz.signals.amplitude_modulated(35.0, 5.0, 1.0, 4.0, fs, depth=0.6).values  # V
x = pz.PaperStage(fs, seed=0).run(u)  # µm
x[8000:8040] = np.nan
path = Path(tempfile.mkdtemp()) / "log.npz"
np.savez(path, command=u / 20.0 * 1e3, gauge=x / 5.0, fs=fs)

# %%
# One millivolt of the controller is 20 mV at the stage, and one volt of the sensor is 5 µm.

record = pz.read_record(
    path,
    columns={"voltage": "command", "displacement": "gauge"},
    units={"voltage": "0.02 V", "displacement": "5 um"},
)
print(*record.notes, sep="\n")

# %%
# Models of all kinds are fitted to the first half. The second half is predicted from the voltage alone.

found = pz.identify(record)
print(found)

figure, (loop, series) = plt.subplots(2, 1, figsize=(6.4, 6.4), layout="constrained")
loop.plot(record.voltage, record.displacement, color="0.7", lw=2, label="measured")
loop.plot(record.voltage, found.prediction, lw=0.7, label="model, from the voltage alone")
loop.set(xlabel="voltage [V]", ylabel="displacement [µm]")
loop.legend()
predicted = found.predict()
half = 0.5 * (predicted.upper - predicted.lower)
series.plot(record.time, found.residual, color="C3", lw=0.6)
series.fill_between(record.time, -half, half, color="C0", alpha=0.2, lw=0, label="95 of 100 readings")
series.axvspan(record.time[found.trained], record.time[-1], color="C1", alpha=0.15, lw=0, label="held out")
series.set(xlabel="time [s]", ylabel="measured − model [µm]", ylim=(-0.01, 0.01))
series.legend()

# %%
# The inverse of the model without adaptation, and the best straight line:

r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=4, sample_rate=fs)
for name, compensator in {
    "straight line": pz.LinearCompensator(pz.LinearGain(found.line.gain)),
    "inverse": pz.InverseCompensator(found.model),
}.items():
    record = pz.track(r, stage=pz.PaperStage(fs, seed=1), compensator=compensator)
    print(f"{name:>14}: {record.max_error(last_periods=2):.3f} µm")
