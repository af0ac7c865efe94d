"""Interlocks: conditions under which a point is forced between bounds, whatever anyone asks for.

They stand in order of precedence. When two force the same point apart, the earlier one wins: wind comes before
everything else, since a broken vent cannot be mended by a good climate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from igrow.core.errors import IgrowError
from igrow.core.quantities import with_unit
from igrow.edge.image import Image
from igrow.edge.sensors.consequences import usable_for_control

SAFE = "safe"
"""A bound that stands for the point's own safe value."""


class InterlockError(IgrowError):
    """An interlock that can never let go, or whose numbers are none."""


@dataclass(frozen=True, slots=True)
class Bound:
    """What an engaged interlock leaves to one point; None leaves that side open."""

    low: float | str | None = None
    high: float | str | None = None

    def __post_init__(self) -> None:
        numbers = [bound for bound in (self.low, self.high) if isinstance(bound, int | float)]
        if not all(map(math.isfinite, numbers)):
            raise InterlockError(f"bounds of {self.low} to {self.high} bound nothing: finite numbers are needed")
        if len(numbers) == 2 and numbers[0] > numbers[1]:
            raise InterlockError(f"low is {self.low:g}: it must not be above high, {self.high:g}")

    def limits(self, safe: float) -> tuple[float, float]:
        """Return the bounds as numbers."""
        low = safe if isinstance(self.low, str) else self.low
        high = safe if isinstance(self.high, str) else self.high
        return (-float("inf") if low is None else low, float("inf") if high is None else high)


@dataclass(frozen=True)
class Interlock:
    """Engages when `quantity` passes `above` or `below`, lets go when it is back beyond `release`."""

    name: str
    quantity: str
    bounds: Mapping[str, Bound]
    above: float | None = None
    below: float | None = None
    release: float = 0.0
    when_unknown: Mapping[str, Bound] = field(default_factory=lambda: MappingProxyType({}))
    """Bounds while the quantity cannot be believed; empty means that nothing is forced then."""
    why: str = ""

    def __post_init__(self) -> None:
        if (self.above is None) == (self.below is None):
            raise InterlockError(f"interlock {self.name}: give either above or below")
        if not all(math.isfinite(x) for x in (self.above, self.below, self.release) if x is not None):
            raise InterlockError(f"interlock {self.name}: above, below and release must be finite numbers")
        if self.above is not None and self.release > self.above:
            raise InterlockError(f"interlock {self.name}: release {self.release:g} must be at or under {self.above:g}")
        if self.below is not None and self.release < self.below:
            raise InterlockError(f"interlock {self.name}: release {self.release:g} must be at or over {self.below:g}")

    def engages(self, value: float, engaged: bool) -> bool:
        """Tell whether it is engaged at this value, given whether it was."""
        if self.above is not None:
            return value > self.above or (engaged and value > self.release)
        assert self.below is not None
        return value < self.below or (engaged and value < self.release)

    def sentence(self, value: float) -> str:
        """Return why it is engaged, at this value."""
        bound = self.above if self.above is not None else self.below
        assert bound is not None
        limit = with_unit(self.quantity, bound)
        side = f"above {limit}" if self.above is not None else f"below {limit}"
        return f"{self.quantity} {with_unit(self.quantity, value)}, {side}"


@dataclass(frozen=True, slots=True)
class Force:
    """An interlock at work in this cycle."""

    name: str
    bounds: Mapping[str, Bound]
    why: str


def evaluate(
    interlocks: tuple[Interlock, ...], image: Image, engaged: frozenset[str]
) -> tuple[list[Force], frozenset[str]]:
    """Return what is forced now, in order of precedence, and which interlocks are engaged.

    An interlock whose quantity this plant does not measure at all is left out: it was never there to rely on. One
    whose quantity is in doubt forces nothing new (`in_doubt`).
    """
    forces: list[Force] = []
    now: set[str] = set()
    for interlock in interlocks:
        if interlock.quantity not in image.values:
            continue
        reading = image.values[interlock.quantity]
        value = usable_for_control(reading)
        if value is None:
            if interlock.when_unknown and not reading.in_doubt:
                why = f"{interlock.quantity} is {reading.quality.value}"
                forces.append(Force(interlock.name, interlock.when_unknown, why))
            # What was engaged before the sensor failed stays remembered until the sensor says otherwise.
            if interlock.name in engaged:
                now.add(interlock.name)
                forces.append(Force(interlock.name, interlock.bounds, f"engaged before {interlock.quantity} failed"))
        elif interlock.engages(value, interlock.name in engaged):
            now.add(interlock.name)
            forces.append(Force(interlock.name, interlock.bounds, interlock.sentence(value)))
    return forces, frozenset(now)


