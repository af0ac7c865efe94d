"""The amplitudes of all that may be missing: what they are called, how large they are or change by physics."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design.design import JOINT, Design
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX, home_drift
from igrow.trainer.diagnosis.rules import DecisionRules

CO2_SOURCES = frozenset({"soil_respiration", "co2_valve_leak"})
"""What a growing crop looks like."""


def columns(design: Design) -> list[int]:
    """Return the columns of everything that may be missing, (k,)."""
    return [column for name in JOINT for column in design.block(name).columns]


def keys(design: Design) -> tuple[str, ...]:
    """Return the keys of everything that may be missing, as a discrepancy has them."""
    parameters = (PARAMETER_PREFIX + name for name in design.block("parameter").labels)
    return (*parameters, *design.block("effect").labels, *design.block("pattern").labels)


def drift_within(design: Design) -> Floats:
    """Return the standard deviation of the change of everything within some weeks, by physics, (k,)."""
    rules = design.rules
    return np.concatenate([
        home_drift(design.prior.values, rules),
        rules.effect_drift * _typical(design),
        np.full(len(design.patterns), rules.pattern_drift),
    ])  # fmt: skip


def drift_over(design: Design, days: float) -> Floats:
    """Return the same within so many days, (k,): beyond some weeks as a random walk.

    Args:
        design: of a later log.
        days: from the middle of the calibration log to that of the later one.
    """
    rules = design.rules
    sources = [rules.co2_source_drift * (one.effect in CO2_SOURCES) for one in design.candidates]
    parameters, patterns = np.zeros(len(design.block("parameter"))), np.zeros(len(design.patterns))
    least = np.concatenate([parameters, sources * _typical(design), patterns])
    longer = max(days, rules.later_days) / rules.later_days
    change: Floats = np.maximum(drift_within(design), least) * np.sqrt(longer)
    return change


def omission(names: Sequence[str], rules: DecisionRules, unseen: Collection[str] = ()) -> Floats:
    """Return the prior deviation of effects and patterns before any log, (k,).

    Args:
        names: keys.
        rules: how much may be missing.
        unseen: of these, effects that the calibration log does not show: a law that it could not try may be far off.
    """
    effects = (EFFECTS.get(name.partition(":")[0]) for name in names)
    typical = [None if one is None else abs(one.amplitude.typical) for one in effects]
    shares = [rules.unseen_effect if name in unseen else rules.omission_effect for name in names]
    return np.array([
        rules.omission_pattern if one is None else share * one for one, share in zip(typical, shares, strict=True)
    ])  # fmt: skip


def hardly_shown(design: Design) -> frozenset[str]:
    """Return the keys of effects that at their typical size would be small beside the errors of a log."""
    errors = _root_mean_square(design.values[0])
    ratios = _root_mean_square(design.values[design.block("effect").columns]) / np.maximum(errors, 1e-300)
    sizes = _typical(design) * np.sqrt(np.mean(ratios**2, axis=-1))
    labels = design.block("effect").labels
    return frozenset(key for key, size in zip(labels, sizes, strict=True) if size < design.rules.least_shown)


def _root_mean_square(columns: Floats) -> Floats:
    """Return that of every balance, (..., b, r, steps) -> (..., b)."""
    found: Floats = np.sqrt(np.mean(columns**2, axis=(-2, -1)))
    return found


def _typical(design: Design) -> Floats:
    return np.array([abs(EFFECTS[one.effect].amplitude.typical) for one in design.candidates])
