"""A design of known truth: columns drawn at random, errors that are exactly what is said, and white noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import DaySplit
from igrow.trainer.diagnosis.design import linear, noise
from igrow.trainer.diagnosis.design.balances import Balances
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.design import Block, Design, History
from igrow.trainer.diagnosis.design.linear import DailyGrams
from igrow.trainer.diagnosis.design.noise import NoiseFilter, Whitening
from igrow.trainer.diagnosis.design.sensitivity import DayRuns, Linearisation
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules
from igrow.trainer.fit.gaussian import Gaussian

BALANCES, HOURS = 2, 24
START = np.datetime64("2020-03-01T00:00:00", "s")
PLAIN = NoiseFilter(np.ones(1), np.ones(1), (2.0, 4.5, 0.5, 1.75, 3.0))
"""Leaves errors as they are."""
NEVER, LEAST = 1e-4, 8.0
"""Prior deviation of what was not there before, and gain of a change."""


@dataclass(frozen=True)
class Truth:
    """What is hidden in the errors."""

    effects: Mapping[str, float]
    """Amplitude by label of an effect's column."""
    patterns: Mapping[str, float]
    parameters: Sequence[float] = ()
    onset: int = 0
    """Day from which effects and patterns act."""


def make_design(
    truth: Truth | None = None,
    *,
    candidates: Sequence[Candidate] = (Candidate("lamp_heat", ()), Candidate("rain_cooling", ())),
    patterns: Sequence[Pattern] = (Pattern("heat", "cold weather", ("outdoor_temperature",)),),
    parameters: int = 3,
    days: int = 32,
    seed: int = 0,
    rules: DecisionRules = DEFAULT,
    sigma: float = 1.0,
) -> Design:
    """Return a design whose errors are sigma times white noise less what is hidden.

    Parameters have the prior N(0, 1) and the design stands at 0, effects and patterns were not there before; every
    column is white and of unit size.
    """
    truth = truth or Truth({}, {})
    rng = np.random.default_rng(seed)
    keys, whens = [one.key for one in candidates], [one.key for one in patterns]
    labels = {
        "residual": ["residual"],
        "parameter": [f"p{number}" for number in range(parameters)],
        "effect": keys,
        "ageing": keys,
        "pattern": whens,
    }
    names = labels["parameter"]
    values = rng.normal(size=(sum(map(len, labels.values())), BALANCES, days, HOURS))
    blocks: dict[str, Block] = {}
    place = 0
    for name, own in labels.items():
        blocks[name] = Block(tuple(own), range(place, place + len(own)))
        place += len(own)
    values[list(blocks["ageing"].columns)] = 0.0
    begun = (np.arange(days) >= truth.onset)[:, None]
    values[0] *= sigma
    for name, hidden, always in (
        ("effect", truth.effects, False),
        ("pattern", truth.patterns, False),
        ("parameter", dict(zip(names, truth.parameters, strict=False)), True),
    ):
        for label, amplitude in hidden.items():
            column = blocks[name].columns[blocks[name].labels.index(label)]
            values[0] -= amplitude * values[column] * (True if always else begun)
    before = np.array([1.0] * parameters + [NEVER] * (len(keys) + len(whens)))
    every = (*(PARAMETER_PREFIX + name for name in names), *keys, *whens)
    known = Gaussian(every, np.zeros(len(every)), np.diag(before**2))
    observed = np.ones((days, HOURS), dtype=bool)
    fit = np.isin(np.arange(days) % 8, (3, 4), invert=True)
    whitening = Whitening((PLAIN,) * BALANCES, np.eye(BALANCES) / sigma, observed.astype(np.float64))
    products = linear.daily_products(whitening(values), np.arange(days), days)
    return Design(
        line=_line(days, names),
        split=DaySplit(np.repeat(np.arange(days), HOURS), fit),
        prior=Gaussian(tuple(names), np.zeros(parameters), np.eye(parameters)),
        rules=rules,
        balances=Balances(tuple(range(BALANCES)), observed),
        blocks=blocks,
        values=values,
        whitening=whitening,
        grams=DailyGrams(products, fit),
        candidates=tuple(candidates),
        patterns=tuple(patterns),
        untestable=(),
        history=History(known, np.zeros_like(values[0]), (), {}, null_gains=NullGains({}, LEAST)),
    )


def in_fitted_noise(design: Design) -> Design:
    """Return the design under noise that is fitted to its errors, as a search meets it."""
    return design.whitened(noise.fit_noise(design.values[0], design.observed, design.fitted))


def with_column(design: Design, label: str, values: Floats) -> Design:
    """Return the design with one column, (b, r, steps), replaced."""
    (column,) = design.columns(label)
    changed = design.values.copy()
    changed[column] = values
    return replace(design, values=changed).whitened(design.whitening)


def _line(days: int, names: Sequence[str]) -> Linearisation:
    count = days * HOURS + 1
    time = START + np.arange(count) * np.timedelta64(3600, "s")
    record = Record(time, 3600.0, {}, {}, np.ones(count, dtype=bool), (), 0.0)
    runs = DayRuns(np.arange(days) * HOURS, HOURS, np.arange(days), np.ones((3, days, HOURS), dtype=bool))
    return Linearisation(record, runs, dict.fromkeys(names, 0.0), {}, np.zeros((3, days, HOURS)), {}, {})
