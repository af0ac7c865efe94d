"""What a model lacks, asked of its calibration log: a term of the physics that is not in it.

A diagnosis asks what has changed since the calibration; what was missing then is asked here. Each term that an effect
of the catalogue can stand in for is scored against all parameters under the prior of the site's description, so that
parameters which a missing term drives to unphysical values speak for it too. Every structure misses something of every
greenhouse: what calibrations of greenhouses in which nothing was taken out gain is learned (`learned/omission.json`),
and a term must stand out from that. It must then make weeks better that no fit saw.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from igrow.core.arrays import Mask
from igrow.core.bundle import EffectRecord, Estimate
from igrow.core.effects import EFFECTS, Effect
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.data.splits import alternate_weeks
from igrow.trainer.diagnosis import history, linear, search
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.estimate import normal_quantile
from igrow.trainer.diagnosis.linear import LinearModel
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.climate import fit_climate
from igrow.trainer.fit.evaluation import held_out_errors
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.omission import Omission
from igrow.trainer.fit.solver import DivergenceError

FILE = "learned/omission.json"
TERMS = tuple(effect.name for effect in EFFECTS.values() if effect.resembles)
"""Effects that can stand in for a term of the physics."""
DAY = "24_h"
"""The horizon whose errors decide."""
USUAL_DEVIATION, HELD = 2.0, 3.0
"""Deviation of a root gain before any greenhouse, and greenhouses that it counts as."""
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

    def outstanding(self, gains: Mapping[str, float]) -> tuple[str, float] | None:
        """Return the term that stands out most, with its score; None where none stands out."""
        scores = {effect: self.score(effect, gain) for effect, gain in gains.items()}
        best = max(scores, key=scores.__getitem__, default=None)
        return None if best is None or scores[best] < self.least_score else (best, scores[best])


def root_gain(gain: float) -> float:
    """Return the root of twice a gain: were the noise as it is modelled, that of a term that is not there is normal."""
    return float(np.sqrt(2.0 * gain))


def learn(gains: Mapping[str, Sequence[Mapping[str, float]]]) -> dict[str, tuple[float, float]]:
    """Return mean and predictive deviation of the root gain of every term.

    Args:
        gains: by greenhouse, those of its calibrations in which nothing was taken out.
    """
    found = {}
    for effect in TERMS:
        roots = np.array([np.mean([root_gain(one.get(effect, 0.0)) for one in own]) for own in gains.values()])
        count, mean = len(roots), float(roots.mean())
        # An inverse chi-squared prior keeps few greenhouses that happen to agree from counting as all there are.
        variance = (HELD * USUAL_DEVIATION**2 + float(np.sum((roots - mean) ** 2))) / (HELD + count - 1.0)
        found[effect] = (round(mean, 2), round(float(np.sqrt(variance * (1.0 + 1.0 / count))), 2))
    return found


def read_usual_gains() -> UsualGains:
    """Return the gains that came with the trainer."""
    file = files("igrow.trainer.diagnosis").joinpath(FILE)
    return UsualGains(**json.loads(file.read_text(encoding="utf-8")))


def write_usual_gains(path: Path, usual: UsualGains) -> None:
    """Write gains with their provenance."""
    path.write_text(json.dumps(asdict(usual), indent=1) + "\n", encoding="utf-8")


def gains_of(record: Record, site: Site, posterior: Gaussian, rules: DecisionRules) -> dict[str, float]:
    """Return what every term gains in a calibration log against the parameters under the site's description.

    Args:
        record: of the log.
        site: the greenhouse.
        posterior: of the parameters that the calibration has; those that it holds stay where they are.
        rules: of the noise.

    Raises:
        DivergenceError: the model runs out of all bounds on the log.
    """
    _, design = history.jointly(record, site, posterior, rules)
    block = design.block("parameter")
    physical = history.physical_prior(site, posterior)
    null = LinearModel(tuple(block.columns), physical.precision, physical.mean - posterior.mean)
    current = linear.fit(design.grams, null)
    found = {}
    for place, effect in _typical(design):
        bound = effect.amplitude
        scanned = search.scan(
            design.grams,
            current,
            [design.block("effect").columns[place]],
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
    record: Record,
    site: Site,
    posterior: Gaussian,
    rules: DecisionRules,
    usual: UsualGains | None = None,
) -> Omission | None:
    """Return the term that a calibrated model lacks; None where none stands out, or none makes unseen weeks better.

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
    held_out = alternate_weeks(record.time).held_out
    named = usual.outstanding(gains_of(record, site, posterior, rules))
    if named is None or not held_out.any():
        return None
    effect, score = EFFECTS[named[0]], named[1]
    prior = history.physical_prior(site, posterior)
    try:
        without = fit_climate([(record, ~held_out)], prior)
        beside = _fit(record, ~held_out, prior, effect)
        parameters = beside.marginal(prior.names).values
        active = {effect.name: {effect.amplitude.name: beside.values[_name(effect)], **_shape(effect)}}
        errors = held_out_errors(record, held_out, (without.values, {}), (parameters, active))
        day = [one.after / one.before for one in errors if one.horizon == DAY]
        if not day or np.mean(day) > 1.0 - rules.least_omission_fall:
            return None
        fitted = _fit(record, None, prior, effect)
    except DivergenceError:
        return None
    name = _name(effect)
    size, deviation = fitted.values[name], rules.deviation_inflation * fitted.deviations[name]
    reach = normal_quantile(rules) * deviation
    estimates = {effect.amplitude.name: Estimate(size, size - reach, size + reach, effect.amplitude.unit)}
    estimates |= {one.name: Estimate(one.typical, one.low, one.high, one.unit) for one in effect.shapes}
    found = EffectRecord(effect.name, effect.kind, estimates, effect.balances)
    return Omission(found, fitted.marginal(prior.names), score, errors)


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


def _fit(record: Record, rows: Mask | None, prior: Gaussian, effect: Effect) -> Gaussian:
    """Return parameters and the size of a term, fitted together to free runs."""
    size = effect.amplitude
    joint = Gaussian(
        (*prior.names, _name(effect)),
        np.append(prior.mean, size.typical),
        block_diag(prior.covariance, (WIDE * size.typical) ** 2),
    )
    return fit_climate([(record, rows)], joint, {effect.name: _shape(effect)})
