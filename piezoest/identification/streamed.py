"""A log larger than memory to a model: plays from sums over the log, judged in another pass."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from piezoest._checks import FloatArray, fraction
from piezoest.fitting import FORMS, Fitter
from piezoest.fitting.design import CHUNK, Along, Design
from piezoest.fitting.flaws import flawed
from piezoest.fitting.program import Sums
from piezoest.fitting.regression import FOLDS, Fitted, Log, Regression, add
from piezoest.fitting.rows import dot, times
from piezoest.fitting.search import BENDS, checked_delay, plays
from piezoest.identification.advice import delay_sentences, unsettled_sentence
from piezoest.identification.candidate import left_out_error, simplest
from piezoest.identification.data import check_enough, check_excitation, noise_of, prepare
from piezoest.identification.drawing import Drawn
from piezoest.identification.examined import FEWEST_SAMPLES
from piezoest.identification.finding import Finding
from piezoest.identification.lag import tells_lag
from piezoest.identification.parts import Part, Progress, parts, pieces
from piezoest.identification.residual import Misfit
from piezoest.identification.sense import findings
from piezoest.identification.told import Kind, Row, figures_of, parameter_rows
from piezoest.models import LearntOn, Model
from piezoest.records import Record, RecordStream
from piezoest.records.source import counted

# Points kept for figures, and for how far plays move.
MOST_POINTS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class StreamedIdentification:
    """A model identified block by block from a log of any length.

    Parameters
    ----------
    model : Model
        With offset.
    chosen : str
        Its kind, as `piezoest.fit` names it.
    cross_validated : dict of str to float
        Error of each kind on blocks of the fitted part that were left out of the fit [µm rms].
    delay : float
        Samples by which the displacement lags the voltage.
    train, held_out : Misfit
        Error of the simulated displacement on the fitted and on the held-out part.
    line : Model
        The best straight line of the fitted part, for comparison.
    line_train, line_held_out : Misfit
        Its errors.
    samples, trained, skipped : int
        Samples of the log, of the fitted part, and those without usable numbers.
    sample_rate : float
        [Hz].
    source : str
        The file.
    learnt_on : LearntOn
        Ranges of the fitted part.
    left_out : int
        Samples at the start that the fit leaves out, because the stage had not settled.
    thinned : Record
        Every k-th sample, for figures.
    prediction : ndarray
        Simulated displacement [µm] at the samples of `thinned`.
    findings : tuple of Finding
        What is odd about the fitted part's first 50 000 samples.
    notes, advice : tuple of str
        Assumptions made to read the log, and what to know before using the model, in sentences.
    """

    model: Model
    chosen: str
    cross_validated: dict[str, float]
    delay: float
    train: Misfit
    held_out: Misfit
    line: Model
    line_train: Misfit
    line_held_out: Misfit
    samples: int
    trained: int
    skipped: int
    sample_rate: float
    source: str
    learnt_on: LearntOn
    left_out: int
    thinned: Record = field(repr=False)
    prediction: FloatArray = field(repr=False)
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()

    # What an `Identification` says beside.
    reason: ClassVar[str] = ""
    whiteness: ClassVar[None] = None
    validations: ClassVar[tuple[()]] = ()

    def table(self) -> list[Row]:
        """Rows of parameter name, value, standard error (zero: not estimated) and unit."""
        return parameter_rows(self.model, self.delay, {})

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """All kinds that were fitted, from the simplest to the richest, as tables and figures show them."""
        judged = {"line": (self.line_train, self.line_held_out), self.chosen: (self.train, self.held_out)}
        return tuple(
            Kind(FORMS[name].label, name == self.chosen, error, None, *judged.get(name, (None, None)))
            for name, error in self.cross_validated.items()
        )

    def drawn(self) -> Drawn:
        """What figures show of it: samples at equal distances."""
        record, share = self.thinned, len(self.thinned) / self.samples
        return Drawn(
            source=self.source, label=FORMS[self.chosen].label, errors=(self.held_out, self.line_held_out),
            record=record, prediction=self.prediction, residual=record.displacement - self.prediction,
            left_out=-int(-self.left_out * share // 1),
            trained=min(round(share * self.trained), len(record) - 1),
            expected=None, kinds=self.kinds,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe dictionary; the model under ``"model"`` is that of the model's `to_dict`."""
        return {
            "format": "piezoest-streamed-2",
            **figures_of(self),
            "skipped_rows": self.skipped,
            "cross_validated_um": self.cross_validated,
        }


