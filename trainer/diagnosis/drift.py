"""How greenhouses change with time: the rate at which each parameter, effect and pattern wanders from a calibration.

A wall hardly changes in a month; a crop grows, and its uptake and respiration of CO2 with it. The rates are those of
independent random walks, learned from pairs of logs (a calibration, and a later log of the same greenhouse with nothing
missing) of virtual greenhouses in several seasons: the standard deviations that make all later logs likeliest, each
held a little to the usual one of its group (empirical Bayes by expectation maximisation; Bishop 2006, Pattern
Recognition and Machine Learning, sections 3.5 and 9.4).
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.errors import IgrowError
from igrow.trainer.diagnosis.knowledge import CROP
from igrow.trainer.diagnosis.rules import DecisionRules

FILE = "learned/drift.json"
ROUNDS = 40
"""Of expectation maximisation."""
HELD = 6.0
"""Logs that the usual rate of a group counts as, or a rate that was learned before."""
LEAST_PAIRS = 3
"""From so many greenhouses on their own changes count beside those that came with the trainer."""
LEARNED_SHARE, CO2_SHARE = 0.5, 0.85
"""Weight of a learned rate against the physically expected one, in logarithms. Where the structure is not the
greenhouse's a likelihood takes its misfit for change, and what may change too much hides causes; a crop does change."""
CO2_OF_CROP = frozenset({
    "parameter:assimilation_maximum", "parameter:assimilation_light", "parameter:assimilation_co2",
    "parameter:respiration",
})  # fmt: skip
"""What a growing crop does with CO2."""
CO2_SOURCES: Mapping[str, float] = {"soil_respiration": 0.1, "co2_valve_leak": 0.1}
"""Least rate of sources of CO2 that a growing crop looks like."""


@dataclass(frozen=True)
class Drift:
    """Standard deviations of the change between a calibration and a log some days later."""

    rates: Mapping[str, float]
    """By key (``parameter:name``, an effect, ``channel:when`` of a pattern): of a parameter relative to its value, of
    an effect in typical amplitudes, of a pattern in its units."""
    days: float
    """From the middle of one log to that of the other, in the pairs that they were learned from."""
    null_gains: Mapping[str, float] = field(default_factory=dict)
    """Largest gain in logs with nothing missing of greenhouses that the rates were not learned from: of an effect, and,
    where all else changes by physics alone, of a parameter (``parameter:name``)."""
    least_gain: float = 12.0
    """Gain that a change must have at least: so few of these logs have more, each by the gains of the others."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """The command that learned it, its date and seeds."""

    def needed_gain(self, effect: str, rules: DecisionRules) -> float:
        """Return what a change must gain: more, by some, than it did in any greenhouse in which nothing had changed."""
        return max(self.least_gain, rules.change_over_null * self.null_gains.get(effect, 0.0))

    def by_physics(self) -> Drift:
        """Return the change that physics alone lets expect: what one parameter's own change is told from."""
        return replace(self, rates={})

    def rate(self, key: str, expected: float, days: float) -> float:
        """Return the rate of a key after so many days; no less than after those that it was learned from.

        Args:
            key: of a parameter, an effect or a pattern.
            expected: the rate by which it changes within weeks, by physics.
            days: from the middle of the calibration log to that of the later one.
        """
        expected = max(expected, CO2_SOURCES.get(key, 0.0))
        learned = max(self.rates.get(key, expected), expected)
        share = CO2_SHARE if key in CO2_OF_CROP else LEARNED_SHARE
        usual = float(expected ** (1.0 - share) * learned**share)
        return usual * float(np.sqrt(max(days, self.days) / self.days))


