"""What logs show though nothing is missing: a model's own discrepancy, and the nuisance subspace of greenhouses.

A greenhouse whose parameters lie some way from the calibrated one's, under another weather, shows what looks like small
effects: a humidity offset here, a little air exchange there. What that looks like is learned once from logs of many
mechanistic greenhouses with nothing hidden in them: the few directions in the amplitudes of all effects and patterns
that make these logs likeliest. A diagnosis lets each direction explain what it can, at the size that it has there,
before it looks for a cause.

What a log says of a list of amplitudes a is a normal likelihood, score @ a - a @ information @ a / 2. With
a = loadings @ z, and z standard normal and new in every log, z can be integrated out; the loadings are those that make
all logs together likeliest. This is factor analysis (Bishop 2006, Pattern Recognition and Machine Learning, sections
3.5 and 12.2) in which every log has its own, known noise. Scatter of regressions (principal components) would instead
hold what no log can tell apart, and did worse by far in greenhouses that nothing was learned from.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import compare, linear, search
from igrow.trainer.diagnosis.design import Design, prepare
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX, activate, knowledge_of
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.model import FittedModel

FILE = "learned/nuisance.json"
_SEEN = 1e-6
"""Share of the largest eigenvalue of the pooled information below which a direction is not looked at."""
_ITERATIONS = 150
"""Of the ascent at most."""

Direction = Mapping[str, float]
"""Amplitude by key of an effect or a pattern."""


@dataclass(frozen=True)
class NuisanceSubspace:
    """What greenhouses show though nothing is missing."""

    home: tuple[Direction, ...]
    """Of models calibrated on the greenhouse before, each at its usual size."""
    transferred: tuple[Direction, ...]
    """Of models calibrated on another greenhouse."""
    season: Mapping[str, float]
    """Root mean square amplitude, by effect, that a log of twelve weeks shows beyond its deviation."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """The command that learned it, its date and seeds."""

    def directions(self, *, transferred: bool) -> tuple[Direction, ...]:
        """Return the directions for a model that was calibrated here or transferred."""
        return self.transferred if transferred else self.home

    def usual_size(self, days: int, rules: DecisionRules) -> Mapping[str, float]:
        """Return the usual amplitudes by effect in a log of so many days.

        In one that is not long the gain that is asked of every cause covers them; allowed for beside it, they hid
        shades and beginnings.
        """
        return self.season if days > rules.long_days else {}


def read_nuisance(path: Path | None = None) -> NuisanceSubspace:
    """Return a stored subspace (None: the one that came with the trainer)."""
    file = files("igrow.trainer.diagnosis").joinpath(FILE) if path is None else path
    known = json.loads(file.read_text(encoding="utf-8"))
    return NuisanceSubspace(tuple(known["home"]), tuple(known["transferred"]), known["season"], known["provenance"])


def write_nuisance(path: Path, subspace: NuisanceSubspace) -> None:
    """Write a subspace with its provenance."""
    path.write_text(json.dumps(asdict(subspace)) + "\n", encoding="utf-8")


def discrepancy_of(record: Record, model: FittedModel, rules: DecisionRules) -> dict[str, float]:
    """Return what a calibrated model misses on the record of its own calibration log, for `FittedModel.discrepancy`.

    Raises:
        DivergenceError: the model runs out of all bounds on it.
    """
    longitude, knowledge = model.site.longitude, knowledge_of(model, model.site, rules)
    effects = activate(record, knowledge.terms)
    split = split_days(record, longitude)
    return learn_discrepancy(prepare(record, split, knowledge.prior, effects, longitude, rules, discrepancy={}))


def learn_discrepancy(design: Design) -> dict[str, float]:
    """Return what a calibrated model misses on its own log (all days): amplitude by key, and shifts of parameters.

    A ridge regression of the innovations on all effects and patterns together. The parameters stay where the
    recalibration put them: moved along, they would leave their bounds.
    """
    rules, prior = design.rules, design.prior
    scale = np.array(
        [rules.discrepancy_effect_ridge * EFFECTS[one.effect].amplitude.typical for one in design.candidates]
        + [rules.discrepancy_pattern_ridge] * len(design.patterns)
    )
    columns = [*design.columns("effect"), *design.columns("pattern")]
    solution = linear.solve(design.grams.of(columns, ()).sum(axis=0), np.diag(scale**-2.0))
    shift = {PARAMETER_PREFIX + name: design.line.parameters[name] - value for name, value in prior.values.items()}
    return dict(zip(_keys(design), solution.coefficients.tolist(), strict=True)) | shift


@dataclass(frozen=True)
class LogLikelihood:
    """What a log says of amplitudes, up to a constant."""

    keys: tuple[str, ...]
    """Of the amplitudes, (k,)."""
    information: Floats
    """(k, k), zero for an amplitude that the log cannot show."""
    score: Floats
    """(k,), its gradient where all amplitudes are zero."""


def marginal(design: Design) -> LogLikelihood:
    """Return what a log with nothing missing says of all effects and patterns, the null integrated out.

    Args:
        design: of the log, with the discrepancy of its model and without a nuisance subspace.
    """
    null = design.null_model()
    size = len(null.base)
    columns = [*null.base, *design.columns("effect"), *design.columns("pattern")]
    products = design.grams.of(columns, ()).sum(axis=0)
    information, score = products[1:, 1:], -products[0, 1:]
    information[:size, :size] += null.precision
    score[:size] += null.precision @ null.mean
    first, other = slice(0, size), slice(size, None)
    taken = np.linalg.solve(information[first, first], np.column_stack([information[first, other], score[first]]))
    return LogLikelihood(
        _keys(design),
        information[other, other] - information[other, first] @ taken[:, :-1],
        score[other] - information[other, first] @ taken[:, -1],
    )


def learn_directions(logs: Sequence[LogLikelihood], count: int) -> list[dict[str, float]]:
    """Return the directions of logs in which nothing is missing, each at its usual size, the largest first."""
    keys = sorted({key for one in logs for key in one.keys})
    return [
        {key: float(f"{value:.4g}") for key, value in zip(keys, axis, strict=True) if value != 0.0}
        for axis in loadings([_extended(one, keys) for one in logs], count).T
    ]


def evidence(found: Sequence[Direction], logs: Sequence[LogLikelihood]) -> float:
    """Return the log marginal likelihood of logs under directions over that of none (Bishop eq. 3.86)."""
    total = 0.0
    for log in logs:
        table = np.array([[one.get(key, 0.0) for one in found] for key in log.keys])
        total += _evidence(table, log.information, log.score)[0]
    return total


def usual_amplitudes(design: Design) -> dict[str, float]:
    """Return the squared amplitude, less its variance, of every effect that a log shows alone, by effect.

    Args:
        design: of a log in which nothing is missing, with the nuisance subspace.
    """
    null = compare.profile(design, design.null_model())
    fit = linear.fit(design.grams, null.model)
    found = {}
    for one in search.score_candidates(design, fit, [None], np.random.default_rng(0)):
        if one.gain >= design.rules.least_fitted_gain:
            own = compare.profile(design, null.model.with_term(one.term), null.whitening)
            found[one.effect] = max(0.0, own.amplitudes[-1] ** 2 - own.deviations[-1] ** 2)
    return found


def root_mean_squares(logs: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the usual amplitude of every effect, from `usual_amplitudes` of several logs."""
    names = sorted({name for one in logs for name in one})
    return {name: float(f"{np.sqrt(np.mean([one.get(name, 0.0) for one in logs])):.3g}") for name in names}