def in_doubt(interlocks: tuple[Interlock, ...], image: Image) -> Mapping[str, str]:
    """Return the points that stay where they are, and why: a sensor may have failed, and it is too early to act on it.

    These are the points that its interlock would force if it had failed, and points whose own reading is in doubt.
    """
    doubts = {name: f"{name}: {value.why}" for name, value in image.values.items() if value.in_doubt}
    points = dict(doubts)
    for interlock in interlocks:
        if interlock.quantity in doubts:
            points.update(dict.fromkeys(interlock.when_unknown, doubts[interlock.quantity]))
    return points


DEFAULT_INTERLOCKS: tuple[Interlock, ...] = (
    Interlock(
        "wind",
        "wind_speed",
        {"vent_wind": Bound(high=0.0), "vent_lee": Bound(high=10.0)},
        above=15.0,
        release=12.0,
        when_unknown={"vent_wind": Bound(high=0.0), "vent_lee": Bound(high=20.0)},
        why="a storm breaks open vents",
    ),
    Interlock(
        "wind_alarm",
        "wind_alarm",
        {"vent_wind": Bound(high=0.0), "vent_lee": Bound(high=10.0)},
        above=0.5,
        release=0.5,
        why="the PLC itself closes the vents against the wind",
    ),
    Interlock(
        "rain_alarm",
        "rain_alarm",
        {"vent_wind": Bound(high=10.0)},
        above=0.5,
        release=0.5,
        why="rain through the windward vents wets the crop",
    ),
    Interlock(
        "rain",
        "rain",
        {"vent_wind": Bound(high=10.0)},
        above=0.5,
        release=0.1,
        why="rain through the windward vents wets the crop",
    ),
    Interlock(
        "frost",
        "air_temperature",
        {
            "heating_setpoint": Bound(low=SAFE),
            "ventilation_setpoint": Bound(low=SAFE),
            "vent_lee": Bound(high=0.0),
            "vent_wind": Bound(high=0.0),
            "irrigation_on": Bound(high=0.0),
        },
        below=8.0,
        release=10.0,
        when_unknown={
            "heating_setpoint": Bound(low=SAFE, high=SAFE),
            "ventilation_setpoint": Bound(low=SAFE, high=SAFE),
            "minimum_pipe_setpoint": Bound(high=SAFE),
            "lamp_on": Bound(high=SAFE),
        },
        why="cold damages the crop; without a believable temperature the safe setpoint rules",
    ),
    Interlock(
        "heat",
        "air_temperature",
        {
            "heating_setpoint": Bound(high=SAFE),
            "ventilation_setpoint": Bound(high=SAFE),
            "minimum_pipe_setpoint": Bound(high=SAFE),
            "lamp_on": Bound(high=0.0),
        },
        above=38.0,
        release=34.0,
        why="lamps and pipes may not add to a greenhouse that is too hot",
    ),
    Interlock(
        "humidity",
        "air_humidity",
        {
            "irrigation_on": Bound(high=0.0),
            "heating_setpoint": Bound(low=SAFE),
            "humidity_setpoint": Bound(high=SAFE),
        },
        above=97.0,
        release=93.0,
        why="a wet crop gets fungi: no more water, and not less heat than the safe setpoint",
    ),
    Interlock(
        "co2",
        "air_co2",
        {"co2_setpoint": Bound(high=SAFE)},
        above=2000.0,
        release=1500.0,
        when_unknown={"co2_setpoint": Bound(high=SAFE)},
        why="too much carbon dioxide harms people, and without a believable sensor nobody would see it",
    ),
)
"""The interlocks of a site that names none of its own. A point that a plant does not let us write is passed over."""
