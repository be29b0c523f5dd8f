"""Whether a log makes sense, before a model is fitted to it: units, columns, loop and sensor."""

from collections.abc import Callable, Iterator

import numpy as np

from piezoest._checks import FloatArray
from piezoest.fitting.clipping import Top, flat_tops
from piezoest.fitting.held import repeats
from piezoest.fitting.runs import BoolArray
from piezoest.fitting.surprise import noise_in
from piezoest.identification.examined import FEWEST_SAMPLES, FEWEST_TURNS, Examined
from piezoest.identification.feedback_in_log import answer
from piezoest.identification.finding import Finding, doubt, note
from piezoest.identification.steps_of_converter import levels
from piezoest.identification.straight_line import SMALLEST_MOTION, straight
from piezoest.identification.voltage_checks import flat_ends, joined
from piezoest.records import Record
from piezoest.records.source import counted

MOST_MISSING = 0.1
# What stages do: gain [µm/V] and stroke [µm]. Inputs of amplifiers, up to some 12 V, have greater gains.
GAINS, STROKES = (1e-3, 30.0), (SMALLEST_MOTION, 2500.0)
AMPLIFIER_INPUT, LARGEST_INPUT_GAIN = 13.0, 300.0
LARGEST_VOLTAGE = 2000.0
# Sample rates [Hz], and how long a swing there and back may take [s].
RATES, WAVES = (1.0, 1e7), (2e-5, 3600.0)
# Days as Excel and as MATLAB count them, about now; taken for seconds, samples come faster than this [Hz].
CALENDARS, TOO_FAST = ((3e4, 8e4), (7e5, 8e5)), 8e4
# Part of the stroke by which a loop is open the wrong way, in this part of its branches.
CLOCKWISE, MOST_BRANCHES = 0.015, 0.8
# ... and by which it is open wider than that of most stages: some have a quarter, with backlash more.
WIDE = 0.35
# The voltage is clipped where the displacement goes on by this part of its range: more than a stage rings.
GOES_ON = 0.08
FEWEST_LEVELS, FEW_LEVELS = 30.0, 150.0
MANY_SPIKES = 5e-3
# So many jumps whose sizes differ by no more than this part are those of a reading that wraps.
MANY_JUMPS, ALIKE = 8, 0.1
# Drift, relative to what the voltage moves, that is worth a word; that leaves little of a loop.
DRIFT, LARGE_DRIFT = 0.05, 0.5
# The displacement of a clipped voltage goes on by so many times its noise.
ABOVE_NOISE = 8.0


def findings(record: Record) -> tuple[Finding, ...]:
    """What is doubtful about a log.

    Parameters
    ----------
    record : Record
        With NaN where samples are missing.

    Returns
    -------
    tuple of Finding
        What most upsets a fit comes first; empty for a log that looks as that of a piezo stage does.

    Raises
    ------
    ValueError
        If the record is none.

    Examples
    --------
    >>> import numpy as np
    >>> from piezoest.identification.sense import findings
    >>> from piezoest.records import Record
    >>> t = np.arange(4000) / 1000.0
    >>> record = Record.from_arrays(50.0 * np.sin(6.0 * t), -5.0 * np.sin(6.0 * t - 0.1), 1000.0)
    >>> [finding.name for finding in findings(record)]
    ['falls']
    """
    if not isinstance(record, Record):
        raise ValueError(f"record must be a Record, got {type(record).__name__}: use read_record(path)")
    if basic := tuple(_basic(record)):
        return basic
    log = Examined(record)
    found = tuple(finding for check in CHECKS for finding in check(log))
    return tuple(sorted(found, key=lambda finding: finding.severity != "doubt"))


def _basic(record: Record) -> Iterator[Finding]:
    """What leaves nothing to be looked at."""
    usable = record.usable
    count = int(np.sum(usable))
    if count < FEWEST_SAMPLES:
        yield doubt(
            "short",
            f"The log has {counted(count, 'usable sample')}: record at least {FEWEST_SAMPLES}, better 1000.",
        )
        return
    for name, unit, values in (("voltage", "V", record.voltage), ("displacement", "µm", record.displacement)):
        if np.ptp(values[usable]) == 0.0:
            yield doubt(
                f"constant {name}",
                f"The {name} stays at {values[usable][0]:.6g} {unit} in all {count} samples: check that the "
                "right column was taken and the instrument was on.",
            )


def _missing(log: Examined) -> Iterator[Finding]:
    share = 1.0 - float(np.mean(log.record.usable))
    if share > MOST_MISSING:
        yield doubt(
            "missing", f"{100 * share:.0f} % of the samples are missing: cut the log to where it is whole."
        )


def _excitation(log: Examined) -> Iterator[Finding]:
    if log.turns.size < FEWEST_TURNS:
        yield doubt(
            "no swing",
            f"The voltage turns {counted(log.turns.size)} over {log.swing:.4g} V: hysteresis shows only at "
            "turns, record several swings up and down.",
        )