@dataclass(frozen=True)
class Pair:
    """What a later log says of the change since the calibration, up to a constant."""

    keys: tuple[str, ...]
    """Of rates, (k,); columns of one effect at several shapes share a key."""
    unit: Floats
    """Size of a change of rate one, (k,)."""
    expected: Floats
    """Rates by physics, (k,)."""
    known: Floats
    """Covariance of what the calibration left open, (k, k)."""
    information: Floats
    """Of the later log, (k, k)."""
    score: Floats
    """Its gradient at no change, (k,)."""

    def to_bytes(self) -> bytes:
        """Return the content of a file that holds it: plain arrays, never a pickle."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **{name: np.array(one) for name, one in vars(self).items()})
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes, *, where: str) -> Pair:
        """Read a pair.

        Raises:
            IgrowError: it is not such a file; `where` names it.
        """
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                arrays = {one.name: file[one.name] for one in fields(cls)}
            keys = tuple(map(str, arrays.pop("keys")))
            for name, array in arrays.items():
                shape = (len(keys),) * (2 if name in {"known", "information"} else 1)
                if array.shape != shape or not np.all(np.isfinite(array)):
                    raise ValueError(f"{name} is no finite array of {shape}")
            return cls(keys, **arrays)
        except Exception as error:
            # A damaged archive raises from zipfile, zlib or numpy; for the user it is one fault.
            raise IgrowError(f"{where}: holds no change of a greenhouse: {error}") from None


def read_drift(path: Path | None = None) -> Drift:
    """Return a stored drift (None: the one that came with the trainer).

    Raises:
        IgrowError: the file cannot be read, or is none; in one line.
    """
    file = files("igrow.trainer.diagnosis").joinpath(FILE) if path is None else path
    try:
        known = Drift(**json.loads(file.read_text(encoding="utf-8")))
        numbers = [*known.rates.values(), *known.null_gains.values(), known.days, known.least_gain]
        if not np.all(np.isfinite(np.array(numbers, dtype=np.float64))):
            raise ValueError("a number is none")
        return known
    except OSError as error:
        raise IgrowError(f"{path}: {error.strerror}; `igrow-trainer fleet learn` writes it") from None
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise IgrowError(f"{path}: no drift as `igrow-trainer fleet learn` writes it") from None


def write_drift(path: Path, drift: Drift) -> None:
    """Write a drift with its provenance."""
    path.write_text(json.dumps(asdict(drift), indent=1) + "\n", encoding="utf-8")


def group_of(key: str) -> str:
    """Return what a key's rate is held to: the crop's, the walls', that of all effects, or of a channel's patterns."""
    kind, _, name = key.partition(":")
    if not name:
        return "effect"
    return "crop" if kind == "parameter" and name in CROP else kind


def learn(pairs: Sequence[Pair], days: float, known: Drift | None = None) -> Drift:
    """Return the drift that makes later logs likeliest.

    Args:
        pairs: of greenhouses in which nothing is missing.
        days: from the middle of a calibration to that of a later log.
        known: what was learned of other greenhouses; each rate is held to its own there, and not to its group's.
            The gains that a change must have stay: logs in which something was found are none of the pairs.
    """
    rates = {key: rate for one in pairs for key, rate in zip(one.keys, one.expected.tolist(), strict=True)}
    before = {} if known is None else {key: rate**2 for key, rate in known.rates.items()}
    rates |= {key: rate for key, rate in (known.rates.items() if known else ()) if key in rates}
    for _ in range(ROUNDS):
        squares: dict[str, list[float]] = {key: [] for key in rates}
        for one in pairs:
            change = np.array([rates[key] for key in one.keys]) * one.unit
            for key, square in zip(one.keys, expected_squares(one, change) / one.unit**2, strict=True):
                squares[key].append(float(square))
        usual = _usual(squares)
        for key, own in squares.items():
            held = before.get(key, usual[group_of(key)])
            rates[key] = float(np.sqrt((HELD * held + sum(own)) / (HELD + len(own))))
    learned = {key: float(f"{rate:.3g}") for key, rate in sorted(rates.items())}
    return Drift(learned, days) if known is None else replace(known, rates={**known.rates, **learned})


def expected_squares(pair: Pair, change: Floats) -> Floats:
    """Return the expected square of each change given the log, (k,), at changes of standard deviation `change`."""
    variance = change**2
    prior = inverse_of(pair.known + np.diag(variance))
    posterior = inverse_of(pair.information + prior)
    to_change = variance[:, None] * prior
    mean = to_change @ (posterior @ pair.score)
    spread = variance - variance * np.diag(prior) * variance + np.sum((to_change @ posterior) * to_change, axis=1)
    squares: Floats = np.asarray(mean**2 + spread, dtype=np.float64)
    return squares


def _usual(squares: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Return the geometric mean square of every group."""
    groups: dict[str, list[float]] = {}
    for key, own in squares.items():
        groups.setdefault(group_of(key), []).append(math.log(max(sum(own) / len(own), 1e-12)))
    return {group: math.exp(sum(logs) / len(logs)) for group, logs in groups.items()}


def inverse_of(matrix: Floats) -> Floats:
    """Return the inverse of a covariance whose entries differ by many orders of magnitude."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    inverse: Floats = np.linalg.inv(matrix * scale[:, None] * scale) * scale[:, None] * scale
    return inverse
