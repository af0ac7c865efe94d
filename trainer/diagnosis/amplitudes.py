"""The amplitudes of all that may be missing: what they are called, how large they are or change by physics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design import JOINT, Design
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX, drift, home_drift
from igrow.trainer.diagnosis.rules import DecisionRules


def columns(design: Design) -> list[int]:
    """Return the columns of everything that may be missing, (k,)."""
    return [column for name in JOINT for column in design.block(name).columns]


def keys(design: Design) -> tuple[str, ...]:
    """Return the keys of everything that may be missing, as a discrepancy has them."""
    parameters = (PARAMETER_PREFIX + name for name in design.block("parameter").labels)
    return (*parameters, *design.block("effect").labels, *design.block("pattern").labels)


def rate_keys(design: Design) -> tuple[str, ...]:
    """Return the keys of everything that may be missing, as a drift has them: an effect has one at all shapes."""
    parameters = (PARAMETER_PREFIX + name for name in design.block("parameter").labels)
    return (*parameters, *(one.effect for one in design.candidates), *design.block("pattern").labels)


def units(design: Design) -> Floats:
    """Return the size of a change of rate one, (k,)."""
    return np.concatenate([
        drift(design.prior.values, 1.0, design.rules), _typical(design), np.ones(len(design.patterns))
    ])  # fmt: skip


def drift_within(design: Design) -> Floats:
    """Return the standard deviation of the change of everything within some weeks, by physics, (k,)."""
    rules = design.rules
    return np.concatenate([
        home_drift(design.prior.values, rules),
        rules.effect_drift * _typical(design),
        np.full(len(design.patterns), rules.pattern_drift),
    ])  # fmt: skip


def omission(names: Sequence[str], rules: DecisionRules) -> Floats:
    """Return the prior deviation of effects and patterns before any log, (k,)."""
    effects = (EFFECTS.get(name.partition(":")[0]) for name in names)
    typical = (None if one is None else abs(one.amplitude.typical) for one in effects)
    return np.array([rules.omission_pattern if one is None else rules.omission_effect * one for one in typical])


def _typical(design: Design) -> Floats:
    return np.array([abs(EFFECTS[one.effect].amplitude.typical) for one in design.candidates])
