"""What effects and parameters gain in greenhouses in which nothing has changed: a change must gain more than that.

A calibration that is carried into another season misses something of every greenhouse, and what it misses looks like
some effects more than like others. How much each of them gains by that alone, and what it takes off the error of unseen
days, is learned from later logs of virtual greenhouses with nothing missing, in several seasons. Of greenhouses that no
calibration has shown the same logs tell it, asked by the built-in bundle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from igrow.trainer.diagnosis.rules import came_with_the_trainer

FILE = "learned/null_gains.json"
UNKNOWN_FILE = "learned/unknown_gains.json"
SKILLS_FILE = "learned/null_skills.json"
PATTERN_SKILLS_FILE = "learned/null_pattern_skills.json"
BEGINNING_PREFIX = "beginning:"
""" "beginning:humidity_offset": what begins within a log, over the same effect there all the time."""


@dataclass(frozen=True)
class NullGains:
    """What is gained where nothing has changed: log-likelihoods in nats, or shares of the error of unseen days."""

    largest: Mapping[str, float]
    """In any such log, of effects, beginnings, parameters (``parameter:name``) or kinds of patterns."""
    least: float
    """What any change must gain: hardly any of such logs is told one then, each by what was gained at other places."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """The command that learned it, its date and seeds."""

    def needed(self, name: str, over: float = 1.0) -> float:
        """Return what a change must gain: more than it did in any greenhouse in which nothing had changed.

        Args:
            name: of an effect, a beginning, a parameter, or a kind of patterns.
            over: times that.
        """
        return max(self.least, over * self.largest.get(name, 0.0))

    def times(self, factor: float) -> NullGains:
        """Return so many times as much, for logs in which more is gained where nothing has changed."""
        return replace(
            self, largest={name: factor * gain for name, gain in self.largest.items()}, least=factor * self.least
        )


def read_null_gains() -> NullGains:
    """Return the log-likelihoods that came with the trainer."""
    return NullGains(**came_with_the_trainer(FILE))


def read_unknown_gains() -> NullGains:
    """Return the same of greenhouses that no calibration has shown."""
    return NullGains(**came_with_the_trainer(UNKNOWN_FILE))


def read_null_skills() -> NullGains:
    """Return the shares that came with the trainer: of the squared error a day ahead that an effect takes off."""
    return NullGains(**came_with_the_trainer(SKILLS_FILE))


def read_null_pattern_skills() -> NullGains:
    """Return the same of patterns without a name, by their `Pattern.kind`."""
    return NullGains(**came_with_the_trainer(PATTERN_SKILLS_FILE))