def _timing(log: Examined) -> Iterator[Finding]:
    low, high = RATES
    doubtful = "check the unit of time (ms, µs or days taken for s, or the other way round)"
    # Exactly 1 Hz is what times in samples, or in ms at 1 kHz, come to.
    if not low * (1.0 + 1e-6) < log.rate <= high:
        yield doubt(
            "sample rate", f"The sample rate would be {log.rate:.4g} Hz: {doubtful}, or the sample rate."
        )
    elif log.rate > TOO_FAST and any(low < log.record.time[0] < high for low, high in CALENDARS):
        yield doubt(
            "days",
            f"Time begins at {log.record.time[0]:.6g}, as a date in days does, and the sample rate would be "
            f"{log.rate:.4g} Hz: give the unit, as in units time='days'.",
        )
    elif log.wave < WAVES[0] or WAVES[1] < log.wave < np.inf:
        yield doubt(
            "swing time",
            f"The voltage would take {log.wave:.3g} s there and back at {log.rate:.4g} Hz: {doubtful}.",
        )


def _related(log: Examined) -> Iterator[Finding]:
    if not log.related:
        yield doubt(
            "unrelated",
            "The displacement hardly follows the voltage: a straight line leaves "
            f"{100 * log.unexplained:.0f} % of its motion unexplained. Check that both columns are of one "
            "run and one axis, that no rows are missing in one of them, and that no resonance is excited.",
        )


def _size(log: Examined) -> Iterator[Finding]:
    top, gain = float(np.max(np.abs(log.u))), abs(log.gain)
    if top > LARGEST_VOLTAGE:
        yield doubt(
            "voltage",
            f"The voltage reaches {top:.4g} V, which no piezo stage bears: mV taken for V? "
            "Give the unit, as in units voltage='mV'; multiply an array by 0.001.",
        )
        return
    said = f"The displacement moves by {log.moved:.3g} µm over {log.swing:.3g} V, {gain:.3g} µm/V"
    highest = LARGEST_INPUT_GAIN if top <= AMPLIFIER_INPUT else GAINS[1]
    if log.moved > STROKES[1] or gain > highest:
        yield doubt(
            "too large",
            f"{said}, more than piezo stages do (about {GAINS[0]:g} to {GAINS[1]:g} µm/V, up to "
            f"{STROKES[1]:g} µm): nm taken for µm, or V for mV? Give the unit, as in "
            "units displacement='nm'; multiply an array by 0.001.",
        )
    elif gain < GAINS[0] and log.related:
        yield doubt(
            "too small",
            f"{said}, less than piezo stages do (about {GAINS[0]:g} to {GAINS[1]:g} µm/V): mm or m taken "
            "for µm, or volts of the sensor? Give the unit, as in units displacement='mm'; "
            "multiply an array by 1000.",
        )
    elif log.moved < STROKES[0] and log.related:
        yield note(
            "small stroke",
            f"{said}: so small a stroke shows little hysteresis, check the unit or raise the voltage.",
        )


def _direction(log: Examined) -> Iterator[Finding]:
    if not log.related:
        return
    if log.gain < 0.0:
        yield doubt(
            "falls",
            f"The displacement falls as the voltage rises ({log.gain:.4g} µm/V): change the sign of one of "
            "the two columns, unless the stage swings above its resonance: then move it more slowly.",
        )
    elif log.loop.opening < -CLOCKWISE and log.loop.clockwise > MOST_BRANCHES:
        yield doubt(
            "clockwise",
            f"The loop of displacement over voltage runs clockwise, {-100 * log.loop.opening:.2g} % of the "
            "stroke wide, but that of a stage runs counter-clockwise: voltage and displacement are swapped, "
            "the displacement's time stamps are early, the sensor passes no slow motion, or the stage swings "
            "above its resonance.",
        )
    elif log.loop.opening > WIDE and not log.stepped:
        yield note(
            "wide loop",
            f"The loop of displacement over voltage is {100 * log.loop.opening:.0f} % of the stroke wide, "
            "that of most stages 10 to 25 %: there is much backlash, the displacement is late (a delay, a "
            "slow sensor or filter), or a servo was on. Record more slowly with the servo off, or shift one "
            "of the columns.",
        )


def _closed_loop(log: Examined) -> Iterator[Finding]:
    # With a wrong sign, feedback cannot be told from what it is not.
    if not log.related or log.gain < 0.0:
        return
    yield from straight(log)
    feedback = answer(log.u, log.x, log.gain)
    if feedback.closed:
        how = (
            f"{100 * feedback.explained:.0f} % of the voltage's noise follows that of the displacement, "
            f"{counted(feedback.lag, 'sample')} later"
            if feedback.lag
            else f"noise of voltage and displacement go opposite ways (correlation {feedback.together:.2f})"
        )
        yield doubt(
            "closed loop",
            f"The log comes from a closed loop: {how}. A fit takes that noise for the stage's answer; "
            "switch the feedback off, or excite well above the noise.",
        )


