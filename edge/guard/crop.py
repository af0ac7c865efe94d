"""What the crop's limits leave of a cycle's requests: `igrow.core.agronomy` at the plant, whoever leads it.

A plan keeps these limits by itself; the recipe, an old plan or a plan that waits for a hand may not. The grower's own
override passes, and so does the stop: a hand knows the crop better than a table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from igrow.core import agronomy
from igrow.core.agronomy import Memory, Place
from igrow.edge.image import Image
from igrow.edge.sensors.consequences import usable_for_control

EXEMPT = ("override", "hand", "stop")
SHORTEST, LONGEST = 60.0, 900.0
"""Seconds that a decision is taken for, at least and at most."""
DARK_CLOCK = "the clock is wrong, so nobody knows how long the night still is"


@dataclass(frozen=True, slots=True)
class CropMemory:
    """What the crop has had, and how the daemon's clock stands to the true one."""

    had: Memory = field(default_factory=Memory)
    offset: float | None = None
    """Seconds since 1970 UTC less monotonic seconds, as last trusted."""
    at: float | None = None
    """Monotonic seconds until which `had` counts."""


def observed(place: Place, memory: CropMemory, image: Image, standing: Mapping[str, float | None]) -> CropMemory:
    """Return the memory with what stood since the last cycle; an unknown lamp may have burned."""
    offset = memory.offset if image.true_time is None else image.true_time - image.monotonic
    had, now = memory.had, image.monotonic
    if memory.at is not None and offset is not None and now > memory.at:
        stood = {name: value for name, value in standing.items() if value is not None and math.isfinite(value)}
        if standing.get("lamp_on", 0.0) is None:
            stood["lamp_on"] = 1.0
        radiation = usable_for_control(image.value_of("global_radiation")) or 0.0
        begin = agronomy.moment(place, memory.at + offset)
        passed = min(now - memory.at, 86_400.0) / 3600.0
        had = agronomy.observe(had, place, begin, stood, passed, place.sunlight(radiation))
    return CropMemory(had, offset, now)


def held(
    place: Place, memory: CropMemory, now: float, passed: float, wanted: Mapping[str, float]
) -> Mapping[str, tuple[float, str]]:
    """Return what becomes of the wanted setpoints that a limit of the crop changes, each with the limits' names.

    `now` in monotonic seconds, `passed` in seconds since the last decision.
    """
    if memory.offset is None:
        lit = wanted.get("lamp_on", 0.0) > 0.0
        return {"lamp_on": (0.0, DARK_CLOCK)} if lit else {}
    moment = agronomy.moment(place, now + memory.offset)
    hours = min(max(passed, SHORTEST), LONGEST) / 3600.0
    result = agronomy.hold(place, memory.had, moment, wanted, hours)
    changed = {name: result.limits(name) for name in result.binding}
    return {
        name: (float(result.setpoints[name]), f"the crop's {' and '.join(limits)}") for name, limits in changed.items()
    }


def restored(memory: Memory) -> CropMemory:
    """Return the memory to begin with, from what a log says that the crop has had."""
    return replace(CropMemory(), had=memory)