def loadings(logs: Sequence[LogLikelihood], count: int) -> Floats:
    """Return directions at their usual size, (k, count), the largest first; all logs have the same keys.

    A weak prior keeps each below about what a log can see: one unit where the pooled information is one.
    """
    basis = _visible(np.mean([one.information for one in logs], axis=0))
    reduced = [(basis.T @ one.information @ basis, basis.T @ one.score) for one in logs]
    shape = (basis.shape[1], min(count, basis.shape[1]))

    def descent(flat: Floats) -> tuple[float, Floats]:
        table = flat.reshape(shape)
        value, slope = -0.5 * float(np.sum(table**2)), -table
        for information, score in reduced:
            own, own_slope = _evidence(table, information, score)
            value, slope = value + own, slope + own_slope
        return -value, -slope.ravel()

    _, _, axes = np.linalg.svd(np.array([score for _, score in reduced]), full_matrices=True)
    start = axes[: shape[1]].T.ravel()
    found = minimize(descent, start, jac=True, method="L-BFGS-B", options={"maxiter": _ITERATIONS, "maxcor": 20})
    # Turned so that each stands at a right angle to the others where the pooled information is the measure.
    axes, sizes, _ = np.linalg.svd(found.x.reshape(shape), full_matrices=False)
    directions: Floats = basis @ (axes * sizes)
    return directions


def _keys(design: Design) -> tuple[str, ...]:
    return (*design.block("effect").labels, *design.block("pattern").labels)


def _extended(log: LogLikelihood, keys: Sequence[str]) -> LogLikelihood:
    """Return what a log says of a longer list of amplitudes, nothing of those that it cannot show."""
    place = {key: index for index, key in enumerate(keys)}
    places = [place[key] for key in log.keys]
    information, score = np.zeros((len(keys), len(keys))), np.zeros(len(keys))
    information[np.ix_(places, places)] = log.information
    score[places] = log.score
    return LogLikelihood(tuple(keys), information, score)


def _evidence(loadings: Floats, information: Floats, score: Floats) -> tuple[float, Floats]:
    """Return the log marginal likelihood of one log and its gradient, (k, count)."""
    informed = information @ loadings
    inverse = np.linalg.inv(np.eye(loadings.shape[1]) + loadings.T @ informed)
    pull = loadings.T @ score
    mean = inverse @ pull
    value = 0.5 * float(pull @ mean) + 0.5 * float(np.linalg.slogdet(inverse)[1])
    return value, np.outer(score, mean) - informed @ (np.outer(mean, mean) + inverse)


def _visible(information: Floats) -> Floats:
    """Return a basis in which the pooled information is one, without what it hardly sees, (k, seen)."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scale = np.where(np.diag(information) > 0.0, scale, 0.0)
    values, axes = np.linalg.eigh(information * scale[:, None] * scale)
    kept = values > _SEEN * values[-1]
    basis: Floats = scale[:, None] * axes[:, kept] / np.sqrt(values[kept])
    return basis
