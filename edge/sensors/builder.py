"""Builds the process image of a cycle from raw readings, remembering per point what quality needs.

Order of the checks of one sensor: missing or stale (age), no number, out of range, frozen, rate. Pair checks run on
what is still good after that, then a twin sensor takes the place of a bad one. Last, a reading that is bad is believed
only when the next ones are bad as well (`igrow.edge.sensors.belief`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from igrow.core.quantities import with_unit
from igrow.edge.bus.errors import NoValueError, TurnedWordsError
from igrow.edge.image import MISSING, Image, Quality, Value
from igrow.edge.sensors.belief import Belief
from igrow.edge.sensors.contact import Contact, RawReading
from igrow.edge.sensors.pairs import PAIR_CHECKS, PairContext, TwinSensors, suspects
from igrow.edge.sensors.rules import SensorRule
from igrow.edge.sensors.sense import Sense, Shown

NO_NUMBER = "the register holds no number"


@dataclass(slots=True)
class _Track:
    """Memory of one point."""

    rule: SensorRule
    reading_at: float | None = None
    """The bus' time stamp of the newest answer; only compared, never subtracted."""
    value: float | None = None
    """None while the device says that it has no value."""
    read_at: float = -math.inf
    """When that answer first appeared, on the daemon's clock."""
    changed_at: float = -math.inf
    accepted: float | None = None
    """The last value that passed range and rate, and when."""
    accepted_at: float = -math.inf
    too_fast: bool = False
    error: str = ""
    turned: float | None = None
    """What it may mean while it holds a number only in the reverse order of its words."""
    belief: Belief = field(default_factory=Belief)


class ImageBuilder:
    """Makes one frozen image per cycle; times are the daemon's monotonic seconds."""

    def __init__(
        self,
        rules: Mapping[str, SensorRule],
        twins: Sequence[TwinSensors] = (),
        sun_elevation: Callable[[float], float] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> None:
        """`sun_elevation` maps seconds since 1970 UTC to degrees; without it light by night is not suspected.

        `units` maps points to the unit that holds them; without it there is one.
        """
        self._tracks = {name: _Track(rule) for name, rule in rules.items()}
        self._twins = tuple(twins)
        self._sun_elevation = sun_elevation
        self._contact = Contact(rules, units or {})
        self._sense = Sense(rules, units or {})

    def names(self, wanted: Collection[str]) -> list[str]:
        """Return those of the wanted points that there are."""
        return [name for name in wanted if name in self._tracks]

    def carry_over(self, before: ImageBuilder, names: Collection[str]) -> None:
        """Take what another builder knows of these points; the rules are our own."""
        for name in names:
            if name in self._tracks and name in before._tracks:
                track = before._tracks[name]
                track.rule = self._tracks[name].rule
                self._tracks[name] = track

    def build(self, readings: Mapping[str, RawReading], monotonic: float, true_time: float | None) -> Image:
        """Return the image of this cycle. `readings` may lack points that were not due."""
        news = {name for name, track in self._tracks.items() if _take(track, readings.get(name), monotonic)}
        values = {name: _judge(name, track, monotonic) for name, track in self._tracks.items()}
        sun = self._sun_elevation(true_time) if self._sun_elevation and true_time is not None else None
        for name, why in suspects(PAIR_CHECKS, PairContext(values, sun)):
            values[name] = _suspected(values[name], why)
        for twin in self._twins:
            twin.compare(values)
        for name, track in self._tracks.items():
            values[name] = track.belief.weigh(
                values[name], track.rule, monotonic, news=name in news, tried=name in readings
            )
        self._contact.hear(readings)
        contact = self._contact
        shown = {name: one for name, track in self._tracks.items() if (one := _shown(track, monotonic)) is not None}
        senseless = {**self._sense.judge(shown, monotonic), **contact.others}
        return Image(monotonic, true_time, values, contact.link_ok, contact.silent, contact.interrupted, senseless)


def _suspected(value: Value, why: str) -> Value:
    return Value(value.value, Quality.IMPLAUSIBLE, value.age, why)


def _take(track: _Track, reading: RawReading | None, now: float) -> bool:
    """Remember a reading; tell whether the point has answered anew."""
    if reading is None or reading.at == track.reading_at:
        return False
    if reading.value is None and not isinstance(reading.error, NoValueError):
        track.error = str(reading.error) if reading.error is not None else "no value"
        return False
    track.reading_at, track.error = reading.at, ""
    track.read_at = now
    track.turned = reading.error.number if isinstance(reading.error, TurnedWordsError) else None
    if reading.value is None:
        track.value, track.too_fast = None, False
        return True
    value = float(reading.value)
    # NaN never equals itself, so a sensor that reports NaN does not count as frozen but as out of range.
    if value != track.value:
        track.changed_at = now
    track.value = value
    rule = track.rule
    if not rule.holds(value):
        track.too_fast = False
    elif track.accepted is None or _possible(rule, value - track.accepted, now - track.accepted_at):
        track.accepted, track.accepted_at, track.too_fast = value, now, False
    else:
        track.too_fast = True
    return True


def _shown(track: _Track, now: float) -> Shown | None:
    """Return what a point shows as a number, if it was read lately."""
    if now - track.read_at > track.rule.missing_after:
        return None
    if track.turned is not None:
        return Shown(track.turned, turned=True)
    return None if track.value is None or not math.isfinite(track.value) else Shown(track.value)


def _possible(rule: SensorRule, change: float, seconds: float) -> bool:
    # Asked in this order, since no time at any speed is not a number.
    return abs(change) <= rule.jump or abs(change) <= rule.jump + rule.rate * seconds


def _judge(name: str, track: _Track, now: float) -> Value:
    value, rule = track.value, track.rule
    if track.reading_at is None:
        return Value(None, Quality.MISSING, math.inf, track.error or "never read") if track.error else MISSING
    age = now - track.read_at
    if value is not None and not math.isfinite(value):
        return Value(None, Quality.OUT_OF_RANGE, age, NO_NUMBER)
    if age > rule.missing_after:
        return Value(value, Quality.MISSING, age, f"no reading for {age:.0f} s{_because(track)}")
    if value is None:
        return Value(None, Quality.MISSING, age, NO_NUMBER)
    if age > rule.stale_after:
        return Value(value, Quality.STALE, age, f"last read {age:.0f} s ago{_because(track)}")
    shown = with_unit(name, value)
    if not rule.holds(value):
        low, high = with_unit(name, rule.low), with_unit(name, rule.high)
        return Value(value, Quality.OUT_OF_RANGE, age, f"{shown} is outside {low} to {high}")
    still = now - track.changed_at
    if still > rule.frozen_after and rule.still_low < value < rule.still_high:
        return Value(value, Quality.FROZEN, age, f"exactly {shown} for {still / 3600:.1f} h")
    if track.too_fast and track.accepted is not None:
        before = with_unit(name, track.accepted)
        return Value(value, Quality.IMPLAUSIBLE, age, f"moved from {before} to {shown} too fast")
    return Value(rule.cut(value), Quality.GOOD, age)


def _because(track: _Track) -> str:
    return f": {track.error}" if track.error else ""
