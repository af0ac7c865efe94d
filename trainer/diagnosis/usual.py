"""How greenhouses and weathers differ though nothing is missing, learned from virtual greenhouses.

A greenhouse whose parameters lie 8 % from the calibrated one's, under another weather, leaves traces that look
like small effects: a humidity offset here, a little air exchange there. What such traces look like is learned once
from logs of many mechanistic greenhouses with nothing hidden in them: the few directions in the amplitudes of all
candidates and patterns that make these logs likeliest. A diagnosis lets each direction
explain what it can, at the size it usually has, before it looks for a cause. What is still fitted of each effect then
is learned too from logs of a season, over which a wrong structure can be told from chance: the size beyond which an
effect counts as evidence there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from igrow.trainer.diagnosis import factors, likelihood, search, selection, structure
from igrow.trainer.diagnosis.factors import LogLikelihood
from igrow.trainer.diagnosis.problem import LONG_DAYS, Problem

FILE = "usual_misfit.json"
DIRECTIONS, DIRECTIONS_ELSEWHERE = 8, 16
"""Of models calibrated on the greenhouse itself, and on another one."""
TRIFLE = 1.0
"""Log-likelihood that an effect must gain in a scan to be fitted beside its own noise."""


@dataclass(frozen=True)
class Usual:
    """What is usual though nothing is missing."""

    directions: tuple[Mapping[str, float], ...]
    """Of models calibrated on the greenhouse before; each in amplitudes by key (`structure`), at its usual size."""
    elsewhere: tuple[Mapping[str, float], ...]
    """Of models calibrated on another greenhouse."""
    season: Mapping[str, float]
    """Root mean square amplitude, by effect, that a log of twelve weeks shows beyond its deviation."""

    def sizes(self, days: int) -> Mapping[str, float]:
        """Return the usual amplitudes by effect in a log of so many days.

        In one that is not long the gain that is asked of every cause covers them; allowed for beside it, they hid
        shades and beginnings.
        """
        return self.season if days > LONG_DAYS else {}


@dataclass(frozen=True)
class Traces:
    """What a log with nothing missing says of the amplitudes of all candidates and patterns together."""

    keys: tuple[str, ...]
    likelihood: LogLikelihood
    """Parameters and the known misfit integrated out."""


def traces(problem: Problem) -> Traces:
    """Return the traces of a log, prepared with the known misfit of its calibration, without usual directions."""
    null = structure.null_model(problem)
    size = len(null.base)
    products = problem.grams.of([*null.base, *problem.candidate, *problem.pattern], ()).sum(axis=0)
    information, score = products[1:, 1:], -products[0, 1:]
    information[:size, :size] += null.precision
    score[:size] -= null.precision @ null.shift
    first, other = slice(0, size), slice(size, None)
    taken = np.linalg.solve(information[first, first], np.column_stack([information[first, other], score[first]]))
    return Traces(
        structure.keys(problem),
        LogLikelihood(
            information[other, other] - information[other, first] @ taken[:, :-1],
            score[other] - information[other, first] @ taken[:, -1],
        ),
    )


def directions(logs: Sequence[Traces], count: int) -> list[dict[str, float]]:
    """Return the directions of the traces of logs for which nothing is missing, each at its usual size."""
    keys = sorted({key for one in logs for key in one.keys})
    place = {key: index for index, key in enumerate(keys)}
    whole = [_spread([place[key] for key in one.keys], len(keys), one.likelihood) for one in logs]
    return [
        {key: float(f"{value:.4g}") for key, value in zip(keys, axis, strict=True) if value != 0.0}
        for axis in factors.loadings(whole, count).T
    ]


def evidence(found: Sequence[Mapping[str, float]], logs: Sequence[Traces]) -> float:
    """Return the log marginal likelihood of logs under directions, over that of no traces at all."""
    return sum(
        factors.evidence(np.array([[one.get(key, 0.0) for one in found] for key in log.keys]), [log.likelihood])
        for log in logs
    )


def _spread(places: Sequence[int], count: int, known: LogLikelihood) -> LogLikelihood:
    """Return what a log says of a longer list of amplitudes, nothing of those that it cannot show."""
    information, score = np.zeros((count, count)), np.zeros(count)
    information[np.ix_(places, places)] = known.information
    score[places] = known.score
    return LogLikelihood(information, score)


def amplitudes(problem: Problem) -> dict[str, float]:
    """Return the squared amplitude, less its variance, of every effect that a log shows alone, by effect.

    Args:
        problem: of a log for which nothing is missing, prepared with the usual directions.
    """
    none = likelihood.profile(problem, structure.null_model(problem))
    fit = search.fit(problem.grams, none.model)
    found = {}
    for one in selection.score_candidates(problem, fit, [None], np.random.default_rng(0)):
        if one.gain >= TRIFLE:
            own = likelihood.profile(problem, none.model.with_term(one.term), none.whitening)
            found[one.effect] = max(0.0, own.amplitudes[-1] ** 2 - own.deviations[-1] ** 2)
    return found


def root_mean_squares(logs: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the usual amplitude of every effect, from `amplitudes` of several logs."""
    names = sorted({name for one in logs for name in one})
    return {name: float(f"{np.sqrt(np.mean([one.get(name, 0.0) for one in logs])):.3g}") for name in names}


@cache
def installed() -> Usual:
    """Return what is installed with the trainer."""
    text = files("igrow.trainer.diagnosis").joinpath(FILE).read_text(encoding="utf-8")
    known = json.loads(text)
    return Usual(tuple(known["directions"]), tuple(known["elsewhere"]), known["season"])


def write(path: Path, usual: Usual) -> None:
    """Write what is to be installed."""
    path.write_text(json.dumps(asdict(usual)) + "\n", encoding="utf-8")