def identify_stream(
    log: RecordStream,
    *,
    train: float = 0.5,
    delay: float | Literal["auto"] = "auto",
    progress: Progress | None = None,
    say: Callable[[str], None] | None = None,
) -> StreamedIdentification:
    """Identify a model from a log that need not fit in memory.

    Plays, with and without bends, are fitted to the first part by sums over the log, as `fit` does; the kind
    is chosen by blocks of which each is predicted from the others. Another pass lets the model run free over
    the whole log. Creep and jumps of the displacement are not fitted. The checks of `identify` are made on
    the first 50 000 samples.

    Parameters
    ----------
    log : RecordStream
        From `stream_record`.
    train : float
        Part of the log to fit, from its start; the rest is held out. 0.1 to 0.9.
    delay : float or "auto"
        Samples by which the displacement lags the voltage, 0 to 10; ``"auto"`` looks for it in the first
        50 000 samples.
    progress : callable, optional
        Called with what is done and what there is, in each of three passes over the log; the first two
        end with the fitted part.
    say : callable, optional
        Called with a few words before each pass.

    Raises
    ------
    ValueError
        As `identify`; the excitation is that of the first 50 000 samples.

    Examples
    --------
    >>> import piezoest as pz
    >>> found = pz.identify_stream(pz.stream_record(pz.records.example_log()))
    >>> found.chosen
    'plays-asymmetric'
    """
    if not isinstance(log, RecordStream):
        raise ValueError(f"log must be a RecordStream, got {type(log).__name__}: use stream_record(path)")
    train = fraction("train", train, 0.1, 0.9)
    say = say or (lambda words: None)
    say("counting samples")
    samples = log.count()
    trained = round(train * samples)
    say("looking at the log")
    survey = _Survey(log, trained, progress)
    head = survey.head
    if int(np.sum(head.usable)) < FEWEST_SAMPLES:
        raise ValueError(
            f"the first {len(head)} samples of {log.path} have {int(np.sum(head.usable))} usable ones, "
            f"at least {FEWEST_SAMPLES} are needed"
        )
    flaws = flawed(head.voltage, head.displacement)
    data = prepare(flaws.without(head.voltage), np.where(flaws.unusable, np.nan, head.displacement))
    odd = findings(head)
    check_excitation(data, noise_of(data), odd)
    wanted = checked_delay(delay)
    told = wanted != "auto" or tells_lag(data.u)
    fitter = Fitter(
        head.voltage, head.displacement, sample_rate=log.sample_rate, delay=wanted, flaws=flaws,
        tells_lag=told,
    )  # fmt: skip
    say("fitting plays")
    fits = _fits(log, survey, fitter, trained, progress)
    missed = {name: left_out_error(fit) for name, fit in fits.items()}
    chosen = list(fits)[simplest(list(missed.values()))]
    judge = _Judge(fits[chosen], fits["line"], samples, slice(fitter.left_out, trained))
    say("predicting the whole log")
    for part in parts(log, fitter.delay, progress):
        judge.add(part)
    found = StreamedIdentification(
        model=fits[chosen].design.model(fits[chosen].w),
        chosen=chosen,
        cross_validated=missed,
        delay=fitter.delay,
        train=judge.misfit(held_out=False),
        held_out=judge.misfit(held_out=True),
        line=fits["line"].design.model(fits["line"].w),
        line_train=judge.misfit(held_out=False, of_line=True),
        line_held_out=judge.misfit(held_out=True, of_line=True),
        samples=samples,
        trained=trained,
        skipped=judge.skipped,
        sample_rate=log.sample_rate,
        source=str(log.path),
        learnt_on=survey.learnt_on,
        left_out=fitter.left_out,
        thinned=judge.thinned(log),
        prediction=judge.prediction,
        findings=odd,
        notes=log.notes,
    )
    lag = delay_sentences(fitter.delay, log.sample_rate, told, fitter.delay_estimated)
    return dataclasses.replace(found, advice=(*_advice(found, len(head)), *lag))


def _advice(found: StreamedIdentification, looked_at: int) -> list[str]:
    said = [f"In the first {looked_at} samples: {each.sentence}" for each in found.findings]
    if found.skipped:
        said.append(
            f"{counted(found.skipped, 'sample')} of {found.samples} did not count: without usable numbers, "
            "repeated, or spikes or dropouts."
        )
    if found.left_out:
        said.append(unsettled_sentence(found.left_out / found.sample_rate))
    if found.held_out.rms > found.line_held_out.rms and found.chosen != "line":
        said.append("A straight line does better: check signs, columns and the delay.")
    return said


