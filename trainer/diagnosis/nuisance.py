"""What logs show though nothing is missing: a model's own discrepancy, and the nuisance subspace of greenhouses.

A greenhouse whose parameters lie some way from the calibrated one's, under another weather, shows what looks like small
effects: a humidity offset here, a little air exchange there. What that looks like is learned once from logs of many
mechanistic greenhouses with nothing hidden in them: the few directions in the amplitudes of all effects and patterns
that make these logs likeliest. A diagnosis lets each direction explain what it can, at the size that it has there,
before it looks for a cause. `benchmarks/diagnosis/factor_analysis.py` is how they are learned.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import linear
from igrow.trainer.diagnosis.design import Design, prepare
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX, activate, knowledge_of
from igrow.trainer.diagnosis.rules import DecisionRules, came_with_the_trainer
from igrow.trainer.fit.model import FittedModel

FILE = "learned/nuisance.json"

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

    def null_amplitude(self, days: int, rules: DecisionRules) -> Mapping[str, float]:
        """Return the usual amplitudes by effect in a log of so many days.

        In one that is not long the gain that is asked of every cause covers them; allowed for beside it, they hid
        shades and beginnings.
        """
        return self.season if days > rules.long_days else {}


def read_nuisance() -> NuisanceSubspace:
    """Return the subspace that came with the trainer."""
    known = came_with_the_trainer(FILE)
    return NuisanceSubspace(tuple(known["home"]), tuple(known["transferred"]), known["season"], known["provenance"])


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
    keys = (*design.block("effect").labels, *design.block("pattern").labels)
    return dict(zip(keys, solution.coefficients.tolist(), strict=True)) | shift
