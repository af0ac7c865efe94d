"""What a model lacks, asked of its calibration log: terms of the physics that are not in it.

A diagnosis asks what has changed since the calibration; what was missing then is asked here. Each term that an effect
of the catalogue can stand in for is scored against all parameters under the prior of the site's description. Where
parameters were driven far to make up for a term, what it gains in a model that is linear about them says little of what
it is worth: so those that gain most are fitted beside the parameters, and that which brings the fitted weeks closest
to what was measured must make weeks better that no fit saw. Every structure misses something of every greenhouse: how
much better, greenhouses tell in which nothing was taken out. A large term hides others, so the question is asked again
beside each that was found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import block_diag

from igrow.core.arrays import Mask
from igrow.core.bundle import EffectRecord, Estimate, HeldOutError
from igrow.core.effects import EFFECTS, Effect
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.data.splits import held_out_weeks
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Candidate
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import LinearModel, Term
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import history, scan
from igrow.trainer.diagnosis.search.estimate import normal_quantile
from igrow.trainer.fit.climate import fit_climate
from igrow.trainer.fit.evaluation import Model, held_out_errors
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.omission import Omission
from igrow.trainer.fit.solver import DivergenceError
from igrow.trainer.progress import Progress, silent

TERMS = tuple(effect.name for effect in EFFECTS.values() if effect.resembles)
"""Effects that can stand in for a term of the physics."""
DAY = "24_h"
"""The horizon whose errors decide."""
WIDE = 3.0
"""Prior deviation of a term's size, in typical ones."""


def gains_of(
    record: Record, site: Site, posterior: Gaussian, rules: DecisionRules, effects: ActiveEffects | None = None
) -> dict[str, float]:
    """Return what every term gains in a calibration log against the parameters under the site's description.

    Args:
        record: of the log.
        site: the greenhouse.
        posterior: of the parameters that the calibration has; those that it holds stay where they are.
        rules: of the noise.
        effects: terms that were found before, at their sizes, which are free beside the parameters; they gain no more.

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    known = effects or {}
    _, design = history.jointly(record, site, posterior, rules, effects=known)
    block, columns = design.block("parameter"), design.block("effect").columns
    physical = history.physical_prior(site, posterior)
    null = LinearModel(tuple(block.columns), physical.precision, physical.mean - posterior.mean)
    asked = []
    for place, effect in _typical(design):
        if effect.name in known:
            null = null.with_term(Term(columns[place]))
        else:
            asked.append((columns[place], effect))
    # What a model has too much of it does not lack.
    limits = np.array([(max(one.amplitude.low, 0.0), one.amplitude.high) for _, one in asked]).reshape(-1, 2)
    chosen, rng = [column for column, _ in asked], np.random.default_rng(0)
    current = linear.fit(design.grams, null)
    scanned = scan.scan(design.grams, current, chosen, [None] * len(asked), [None], limits, rng, 0)
    gains = np.minimum(scanned.gain[0], 0.5 * scanned.statistic[0] ** 2)
    return {effect.name: float(gain) for (_, effect), gain in zip(asked, gains, strict=True)}


def examine(
    record: Record, site: Site, posterior: Gaussian, rules: DecisionRules, *, progress: Progress = silent
) -> Omission | None:
    """Return the terms that a calibrated model lacks; None where none makes unseen weeks better.

    Args:
        record: of the calibration log.
        site: the greenhouse.
        posterior: of the parameters that the calibration has.
        rules: what a term must show.
        progress: is told of each fit in a line.

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    held_out = held_out_weeks(record.time)
    if not held_out.any():
        return None
    prior = history.physical_prior(site, posterior)
    without: Model = (fit_climate([(record, ~held_out)], prior).values, {})
    found: Omission | None = None
    terms, last = tuple[Effect, ...](), without
    known: ActiveEffects = {}
    while len(terms) < rules.most_causes:
        try:
            promising = _promising(gains_of(record, site, posterior, rules, known), rules)
            trial = _closest(record, ~held_out, prior, last, terms, promising, progress)
            if trial is None or fall(held_out_errors(record, held_out, last, trial[1])) < rules.least_omission_fall:
                break
            terms, last = trial
            fitted = _fit(record, None, prior, terms, last)
        except DivergenceError:
            break  # What was found before stands without the term that the model cannot run with.
        posterior, known = fitted.marginal(prior.names), _active(fitted, terms)
        errors = held_out_errors(record, held_out, without, last)
        found = Omission(tuple(_estimated(fitted, effect, rules) for effect in terms), posterior, errors)
    return found


