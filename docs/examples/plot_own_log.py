"""
A recorded log
==============

From a file that another program wrote to a compensated stage: columns and units named, a model with
standard errors, and its inverse tried on the stage that was recorded.
"""

import tempfile
from pathlib import Path

import numpy as np

import piezoest as pz

# %%
# A log, as a data logger might leave it: millivolts of the controller, volts of the gauge, a sample rate
# that somebody wrote down, and a sensor that failed for a while.

fs = 5000.0  # Hz
u = pz.signals.amplitude_modulated(35.0, 5.0, 1.0, 4.0, fs, depth=0.6).values  # V
x = pz.PaperStage(fs, seed=0).run(u)  # µm
x[8000:8040] = np.nan
path = Path(tempfile.mkdtemp()) / "log.npz"
np.savez(path, command=u / 20.0 * 1e3, gauge=x / 5.0, fs=fs)

# %%
# The controller's volts count twenty times at the stage, and one volt of the gauge is 5 µm.

record = pz.read_record(
    path,
    columns={"voltage": "command", "displacement": "gauge"},
    units={"voltage": "0.02 V", "displacement": "5 um"},
)
print(record)

# %%
# The first half is fitted, the second is predicted from the voltage alone.

found = pz.identify(record)
print(found)
figure = found.plot()

# %%
# Its inverse, without any adaptation, beside the best straight line:

r = pz.signals.triangle(amplitude=5.0, frequency=5.0, periods=4, sample_rate=fs)
for name, compensator in {
    "straight line": pz.LinearCompensator(pz.LinearGain(found.line.gain)),
    "inverse": pz.InverseCompensator(pz.ColemanHodgdon(*found.model.theta)),
}.items():
    record = pz.track(r, stage=pz.PaperStage(fs, seed=1), compensator=compensator)
    print(f"{name:>14}: {record.max_error(last_periods=2):.3f} µm")
