"""Follow a reference on a real stage, and leave the stage at rest whatever happens.

Replace the methods of the class Driver, and set the constants. As it stands, the program
runs on a simulated stage:

    python examples/own_stage.py
"""

import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import piezoest as pz

RATE = 1_000.0  # Hz, of the loop
LIMITS = pz.VoltageLimits(
    minimum=0.0, maximum=100.0
)  # V, of the stage or of the amplifier: the narrower range
REST = 0.0  # V, before and after the run
BIAS = 50.0  # V, at which the reference begins
SLOPE = 200.0  # V/s, of the ramps
FARTHEST = 20.0  # µm from the start point: beyond it the program stops
LONGEST = 0.1  # s, without a reading or with a fault: after it the program stops
FILE = Path("run.npz")


class Driver:
    """Opens the hardware, writes volts at the stage, reads micrometres; replace the four methods."""

    def __init__(self) -> None:
        self._stage = pz.PaperStage(RATE, seed=0)
        self._x = 0.0

    def write(self, voltage: float) -> None:
        """Set the voltage, and return when it has been sent."""
        self._x = self._stage.step(voltage)

    def read(self) -> float | None:
        """Return the displacement [µm], or None if the reading failed."""
        return self._x

    def close(self) -> None:
        """Release the hardware."""


class Pace:
    """Waits for the start of each sample, and counts the samples that start late."""

    def __init__(self, rate: float) -> None:
        self._step, self._next, self.late = 1.0 / rate, time.perf_counter(), 0

    def wait(self) -> None:
        now = time.perf_counter()
        if now > self._next + self._step:
            self.late += 1
            self._next = now  # go on from here: samples in quick succession would shake the stage
        while (left := self._next - time.perf_counter()) > 0.0:
            if left > 2e-3:
                time.sleep(left - 1e-3)  # sleep is accurate to about a millisecond; the rest is waited out
        self._next += self._step


class Run:
    """One run: the driver, the voltage that was written last, and what has been recorded so far."""

    def __init__(self, driver: Any, samples: int) -> None:
        self.driver, self.voltage, self.done, self.late = driver, REST, 0, 0
        self.record = {
            name: np.full(samples, np.nan) for name in ("reference", "voltage", "displacement", "busy")
        }

    def ramp(self, target: float) -> None:
        """Move the voltage to the target at a limited slope."""
        pace = Pace(RATE)
        steps = int(np.ceil(abs(target - self.voltage) / SLOPE * RATE))
        for voltage in np.linspace(self.voltage, target, steps + 1)[1:].tolist():
            pace.wait()
            self.driver.write(voltage)
            self.voltage = voltage

    def follow(self, controller: pz.AdaptiveFeedforward, reference: pz.Signal) -> None:
        """Ramp to the start point, and follow the reference from the displacement there."""
        self.ramp(BIAS)
        time.sleep(0.1)  # the stage comes to rest
        readings = [x for x in (self.driver.read() for _ in range(20)) if x is not None]
        if not readings:
            raise RuntimeError("the sensor gives no readings")
        start = float(np.median(readings))
        controller.reset(voltage=BIAS, displacement=start)
        pace, missing, check = Pace(RATE), 0, max(1, round(LONGEST * RATE))
        for k, r in enumerate((start + reference.values).tolist()):
            pace.wait()
            began = time.perf_counter()
            u = controller.step(r)
            self.driver.write(u)
            self.voltage = u
            x = self.driver.read()
            controller.learn(u, x)
            missing = missing + 1 if x is None or np.isnan(x) else 0
            x = np.nan if x is None else x
            for name, value in zip(self.record, (r, u, x, time.perf_counter() - began), strict=True):
                self.record[name][k] = value
            self.done, self.late = k + 1, pace.late
            if abs(x - start) > FARTHEST:
                raise RuntimeError(f"the sensor reads {x:.3f} µm, too far from {start:.3f} µm")
            if missing > check:
                raise RuntimeError(f"no reading for {LONGEST} s")
            if k % check == 0 and (fault := controller.status.fault):
                raise RuntimeError(f"the controller reports a fault: {fault}")

    def finish(self) -> None:
        """Bring the voltage to rest, and write what has been recorded."""
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C does not stop the ramp
        try:
            self.ramp(REST)
        finally:
            np.savez(
                FILE, rate=RATE, late=self.late, **{name: v[: self.done] for name, v in self.record.items()}
            )
            signal.signal(signal.SIGINT, before)
            self.driver.close()


def main(open_driver: Callable[[], Any]) -> int:
    """Run once; 0 if the reference was followed to its end."""
    reference = pz.signals.triangle(amplitude=3.0, frequency=5.0, periods=10, sample_rate=RATE)  # µm
    controller = pz.AdaptiveFeedforward(RATE, limits=LIMITS)
    pz.warmup(controller)  # compiles or loads everything before the first write
    run = Run(open_driver(), len(reference))
    failure = None
    try:
        run.follow(controller, reference)
    except (Exception, KeyboardInterrupt) as error:
        failure = error
    finally:
        run.finish()
    if failure is not None:
        print(f"stopped: {type(failure).__name__} {failure}", file=sys.stderr)
    busy = 1e6 * run.record["busy"][: run.done]
    print(f"{run.done} of {len(reference)} samples, {run.late} late; record in {FILE}")
    if run.done:
        print(f"time per sample: median {np.median(busy):.0f} µs, longest {busy.max():.0f} µs")
        off = np.abs(run.record["reference"] - run.record["displacement"])[: run.done]
        period = int(reference.period)
        parts = np.split(off, range(period, off.size, period))
        largest = (np.max(part[np.isfinite(part)], initial=-1.0) for part in parts)
        said = (f"{error:.3f}" if error >= 0.0 else "no reading" for error in largest)
        print("largest error of each period [µm]:", *said)
    print(controller.status, *controller.events, sep="\n")
    return 0 if failure is None else 1


if __name__ == "__main__":
    sys.exit(main(Driver))
