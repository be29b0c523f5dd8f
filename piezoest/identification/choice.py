"""Which of several fitted models to use, and why."""

from collections.abc import Sequence

from piezoest.identification.candidate import Candidate

# A simpler model is preferred until a richer one is better by this fraction on the blocks left out. It is
# small, for noise may be most of what both miss there: with 2 %, richer models of half the error lose.
WORTH_IT = 0.005
# Where the log does not tell creep from a wider loop, creep of more than this part of the way is believed
# only if the model misses no more than this part of what others do: else it drifts away at the next rest.
MUCH_CREEP, CLEARLY = 0.15, 0.4


def simplest(errors: Sequence[float]) -> int:
    """Place of the simplest whose error is about the least; from the simplest to the richest."""
    least = min(errors)
    return next(i for i, each in enumerate(errors) if each <= (1.0 + WORTH_IT) * least)


def best_of(candidates: Sequence[Candidate], *, tells_creep: bool = True) -> Candidate:
    """The simplest of those that predict blocks left out about best; from the simplest to the richest."""
    if not tells_creep:
        most = CLEARLY * min(item.cross_validated for item in candidates if not item.creep)
        candidates = [each for each in candidates if each.creep <= MUCH_CREEP or each.cross_validated <= most]
    return candidates[simplest([item.cross_validated for item in candidates])]


def reason_for(candidates: Sequence[Candidate], best: Candidate) -> str:
    """Why that one, with the figures; candidates come from the simplest to the richest."""
    line, error = candidates[0], best.cross_validated
    said = (
        f"{best.label}: {error:.3g} µm rms in the choice (geometric mean of the errors on "
        "blocks left out and on blocks ahead)"
    )
    if best is not line and 0.0 < error < line.cross_validated:
        said += f", {100.0 * (1.0 - error / line.cross_validated):.0f} % less than a straight line"
    rival = min(candidates, key=lambda item: item.cross_validated)
    if rival.cross_validated < error:
        richer = candidates.index(rival) > candidates.index(best)
        said += f"; {rival.label} has {rival.cross_validated:.3g}" + (
            ", which is not enough less for a richer model" if richer else " and is simpler"
        )
    return f"{said}."