class _Survey:
    """The first pass: start, range and some points of the part that is fitted."""

    def __init__(self, log: RecordStream, trained: int, progress: Progress | None) -> None:
        every = max(1, -(-trained // MOST_POINTS))
        voltage, displacement, points = np.empty(0), np.empty(0), []
        seen, known, self.usable = 0, None, 0
        low, high = np.inf, -np.inf
        for whole_u, whole_x in pieces(log, progress):
            u, x = whole_u[: trained - seen], whole_x[: trained - seen]
            if u.size == 0:
                break
            if seen == 0:
                voltage, displacement = u, x
            flaws = flawed(u, x)
            u = flaws.without(u)
            self.usable += int(np.sum(np.isfinite(u) & np.isfinite(x) & ~flaws.unusable))
            if np.any(np.isfinite(u)) and np.any(np.isfinite(x)):
                here = LearntOn.of(u, x, log.sample_rate)
                known = here if known is None else known.joined(here)
                low, high = min(low, float(np.nanmin(u))), max(high, float(np.nanmax(u)))
            points.append(u[-seen % every :: every])
            seen += u.size
        if known is None:
            raise ValueError(f"{log.path} has no usable sample in the part that is fitted")
        self.learnt_on = known
        #: Samples at the start that are looked at as a whole: for the delay, the start and the noise.
        self.head = Record.from_arrays(voltage, displacement, log.sample_rate, str(log.path))
        thinned = np.concatenate(points)
        self.voltage = np.concatenate([thinned[np.isfinite(thinned)], [low, high]])


def _fits(
    log: RecordStream, survey: _Survey, fitter: Fitter, trained: int, progress: Progress | None
) -> dict[str, Fitted]:
    """The second pass: a line, plays, and plays with bends, from sums over blocks of the fitted part."""
    points = survey.voltage
    none = np.empty(0)
    thinned = Log(points, points, np.ones(points.size, bool), log.sample_rate, none)
    basis = plays(thinned, fitter.start, bends=BENDS)
    design = Design(basis, log.sample_rate, trained)
    along, sums = Along(design), [Sums.none(design.columns) for _ in range(FOLDS)]
    counted_before = 0
    for part in parts(log, fitter.delay, progress):
        # A start that has not settled is left out.
        part.counts[: max(fitter.left_out - part.first, 0)] = False
        # As many samples that count in each block; those behind the fitted part are in none.
        so_far = counted_before + np.cumsum(part.counts)
        counted_before = int(so_far[-1])
        fold = np.minimum(so_far * FOLDS // survey.usable, FOLDS - 1)
        fold[max(trained - part.first, 0) :] = FOLDS
        for k in range(0, part.u.size, CHUNK):
            rows = along.rows(part.u[k : k + CHUNK])
            piece = slice(k, k + CHUNK)
            add(sums, rows, part.x[piece], part.counts[piece], fold[piece])
        if part.first + part.u.size >= trained:
            break
    bent = Regression(design, sums)
    merged, to_plays = basis.merged()
    one = dataclasses.replace(merged, thresholds=merged.thresholds[:1], moving=merged.moving[:, :1])
    return {
        "line": bent.combined(one, to_plays[:, :1]).best(),
        "plays": bent.combined(merged, to_plays).best(),
        "plays-asymmetric": bent.best(),
    }


class _Judge:
    """Errors of a simulated model and of a line, block by block in order, and points for figures."""

    def __init__(self, fitted: Fitted, line: Fitted, samples: int, trained: slice) -> None:
        self._fits = (fitted, line)
        self._along = tuple(Along(each.design) for each in self._fits)
        # Of model and line, in the fitted part and the held-out one: sum of squares, largest, count.
        self._sums = np.zeros((2, 2, 3))
        self._trained = trained
        self._every = max(1, -(-samples // MOST_POINTS))
        self._points: list[FloatArray] = []
        self.skipped = 0

    def add(self, part: Part) -> None:
        """Judge a part of the log."""
        outputs = [self._output(i, part.u) for i in range(2)]
        index = part.first + np.arange(part.u.size)
        fitted = (index >= self._trained.start) & (index < self._trained.stop)
        later = index >= self._trained.stop
        for held_out, here in enumerate((part.counts & fitted, part.counts & later)):
            for of_line, output in enumerate(outputs):
                error = np.abs(part.x[here] - output[here])
                squares, largest, count = self._sums[held_out, of_line]
                self._sums[held_out, of_line] = (
                    squares + dot(error, error),
                    np.max(error, initial=largest),
                    count + error.size,
                )
        kept = slice(-part.first % self._every, None, self._every)
        shown = np.where(part.counts, part.x, np.nan)[kept]
        self._points.append(np.array([index[kept], part.u[kept], shown, outputs[0][kept]]))
        self.skipped += int(np.sum(~part.counts))

    def _output(self, which: int, u: FloatArray) -> FloatArray:
        along, w = self._along[which], self._fits[which].w
        return np.concatenate([times(along.rows(u[k : k + CHUNK]), w) for k in range(0, u.size, CHUNK)])

    def misfit(self, *, held_out: bool, of_line: bool = False) -> Misfit:
        """Return the error so far, of the model or of the line, in the fitted part or behind it."""
        squares, largest, count = self._sums[int(held_out), int(of_line)]
        check_enough("held-out part" if held_out else "fitted part", "the log", int(count))
        return Misfit(float(np.sqrt(squares / count)), float(largest))

    def thinned(self, log: RecordStream) -> Record:
        """Every k-th sample."""
        index, voltage, displacement, _ = np.concatenate(self._points, axis=1)
        time = index / log.sample_rate
        return Record(time, voltage, displacement, log.sample_rate / self._every, str(log.path))

    @property
    def prediction(self) -> FloatArray:
        """Of the model at the samples of `thinned`."""
        return np.asarray(np.concatenate(self._points, axis=1)[3])
