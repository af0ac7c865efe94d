"""The process image: what one control cycle knows, frozen for the length of that cycle.

Every value carries its quality and its age, so that nothing downstream has to guess whether a number may be
believed. `igrow.edge.sensors` builds an image from raw readings; decisions, guard and log only read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType


class Quality(Enum):
    """Whether a value may be believed, and if not, why."""

    GOOD = "good"
    STALE = "stale"
    """The last value that was read, older than it should be."""
    OUT_OF_RANGE = "out_of_range"
    FROZEN = "frozen"
    """Unchanged to the last digit for longer than this sensor can stand still."""
    MISSING = "missing"
    """Never read, or not for so long that the old value means nothing."""
    IMPLAUSIBLE = "implausible"
    """It moved faster than physics allows, or contradicts another sensor."""


@dataclass(frozen=True, slots=True)
class Value:
    """One point of the image."""

    value: float | None
    """In the quantity's unit; None when nothing was ever read. Bad values are kept, for the log and the page."""
    quality: Quality
    age: float
    """Seconds since the value was read; infinite when nothing was ever read."""
    why: str = ""
    """One line for people when the quality is not good."""
    in_doubt: bool = False
    """The newest readings are bad, and too few to act on: what hangs on this point stays as it is until it is one
    thing or the other."""
    believed: float | None = None
    """While in doubt, the last value that was believed."""

    @property
    def says_yes(self) -> bool:
        """A flag that is set, beyond doubt."""
        return self.quality is Quality.GOOD and self.value is not None and self.value >= 0.5


MISSING = Value(None, Quality.MISSING, float("inf"), "never read")


@dataclass(frozen=True, slots=True)
class Senseless:
    """A unit, or several, that nothing may be written to, as what is read there is not what the map says."""

    points: frozenset[str]
    """All that it holds."""
    what: str
    """What is wrong with it, as the beginning of a sentence."""
    question: str
    """What people should ask themselves."""


@dataclass(frozen=True, slots=True)
class Image:
    """All values of one cycle by point name; a point that is not there reads as missing through `value_of`."""

    monotonic: float
    """Seconds on the daemon's own clock, which never jumps."""
    true_time: float | None
    """Seconds since 1970 UTC; None while the clock cannot be trusted."""
    values: Mapping[str, Value] = field(default_factory=lambda: MappingProxyType({}))
    link_ok: bool = True
    """At least one unit answers."""
    silent: Mapping[str, frozenset[str]] = field(default_factory=lambda: MappingProxyType({}))
    """The units that were asked and did not answer, each with its points."""
    interrupted: Mapping[str, frozenset[str]] = field(default_factory=lambda: MappingProxyType({}))
    """The units that did not answer each of these requests, or none, each with its points."""

    senseless: Mapping[str, Senseless] = field(default_factory=lambda: MappingProxyType({}))
    """The units whose numbers make no sense or are another one's, so that nothing may be written there."""

    def value_of(self, name: str) -> Value:
        """Return the value of a point, `MISSING` for a point that this plant does not have."""
        return self.values.get(name, MISSING)

    def answers(self, name: str) -> bool:
        """Tell whether the unit that holds a point answers."""
        return self.link_ok and not any(name in points for points in self.silent.values())

    def makes_sense(self, name: str) -> bool:
        """Tell whether what the unit that holds a point says can be understood."""
        return not self.why_senseless(name)

    def why_senseless(self, name: str) -> str:
        """Return what is wrong with the unit that holds a point; empty where it is understood."""
        return next((unit.what for unit in self.senseless.values() if name in unit.points), "")

    def reaches(self, name: str) -> bool:
        """Tell whether the unit that holds a point answers and is understood: whether it may be written to."""
        return self.answers(name) and self.makes_sense(name)
