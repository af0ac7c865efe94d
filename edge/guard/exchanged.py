"""Two units that have changed places: each shows what stood in the other one's setpoints.

Somebody has exchanged two controllers of one make, their numbers or their addresses, or a gateway mixes them up. What
is written to one would then change the other. No hand looks like that: all setpoints of a unit that can be told apart
show, to the last digit, what was last known of the other unit, or its safe values, where it has fallen back meanwhile.

One unit may be read before they change places and the other one after it. So what looks like another unit waits until
that one was read as well: where it still is itself, it was a hand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from igrow.edge.guard.answers import matches
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image, Quality, Senseless, Value
from igrow.edge.registers.look_alikes import Counterpart, LookAlikes

LONGEST = 60.0
"""Seconds for which one number of another unit, which a hand may have set, waits for that unit to answer."""
CERTAIN = 2
"""Numbers of another unit that nobody sets by hand; one that is outside the limits counts for two."""
QUESTION = "were the units, their numbers or their addresses exchanged?"


@dataclass(frozen=True, slots=True)
class _Likeness:
    """How far a unit looks like itself, and how far like another one."""

    own: int
    """Setpoints that show what is known of them, and not what is known of the other unit."""
    weight: int
    """How much those that show the other unit's say."""
    strange: int
    """Those that show neither, or nothing."""
    read_at: float
    """When the first of them was read."""

    @property
    def is_other(self) -> bool:
        return self.weight > 0 and not self.own and not self.strange

    @property
    def is_itself(self) -> bool:
        return self.own > 0 and not self.weight


@dataclass(slots=True)
class _Seen:
    """A unit that looks like another one."""

    since: float
    certain: bool = False
    refuted: bool = False
    """The other one was seen in its own place since."""


class Exchanged:
    """Remembers which units show another one's setpoints; reads what the read-back knows of them."""

    def __init__(
        self,
        rules: Mapping[str, PointRule],
        points: Mapping[str, PointMemory],
        units: Mapping[str, str],
        look_alikes: LookAlikes,
    ) -> None:
        """`points` is what is remembered by now, `units` maps points to the unit that holds them."""
        self._rules = rules
        self._points = points
        self._units = units
        self._look_alikes = look_alikes
        self._seen: dict[tuple[str, str], _Seen] = {}
        self._misread: dict[str, tuple[float, str]] = {}
        """By point: until when it was read from another unit, and what to say of that."""
        self.wanted: set[str] = set()
        """What is to be read to tell whether two units have changed places."""

    def judge(self, image: Image) -> Image:
        """Return the image in which units that have changed places are not understood, nor what they show believed."""
        likeness = {pair: self._likeness(counterparts, image) for pair, counterparts in self._look_alikes.items()}
        held = [pair for pair in likeness if self._holds(pair, likeness, image.monotonic)]
        self.wanted = {
            one.other.name for pair in held if not self._seen[pair].certain for one in self._look_alikes[pair]
        }
        senseless = dict(image.senseless)
        for unit, other in held:
            what = f"unit {unit} shows the setpoints of unit {other}"
            if (other, unit) in held:
                what = f"units {min(unit, other)} and {max(unit, other)} show each other's setpoints"
            points = frozenset(name for name in image.values if self._units.get(name, "") in (unit, other))
            senseless[" and ".join(sorted((unit, other)))] = Senseless(points, what, QUESTION)
            if self._seen[unit, other].certain:
                self._misread |= dict.fromkeys(points, (image.monotonic, what))
        return replace(image, values=self._believed(image), senseless=senseless)

    def _believed(self, image: Image) -> Mapping[str, Value]:
        """Return the values, of which those that another unit has shown are not believed."""
        values = dict(image.values)
        for name, (until, what) in self._misread.items():
            value = values[name]
            if value.quality is not Quality.MISSING and image.monotonic - value.age <= until:
                values[name] = replace(value, quality=Quality.IMPLAUSIBLE, why=what, in_doubt=False)
        return values

    def _holds(self, pair: tuple[str, str], likeness: Mapping[tuple[str, str], _Likeness], now: float) -> bool:
        """Tell whether the first unit of a pair is, or may be, the second one."""
        mine, theirs = likeness[pair], likeness[pair[::-1]]
        seen = self._seen.setdefault(pair, _Seen(now)) if mine.is_other else self._seen.get(pair)
        if seen is None:
            return False
        seen.refuted |= theirs.is_itself and theirs.read_at > seen.since + 1e-6
        seen.certain |= mine.is_other and (mine.weight >= CERTAIN or theirs.is_other)
        holds = not seen.refuted and (seen.certain or now - seen.since <= LONGEST)
        if mine.is_itself or not (mine.is_other or (holds and seen.certain)):
            del self._seen[pair]
            return False
        return holds

    def _likeness(self, counterparts: Iterable[Counterpart], image: Image) -> _Likeness:
        own = weight = strange = 0
        read_at = image.monotonic
        for one in counterparts:
            value, rule = image.value_of(one.point.name), self._rules[one.point.name]
            if value.value is None or value.quality in (Quality.MISSING, Quality.STALE):
                strange += 1
                continue
            read_at, shown = min(read_at, image.monotonic - value.age), value.value
            is_own = any(matches(rule, shown, known) for known in self._known(one.point.name))
            others = (one.would_show(known) for known in self._known(one.other.name))
            is_others = any(known is not None and rule.same(shown, known) for known in others)
            if is_own == is_others:
                strange += not is_own
            elif is_own:
                own += 1
            elif not rule.low <= shown <= rule.high:
                weight += CERTAIN * (shown != 0.0)
            else:
                # Nothing, and the ends of a range, are what memory holds at a start and where switches stand.
                weight += shown not in (0.0, rule.low, rule.high)
        return _Likeness(own, weight, strange, read_at)

    def _known(self, name: str) -> set[float]:
        """Return what a setpoint would show if its unit is itself."""
        memory = self._points[name]
        sent = (one.value for one in (*memory.sent, *memory.late))
        known = (memory.stands, memory.answers, memory.hand, *sent, self._rules[name].safe)
        return {value for value in known if value is not None}
