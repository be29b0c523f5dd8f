"""What columns of a run are called in the terminal and on the page about safety."""

from typing import Any

from piezoest._tables import shown

# What is drawn.
DRAWN = {
    "family": "family of the hysteresis", "reference": "reference", "fault": "fault",
    "mode": "time of the fault", "mechanics": "mechanics", "limits": "limits of the voltage [V]",
}  # fmt: skip
SPANS = {
    "amplitude": "amplitude of the reference [µm]", "frequency": "frequency of the reference [Hz]",
    "gain": "gain [µm/V]", "width": "width of the loop, relative to the stroke",
    "sample_rate": "sample rate [Hz]", "delay": "delay of the readings [samples]",
    "block": "samples in a block", "sensor_noise": "noise of the readings [µm]",
    "creep": "creep per decade of time, relative to the displacement",
}  # fmt: skip
MODES = {"from-start": "from the start", "transient": "for a time", "permanent": "until the end"}
# What a run must not be.
CRITERIA = {
    "failed": "error raised", "not finite": "voltage not finite", "outside the limits": "outside the limits",
    "rests at a limit": "rests at a limit", "ratio": "ratio above 1", "cycle_ratio": "any cycle above 1",
    "last_ratio": "last cycle above 1",
}  # fmt: skip
CHANGES = {
    "cold-start": "cold start", "switch": "60 % of the amplitude", "drop": "20 %", "switch-back": "100 %",
    "gain-step": "gain changes by 30 %",
}  # fmt: skip
RATIOS = {
    "ratio": "whole run", "cycle_ratio": "any cycle", "last_ratio": "last cycle",
    "after_ratio": "after a fault",
}  # fmt: skip
# Of one run: what was drawn, how it was judged, and what the controller said.
ONE_RUN = {
    "seed": "seed", **DRAWN, **SPANS,
    "low": "lower limit of the voltage [V]", "high": "upper limit of the voltage [V]",
    "fault_start": "start of the fault [s]", "fault_stop": "end of the fault [s]",
    "failure": "error raised", "finite": "voltage finite", "within_limits": "voltage within the limits",
    "rail": "longest rest at a limit [quarter swings]", "judged_from": "judged from [s]",
    "worst": "largest error [µm]", "line_worst": "that of the straight line [µm]",
    **{name: f"ratio, {said}" for name, said in RATIOS.items()},
    "settled": "settled error [µm]", "recovered": "as before in cycle after the fault",
    "named": "events", "named_right": "right name of the fault given", "named_periods": "after [periods]",
    "driver": "drove last", "microseconds": "time of a sample [µs]",
}  # fmt: skip


def fault(row: dict[str, Any]) -> str:
    """The kind of a row's fault, and its time."""
    return ", ".join([row["fault"], *([MODES[row["mode"]]] if row["mode"] in MODES else [])])


def one_run(row: dict[str, Any]) -> dict[str, str]:
    """Numbers of a run that are known, by the words for them."""
    left_out = ("mode", "fault_start", "fault_stop") if row["fault"] == "none" else ()
    known = [name for name in ONE_RUN if row.get(name) not in (None, "") and name not in left_out]
    row = {**row, "mode": MODES.get(row.get("mode", ""), row.get("mode"))}
    return {ONE_RUN[name]: shown(row[name]) for name in known}
