"""The design of a diagnosis: the log's errors, and in named blocks how they depend on all that may be missing.

    block        one column each
    residual     the errors themselves
    parameter    physical parameter
    effect       an effect of the catalogue at one shape
    ageing       what shifts the beginning of an effect that ages
    pattern      a course of clock, calendar or weather in one channel

What is known of parameters, effects and patterns together, before the log, is the null: the model under which nothing
is missing. One of them alone, free beside it, is a candidate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import DaySplit
from igrow.trainer.diagnosis.design import candidates, linear, noise, possible_air, sensitivity
from igrow.trainer.diagnosis.design.balances import Balances, balances_of
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.linear import DailyGrams, LinearModel
from igrow.trainer.diagnosis.design.noise import NoiseFilter, Whitening
from igrow.trainer.diagnosis.design.sensitivity import Linearisation
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.gaussian import Gaussian

JOINT = ("parameter", "effect", "pattern")
"""Blocks of all that may be missing: of each something may have been there before the log."""


@dataclass(frozen=True)
class History:
    """What is known of a greenhouse before a log, as this log shows it."""

    amplitudes: Gaussian
    """Of parameters, effects and patterns, in this order, beyond what is expected of them."""
    misfit: Floats
    """What the model is expected to miss: added to the errors, (b, r, steps)."""
    filters: tuple[NoiseFilter, ...]
    """The colour of the noise, by balance at hand; empty where it is to be learned."""
    own_gains: Mapping[str, float]
    """Of effects and patterns in windows of the calibration log."""
    without: frozenset[str] = frozenset()
    """Effects that are no candidates, though they may have been there before."""
    null_gains: NullGains | None = None
    """Of greenhouses in which nothing has changed; None in the calibration log itself."""
    unnamed: frozenset[str] = frozenset()
    """Patterns by key that no cause explains, found before: of them nothing is expected."""


@dataclass(frozen=True)
class Block:
    """Columns of one kind."""

    labels: tuple[str, ...]
    """Of its columns, (k,)."""
    columns: range
    """Where they stand in the design."""

    def __len__(self) -> int:
        return len(self.columns)


@dataclass(frozen=True)
class Design:
    """Everything that the search works on."""

    line: Linearisation
    """About the prior's mean."""
    split: DaySplit
    prior: Gaussian
    """Of the parameters."""
    rules: DecisionRules
    balances: Balances
    blocks: Mapping[str, Block]
    values: Floats
    """All columns, 0 where they do not count, before whitening, (q, b, r, steps)."""
    whitening: Whitening
    grams: DailyGrams
    """Of `values`, whitened."""
    candidates: tuple[Candidate, ...]
    """Of the block of effects."""
    patterns: tuple[Pattern, ...]
    """Of the block of patterns."""
    untestable: tuple[str, ...]
    history: History | None = None
    """What is known of the greenhouse before the log; None as long as the log is only laid out."""

    def block(self, name: str) -> Block:
        """Return a block by name.

        Raises:
            KeyError: the design has none of that name.
        """
        return self.blocks[name]

    def columns(self, label: str) -> list[int]:
        """Return the columns of a block ("effect"), or of what a label begins with ("effect:wind_infiltration")."""
        name, _, wanted = label.partition(":")
        block = self.block(name)
        return [
            column
            for column, own in zip(block.columns, block.labels, strict=True)
            if not wanted or own == wanted or own.startswith(f"{wanted}:")
        ]

    @property
    def known(self) -> History:
        """What is known of the greenhouse before the log: no design is searched without."""
        assert self.history is not None
        return self.history

    @property
    def observed(self) -> Mask:
        """Time steps that count, (r, steps)."""
        return self.balances.observed

    def null_model(self) -> LinearModel:
        """Return the model under which nothing is missing."""
        joint = self.known.amplitudes
        columns = tuple(column for name in JOINT for column in self.blocks[name].columns)
        return LinearModel(columns, joint.precision, joint.mean)

    @property
    def fitted(self) -> Mask:
        """Runs on days for fitting, (r, 1)."""
        runs: Mask = self.split.fit[self.line.runs.day][:, None]
        return runs

    def amplitude_bounds(self, effect: str, onset: int | None) -> tuple[float, float]:
        """Return the least and the largest amplitude of an effect that begins on a day (None: always)."""
        acts = None if onset is None else self.split.day >= onset
        return possible_air.amplitude_bounds(EFFECTS[effect], self.line.record, acts)

    def fit_noise(self, errors: Floats, start: Whitening | None = None) -> Whitening:
        """Fit the noise that a model leaves on the fit days: its scale alone where its colour is known.

        Args:
            errors: (b, r, steps).
            start: where to begin with the colour.
        """
        if self.history is not None and self.history.filters:
            return noise.rescaled(self.history.filters, errors, self.observed, self.fitted)
        return noise.fit_noise(errors, self.observed, self.fitted, start)

    def whitened(self, whitening: Whitening) -> Design:
        """Return the design as another noise shows it.

        Raises:
            DivergenceError: a column holds no numbers: no gain would be one, and nothing would be found.
        """
        products = linear.daily_products(whitening(self.values), self.line.runs.day, self.split.days)
        if not np.isfinite(products).all():
            raise sensitivity.divergence(self.line.effects)
        return replace(self, whitening=whitening, grams=DailyGrams(products, self.split.fit))


def lay_out(
    record: Record, split: DaySplit, prior: Gaussian, effects: ActiveEffects, longitude: float, rules: DecisionRules
) -> Design:
    """Return the design of a log about the prior's mean, before any noise.

    Patterns of single weekdays are left out: eight weeks know too little of them.

    Raises:
        DivergenceError: the model runs out of all bounds on the log, or with any parameter a little further on.
    """
    runs = sensitivity.day_runs(record, split.day)
    line = sensitivity.linearise(record, runs, prior.values, effects)
    balances = balances_of(line, rules)
    found = candidates.effect_columns(line)
    every, courses = candidates.pattern_columns(line, longitude)
    lasting = [place for place, one in enumerate(every) if not one.is_weekly]
    patterns = tuple(every[place] for place in lasting)
    labels = tuple(one.key for one in found.candidates)
    slopes = sensitivity.bounded_parameter_sensitivities(line, prior.names, prior.standard_deviation)
    parts = {
        "residual": (("residual",), line.errors[None]),
        "parameter": (prior.names, slopes),
        "effect": (labels, found.columns),
        "ageing": (labels, found.ageing),
        "pattern": (tuple(one.key for one in patterns), courses[lasting]),
    }
    blocks: dict[str, Block] = {}
    place = 0
    for name, (own, columns) in parts.items():
        blocks[name] = Block(own, range(place, place + len(columns)))
        place += len(columns)
    return Design(
        line=line,
        split=split,
        prior=prior,
        rules=rules,
        balances=balances,
        blocks=blocks,
        values=np.concatenate([balances(columns) for _, columns in parts.values()]),
        whitening=Whitening((), np.eye(len(balances.numbers)), balances.observed.astype(np.float64)),
        grams=DailyGrams(np.zeros((split.days, 0, 0)), split.fit),
        candidates=found.candidates,
        patterns=patterns,
        untestable=found.untestable,
    )