def _limits(log: Examined) -> Iterator[Finding]:
    noise = noise_in(np.diff(log.u, 3))
    for top in log.flaws.tops:
        if top.beyond < ABOVE_NOISE * noise:
            continue
        yield _clipped(
            "displacement", "µm", top, f"the voltage goes on by up to {top.beyond:.3g} V",
            "these stretches say nothing about the stage, identify leaves them out; reduce the voltage.",
        )  # fmt: skip
    sign = 1.0 if log.gain >= 0.0 else -1.0
    tops = flat_tops(log.u, sign * log.x, GOES_ON) if log.related else ()
    for top in tops[:1]:
        # A rest in which the stage swings once is no limit of the voltage yet.
        if top.times > 1 and top.beyond > ABOVE_NOISE * log.noise:
            yield _clipped(
                "voltage", "V", top, f"the displacement goes on by up to {top.beyond:.3g} µm",
                "leave these stretches out, or reduce the voltage.",
            )  # fmt: skip


def _clipped(name: str, unit: str, top: Top, beyond: str, what_to_do: str) -> Finding:
    return doubt(
        f"clipped {name}",
        f"The {name} stands at {top.limit:.5g} {unit} {counted(top.times)} while {beyond} and comes back: it "
        f"is clipped there; {what_to_do}",
    )


def _resolution(log: Examined) -> Iterator[Finding]:
    read = log.counts & ~log.flaws.unusable
    step, count = levels(log.record.displacement[read])
    if count < FEW_LEVELS:
        say = doubt if count < FEWEST_LEVELS else note
        yield say(
            "coarse",
            f"The displacement comes in steps of {step:.3g} µm, only {count:.0f} over its range, and a loop "
            "is about a tenth of the range: use a finer range of the converter, or save more digits.",
        )
    elif (times := repeats(log.u[log.counts], log.record.displacement[log.counts])) > 1:
        yield note(
            "repeated",
            f"Each reading stands {times} times in a row: the sensor measures at {log.rate / times:.4g} Hz, "
            f"identify keeps one sample of {times}.",
        )


def _flaws(log: Examined) -> Iterator[Finding]:
    flaws = log.flaws

    def first(marks: BoolArray) -> str:
        return f"{float(log.record.time[np.argmax(marks)]):.6g} s"

    if count := int(np.sum(flaws.spikes)):
        say = doubt if count > MANY_SPIKES * log.x.size else note
        yield say(
            "spikes",
            f"{counted(count, 'sample')} of the displacement {'stands' if count == 1 else 'stand'} off "
            f"alone, the first at {first(flaws.spikes)}: identify leaves them out.",
        )
    if flaws.jumps.size:
        largest = int(np.argmax(np.abs(flaws.jump_sizes)))
        yield doubt(
            "jumps",
            f"The displacement jumps {counted(flaws.jumps.size)} without the voltage, by "
            f"{flaws.jump_sizes[largest]:+.3g} µm at {float(log.record.time[flaws.jumps[largest]]):.6g} s: "
            f"{_wraps(flaws.jump_sizes)}identify gives each stretch an offset of its own.",
        )
    if flaws.dropouts.any():
        yield doubt(
            "dropouts",
            "The displacement stands still while the voltage moves, for "
            f"{int(np.sum(flaws.dropouts))} samples from {first(flaws.dropouts)} on: the sensor was lost, "
            "identify leaves them out.",
        )
    if count := int(np.sum(flaws.voltage)):
        say = doubt if count > MANY_SPIKES * log.x.size else note
        yield say(
            "wrong voltage",
            f"{counted(count, 'sample')} of the voltage, the first at {first(flaws.voltage)}, "
            f"{'is' if count == 1 else 'are'} not what drove the stage (a spike, a zero, or a column that "
            "stands still), for the displacement does not follow: identify leaves them out.",
        )
    if len(flaws.rests):
        rested = int(np.sum(np.diff(flaws.rests, axis=1))) / log.rate
        yield note(
            "rests",
            f"The voltage rests {counted(len(flaws.rests))}, {rested:.3g} s in all: nothing is learnt of the "
            "loop there, and creep shows.",
        )


def _wraps(sizes: FloatArray) -> str:
    """What to add where all of many jumps are of one size."""
    size = np.abs(sizes)
    if size.size < MANY_JUMPS or np.ptp(size) > ALIKE * np.mean(size):
        return ""
    return "as all have one size, an interferometer or a counter may wrap: unwrap the column. "


def _drift(log: Examined) -> Iterator[Finding]:
    if log.turns.size <= 3 or not log.related:
        return
    # Slow ways of the voltage move a stage with a wide loop further than swings do: that is no drift.
    followed = log.stroke * abs(log.trend) / log.swing
    if abs(log.drift) > max(DRIFT * log.moved, followed):
        share = abs(log.drift) / log.moved
        say = doubt if share > LARGE_DRIFT else note
        yield say(
            "drift",
            f"The displacement drifts by {log.drift:+.3g} µm between the first turn and the last one, "
            f"{100.0 * share:.0f} % of what the voltage moves (creep or temperature): let the stage settle. "
            "identify fits a drift or creep beside the loop, where that predicts better.",
        )


CHECKS: tuple[Callable[[Examined], Iterator[Finding]], ...] = (
    _timing, _excitation, _size, _direction, _closed_loop, _limits, flat_ends, joined, _missing, _resolution,
    _flaws, _drift, _related,
)  # fmt: skip
