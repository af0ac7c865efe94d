"""The design of a diagnosis: the log's errors, and in named blocks how they depend on all that may be missing.

    block          one column each                                          prior of its coefficients
    residual       the errors themselves
    parameter      physical parameter                                       the model's posterior, and a drift
    discrepancy    what the model misses on its calibration log             about one
    nuisance       a direction in which greenhouses differ                  standard normal
    drift          a parameter's change along a long log                    standard normal
    effect         an effect of the catalogue at one shape                  none: a candidate
    ageing         what shifts the beginning of an effect that ages
    pattern        a course of clock, calendar or weather in one channel    none: a candidate

The blocks with a prior are the null: the model under which nothing is missing.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import DaySplit
from igrow.trainer.diagnosis import candidates, linear, noise, possible_air, sensitivity
from igrow.trainer.diagnosis.candidates import Candidate, EffectColumns, Pattern
from igrow.trainer.diagnosis.knowledge import drift
from igrow.trainer.diagnosis.linear import DailyGrams, LinearModel
from igrow.trainer.diagnosis.noise import NoiseFilter, Whitening
from igrow.trainer.diagnosis.null_gains import NullGains
from igrow.trainer.diagnosis.recalibration import Averaging, averaging, recalibrate
from igrow.trainer.diagnosis.rules import HOUR, DecisionRules
from igrow.trainer.diagnosis.sensitivity import Linearisation
from igrow.trainer.fit.gaussian import Gaussian

Part = tuple[str, Sequence[str], Floats, Floats, Floats | None]
"""Name, labels, columns, and mean and precision of a block."""
NULL = ("parameter", "discrepancy", "nuisance", "drift")
"""Blocks of the model under which nothing is missing."""
JOINT = ("parameter", "effect", "pattern")
"""The same where the greenhouse's history is known: whatever may be missing was there to some extent before."""


@dataclass(frozen=True)
class History:
    """What is known of a greenhouse from its calibration, as a log shows it."""

    amplitudes: Gaussian
    """Of parameters, effects and patterns, in this order, beyond what is expected of them."""
    misfit: Floats
    """What the model is expected to miss: added to the errors, (b, r, intervals)."""
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
    mean: Floats
    """Of the prior of their coefficients, (k,)."""
    precision: Floats | None
    """Of that prior, (k, k); None for candidates, which have none."""

    def __len__(self) -> int:
        return len(self.columns)