def fall(errors: Sequence[HeldOutError]) -> float:
    """Return by which share the error of a day ahead falls, the mean of all quantities."""
    day = [one.after / one.before for one in errors if one.horizon == DAY]
    return 1.0 - float(np.mean(day)) if day else 0.0


def fit_together(
    record: Record,
    rows: Mask | None,
    prior: Gaussian,
    sizes: Mapping[str, float],
    active: ActiveEffects,
    start: Mapping[str, float] | None = None,
) -> Gaussian:
    """Return parameters and the `sizes` expected of effects, fitted together; other arguments as `fit_climate`'s."""
    effects = [EFFECTS[name] for name in sizes]
    typical = np.array([one.amplitude.typical for one in effects])
    joint = Gaussian(
        (*prior.names, *map(_name, effects)),
        np.append(prior.mean, list(sizes.values())),
        block_diag(prior.covariance, np.diag((WIDE * typical) ** 2)),
    )
    return fit_climate([(record, rows)], joint, active, start=start)


def _promising(gains: Mapping[str, float], rules: DecisionRules) -> list[Effect]:
    """Return the terms that gain enough in the linear model to be fitted, that which gains most first."""
    ranked = sorted(gains, key=gains.__getitem__, reverse=True)
    return [EFFECTS[name] for name in ranked[: rules.most_omission_fits] if gains[name] >= rules.least_omission_gain]


def _closest(
    record: Record,
    rows: Mask,
    prior: Gaussian,
    last: Model,
    terms: tuple[Effect, ...],
    promising: Sequence[Effect],
    progress: Progress,
) -> tuple[tuple[Effect, ...], Model] | None:
    """Return the terms and that one more which brings the fitted rows closest to what was measured, and their model."""
    best: tuple[tuple[Effect, ...], Model] | None = None
    largest = 0.0
    for effect in promising:
        progress(f"fitting what may be missing: {effect.title}")
        together = (*terms, effect)
        try:
            fitted = _fit(record, rows, prior, together, last)
        except DivergenceError:
            continue
        model: Model = (fitted.marginal(prior.names).values, _active(fitted, together))
        if (fallen := fall(held_out_errors(record, rows, last, model))) > largest:
            best, largest = (together, model), fallen
    return best


def _active(fitted: Gaussian, terms: Sequence[Effect]) -> dict[str, dict[str, float]]:
    return {one.name: {one.amplitude.name: fitted.values[_name(one)], **_shape(one)} for one in terms}


def _estimated(fitted: Gaussian, effect: Effect, rules: DecisionRules) -> EffectRecord:
    size = fitted.values[_name(effect)]
    reach = normal_quantile(rules) * rules.deviation_inflation * fitted.deviations[_name(effect)]
    estimates = {effect.amplitude.name: Estimate.about(size, reach, effect.amplitude.unit)}
    estimates |= {one.name: Estimate(one.typical, one.low, one.high, one.unit) for one in effect.shapes}
    return EffectRecord(effect.name, effect.kind, estimates, effect.balances)


def _typical(design: Design) -> list[tuple[int, Effect]]:
    """Return every term with the place of its column at the shape nearest the typical one: that which the model has."""
    nearest: dict[str, tuple[float, int]] = {}
    for place, one in enumerate(design.candidates):
        if one.effect in TERMS:
            nearest[one.effect] = min(nearest.get(one.effect, (np.inf, 0)), (_distance(one), place))
    return [(place, EFFECTS[name]) for name, (_, place) in nearest.items()]


def _distance(one: Candidate) -> float:
    shapes = {shape.name: shape for shape in one.definition.shapes}
    return sum(abs(value - shapes[name].typical) / (shapes[name].high - shapes[name].low) for name, value in one.shape)


def _shape(effect: Effect) -> dict[str, float]:
    return {one.name: one.typical for one in effect.shapes}


def _name(effect: Effect) -> str:
    return f"{effect.name}:{effect.amplitude.name}"


def _fit(record: Record, rows: Mask | None, prior: Gaussian, terms: Sequence[Effect], start: Model) -> Gaussian:
    """Return parameters and the sizes of terms, fitted together to free runs, from another model's on."""
    parameters, effects = start
    known = {_name(EFFECTS[name]): values[EFFECTS[name].amplitude.name] for name, values in effects.items()}
    sizes, active = {one.name: one.amplitude.typical for one in terms}, {one.name: _shape(one) for one in terms}
    return fit_together(record, rows, prior, sizes, active, start={**parameters, **known})
