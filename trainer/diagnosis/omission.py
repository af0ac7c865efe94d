"""What a model lacks, asked of its calibration log: terms of the physics that are not in it.

A diagnosis asks what has changed since the calibration; what was missing then is asked here. Each term that an effect
of the catalogue can stand in for is scored against all parameters under the prior of the site's description, so that
parameters which a missing term drives to unphysical values speak for it too. Every structure misses something of every
greenhouse: what calibrations of greenhouses in which nothing was taken out gain is learned (`learned/omission.json`),
and a term must stand out from that. It must then make weeks better that no fit saw. A large one hides others, so the
question is asked again beside each that was found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from igrow.core.arrays import Mask
from igrow.core.bundle import EffectRecord, Estimate, HeldOutError
from igrow.core.effects import EFFECTS, Effect
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.data.splits import held_out_weeks
from igrow.trainer.diagnosis import history, linear, search
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.estimate import normal_quantile
from igrow.trainer.diagnosis.linear import LinearModel, Term
from igrow.trainer.diagnosis.rules import DecisionRules, came_with_the_trainer
from igrow.trainer.fit.climate import fit_climate
from igrow.trainer.fit.evaluation import Model, held_out_errors
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.omission import Omission
from igrow.trainer.fit.solver import DivergenceError

FILE = "learned/omission.json"
TERMS = tuple(effect.name for effect in EFFECTS.values() if effect.resembles)
"""Effects that can stand in for a term of the physics."""
DAY = "24_h"
"""The horizon whose errors decide."""
USUAL_DEVIATION = 2.0
"""Of a root gain before any greenhouse."""
WIDE = 3.0
"""Prior deviation of a term's size, in typical ones."""


@dataclass(frozen=True)
class UsualGains:
    """What terms gain in calibrations of greenhouses in which nothing was taken out."""

    root_gains: Mapping[str, tuple[float, float]]
    """Mean and standard deviation, over greenhouses, of the root of twice the gain, by effect."""
    least_score: float
    """Standard deviations above its mean that a term must stand."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """The command that learned it, its date and seeds."""

    def score(self, effect: str, gain: float) -> float:
        """Return how many standard deviations a gain lies above the usual one."""
        mean, deviation = self.root_gains.get(effect, (0.0, USUAL_DEVIATION))
        return (root_gain(gain) - mean) / deviation

    def outstanding(self, gains: Mapping[str, float]) -> str | None:
        """Return the term that stands out most; None where none stands out."""
        scores = {effect: self.score(effect, gain) for effect, gain in gains.items()}
        best = max(scores, key=scores.__getitem__, default=None)
        return None if best is None or scores[best] < self.least_score else best


def root_gain(gain: float) -> float:
    """Return the root of twice a gain: were the noise as it is modelled, that of a term that is not there is normal."""
    return float(np.sqrt(2.0 * gain))


def read_usual_gains() -> UsualGains:
    """Return the gains that came with the trainer."""
    return UsualGains(**came_with_the_trainer(FILE))


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
    typical = _typical(design)
    for place, effect in typical:
        if effect.name in known:
            null = null.with_term(Term(columns[place]))
    current = linear.fit(design.grams, null)
    found = {}
    for place, effect in typical:
        if effect.name in known:
            continue
        bound = effect.amplitude
        scanned = search.scan(
            design.grams,
            current,
            [columns[place]],
            [None],
            [None],
            # What a model has too much of it does not lack.
            np.array([[max(bound.low, 0.0), bound.high]]),
            np.random.default_rng(0),
            0,
        )
        found[effect.name] = float(min(scanned.gain[0, 0], 0.5 * scanned.statistic[0, 0] ** 2))
    return found


def examine(
    record: Record, site: Site, posterior: Gaussian, rules: DecisionRules, usual: UsualGains | None = None
) -> Omission | None:
    """Return the terms that a calibrated model lacks; None where none stands out, or none makes unseen weeks better.

    Args:
        record: of the calibration log.
        site: the greenhouse.
        posterior: of the parameters that the calibration has.
        rules: what a term must show.
        usual: what terms gain where nothing was taken out (None: what came with the trainer).

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    usual = usual or read_usual_gains()
    held_out = held_out_weeks(record.time)
    named = usual.outstanding(gains_of(record, site, posterior, rules))
    if named is None or not held_out.any():
        return None
    prior, found = history.physical_prior(site, posterior), None
    terms: tuple[Effect, ...] = ()
    try:
        without: Model = (fit_climate([(record, ~held_out)], prior).values, {})
        last = without
        while named is not None and len(terms) < rules.most_causes:
            terms = (*terms, EFFECTS[named])
            fitted = _fit(record, ~held_out, prior, terms)
            simulator: Model = (fitted.marginal(prior.names).values, _active(fitted, terms))
            if not _better(held_out_errors(record, held_out, last, simulator), rules):
                break
            last, fitted = simulator, _fit(record, None, prior, terms)
            parameters = fitted.marginal(prior.names)
            errors = held_out_errors(record, held_out, without, simulator)
            found = Omission(tuple(_estimated(fitted, effect, rules) for effect in terms), parameters, errors)
            named = usual.outstanding(gains_of(record, site, parameters, rules, _active(fitted, terms)))
    except DivergenceError:
        pass  # What was found before stands without the term that the model cannot run with.
    return found


def _better(errors: Sequence[HeldOutError], rules: DecisionRules) -> bool:
    """Tell whether a term takes its share off the error of unseen weeks."""
    day = [one.after / one.before for one in errors if one.horizon == DAY]
    return bool(day) and float(np.mean(day)) <= 1.0 - rules.least_omission_fall


def _active(fitted: Gaussian, terms: Sequence[Effect]) -> dict[str, dict[str, float]]:
    return {one.name: {one.amplitude.name: fitted.values[_name(one)], **_shape(one)} for one in terms}


def _estimated(fitted: Gaussian, effect: Effect, rules: DecisionRules) -> EffectRecord:
    size = fitted.values[_name(effect)]
    reach = normal_quantile(rules) * rules.deviation_inflation * fitted.deviations[_name(effect)]
    estimates = {effect.amplitude.name: Estimate(size, size - reach, size + reach, effect.amplitude.unit)}
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


def _fit(record: Record, rows: Mask | None, prior: Gaussian, terms: Sequence[Effect]) -> Gaussian:
    """Return parameters and the sizes of terms, fitted together to free runs."""
    typical = np.array([one.amplitude.typical for one in terms])
    joint = Gaussian(
        (*prior.names, *map(_name, terms)),
        np.concatenate([prior.mean, typical]),
        block_diag(prior.covariance, np.diag((WIDE * typical) ** 2)),
    )
    return fit_climate([(record, rows)], joint, {one.name: _shape(one) for one in terms})