@dataclass(frozen=True)
class Design:
    """Everything that the search works on."""

    line: Linearisation
    """At the recalibrated parameters."""
    split: DaySplit
    prior: Gaussian
    """Of the parameters."""
    rules: DecisionRules
    interval: float
    """Seconds over which errors are averaged."""
    blocks: Mapping[str, Block]
    values: Floats
    """All columns as means over intervals, 0 where they do not count, before whitening, (q, b, r, intervals)."""
    observed: Mask
    """Intervals that count, (r, intervals)."""
    whitening: Whitening
    grams: DailyGrams
    """Of `values`, whitened."""
    candidates: tuple[Candidate, ...]
    """Of the block of effects."""
    patterns: tuple[Pattern, ...]
    """Of the block of patterns."""
    untestable: tuple[str, ...]
    null_amplitude: Mapping[str, float] = field(default_factory=dict)
    """Amplitude, by effect, that a log with nothing missing usually shows."""
    history: History | None = None
    """What is known of this very greenhouse from its calibration; None: greenhouses in general stand in."""

    def block(self, name: str) -> Block:
        """Return a block by name.

        Raises:
            KeyError: the design has none of that name.
        """
        return self.blocks[name]

    def columns(self, label: str) -> list[int]:
        """Return the columns of a block ("nuisance"), or of what a label begins with ("effect:wind_infiltration")."""
        name, _, wanted = label.partition(":")
        block = self.block(name)
        return [
            column
            for column, own in zip(block.columns, block.labels, strict=True)
            if not wanted or own == wanted or own.startswith(f"{wanted}:")
        ]

    def null_model(self) -> LinearModel:
        """Return the model under which nothing is missing."""
        if self.history is not None:
            joint = self.history.amplitudes
            columns = tuple(column for name in JOINT for column in self.blocks[name].columns)
            return LinearModel(columns, joint.precision, joint.mean)
        blocks = [self.blocks[name] for name in NULL]
        size = sum(len(block) for block in blocks)
        precision, first = np.zeros((size, size)), 0
        for block in blocks:
            inside = slice(first, first + len(block))
            assert block.precision is not None
            precision[inside, inside] = block.precision
            first += len(block)
        mean = np.concatenate([block.mean for block in blocks])
        return LinearModel(tuple(column for block in blocks for column in block.columns), precision, mean)

    @property
    def time_steps(self) -> bool:
        """Errors count time step by time step: the model's structure is the greenhouse's own."""
        return self.interval < HOUR

    @property
    def transferred(self) -> bool:
        """What the model misses of this greenhouse when all is well is not known."""
        return self.history is None and len(self.blocks["discrepancy"]) == 0

    @property
    def onset_price(self) -> float:
        """Gain that a beginning within the log must add."""
        return self.rules.onset_price if self.history is None else self.rules.change_onset_price

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
            errors: (b, r, intervals).
            start: where to begin with the colour.
        """
        if self.history is not None and self.history.filters:
            return noise.rescaled(self.history.filters, errors, self.observed, self.fitted)
        return noise.fit_noise(errors, self.observed, self.fitted, start)

    def whitened(self, whitening: Whitening) -> Design:
        """Return the design as another noise shows it."""
        products = linear.daily_products(whitening(self.values), self.line.runs.day, self.split.days)
        return replace(self, whitening=whitening, grams=DailyGrams(products, self.split.fit))


def prepare(
    record: Record,
    split: DaySplit,
    prior: Gaussian,
    effects: ActiveEffects,
    longitude: float,
    rules: DecisionRules,
    *,
    discrepancy: Mapping[str, float],
    directions: Sequence[Mapping[str, float]] = (),
    null_amplitude: Mapping[str, float] | None = None,
    without: Collection[str] = (),
    interval: float = HOUR,
) -> Design:
    """Recalibrate, then linearise everything that may be missing.

    Args:
        record: of the log.
        split: its days.
        prior: of the parameters.
        effects: active already.
        longitude: degrees east, for the calendar.
        rules: thresholds.
        discrepancy: of the calibration, amplitude by key of an effect or a pattern (empty: not known).
        directions: the nuisance subspace, each direction in amplitudes by key.
        null_amplitude: amplitude, by effect, that a log with nothing missing usually shows.
        without: effects that are no candidates.
        interval: seconds over which errors are averaged.
    """
    runs = sensitivity.day_runs(record, split.day)
    first = sensitivity.linearise(record, runs, prior.values, effects)
    average = averaging(first, interval, rules)
    known, nuisance = _combined(first, longitude, [discrepancy] if discrepancy else [], directions)
    misfit = average(known).sum(axis=0)
    line, whitening = recalibrate(first, split, prior, misfit, average, rules)
    slopes = sensitivity.parameter_sensitivities(line, prior.names, prior.standard_deviation)
    drifting = _drifting(slopes, prior, runs.day, rules) if split.days > rules.long_days else slopes[:0]
    found = candidates.effect_columns(line, without)
    patterns, pattern = candidates.pattern_columns(line, longitude)
    stand = np.array([line.parameters[name] for name in prior.names])
    none, effect_keys = np.zeros(0), tuple(one.key for one in found.candidates)
    spread = rules.discrepancy_spread
    parts: list[Part] = [
        ("residual", ("residual",), line.errors[None], none, None),
        ("parameter", prior.names, slopes, prior.mean - stand, prior.precision),
        ("effect", effect_keys, found.columns, none, None),
        ("ageing", effect_keys, found.ageing, none, None),
        ("pattern", [one.key for one in patterns], pattern, none, None),
        # The linearisation has none of the known discrepancy yet: one is to come.
        ("discrepancy", ["calibration"] * len(known), known, np.ones(len(known)), np.eye(len(known)) * spread**-2.0),
        ("nuisance", list(map(str, range(len(nuisance)))), nuisance, np.zeros(len(nuisance)), np.eye(len(nuisance))),
        ("drift", prior.names[: len(drifting)], drifting, np.zeros(len(drifting)), np.eye(len(drifting))),
    ]
    plain = of_parts(line, split, prior, rules, average, parts, found, patterns)
    return replace(plain, null_amplitude=null_amplitude or {}).whitened(whitening)


def of_parts(
    line: Linearisation,
    split: DaySplit,
    prior: Gaussian,
    rules: DecisionRules,
    average: Averaging,
    parts: Sequence[Part],
    found: EffectColumns,
    patterns: tuple[Pattern, ...],
) -> Design:
    """Return the design of columns that stand one after the other, before any noise."""
    blocks: dict[str, Block] = {}
    place = 0
    for name, labels, columns, mean, precision in parts:
        blocks[name] = Block(tuple(labels), range(place, place + len(columns)), mean, precision)
        place += len(columns)
    return Design(
        line=line,
        split=split,
        prior=prior,
        rules=rules,
        interval=average.interval,
        blocks=blocks,
        values=np.concatenate([average(columns) for _, _, columns, _, _ in parts]),
        observed=average.observed,
        whitening=Whitening((), np.eye(len(average.balances)), average.observed.astype(np.float64)),
        grams=DailyGrams(np.zeros((split.days, 0, 0)), split.fit),
        candidates=found.candidates,
        patterns=patterns,
        untestable=found.untestable,
    )


def _combined(line: Linearisation, longitude: float, *groups: Sequence[Mapping[str, float]]) -> list[Floats]:
    """Return for groups of amplitudes by key the columns that each adds up to, (group, 3, r, steps)."""
    if not any(groups):
        return [np.zeros((0, *line.shown.shape)) for _ in groups]
    found = candidates.effect_columns(line)
    patterns, courses = candidates.pattern_columns(line, longitude)
    keys = [*(one.key for one in found.candidates), *(one.key for one in patterns)]
    columns = np.concatenate([found.columns, courses])
    amplitudes = (np.array([[one.get(key, 0.0) for key in keys] for one in group]) for group in groups)
    return [np.tensordot(one.reshape(-1, len(keys)), columns, axes=1) for one in amplitudes]


def _drifting(slopes: Floats, prior: Gaussian, day: Integers, rules: DecisionRules) -> Floats:
    """Return d(error)/d(drift) of every parameter, (p, 3, r, steps): linear in time, at the size that it may have."""
    middle = 0.5 * (day[0] + day[-1])
    course = (day - middle) / (0.5 * rules.drift_days)
    size = drift(prior.values, rules.parameter_drift, rules)
    drifting: Floats = slopes * size[:, None, None, None] * course[:, None]
    return drifting
