"""From limits and registers to the guard's rules: what is allowed, cut to what each register can hold.

A register rounds. So that no rounding leaves the limits, these are first cut to values that the register shows
exactly; between two such values rounding stays between them.
"""

from __future__ import annotations

import math

from igrow.core.site import SetpointLimits
from igrow.edge.guard.heartbeat import HIGHEST_BEAT
from igrow.edge.guard.rules import GuardRuleError, PointRule
from igrow.edge.registers.codec import decode, encode
from igrow.edge.registers.model import DataType, Point

_FLOATS = (DataType.FLOAT32, DataType.FLOAT64)


def point_rule(limit: SetpointLimits, point: Point, daily_budget: int) -> PointRule:
    """Return the guard's rule of a point; raises GuardRuleError for limits that leave nothing of its register."""
    low = _representable(point, max(limit.low, point.low), upward=True)
    high = _representable(point, min(limit.high, point.high), upward=False)
    if not low <= high:
        raise GuardRuleError(
            f"{point.name}: limits {limit.low:g} to {limit.high:g} leave nothing of the register's {point.low:g} "
            f"to {point.high:g}; widen one of them"
        )
    if not low <= limit.safe <= high:
        raise GuardRuleError(
            f"{point.name}: the safe value {limit.safe:g} is outside what the register takes, {low:g} to {high:g}"
        )
    return PointRule(
        low=low,
        high=high,
        safe=limit.safe,
        slew=None if limit.slew is None else limit.slew / 3600.0,
        dead_band=limit.dead_band,
        minimum_interval=limit.minimum_interval.total_seconds(),
        # Half of the register's memory, so that one lost write does not let it revert.
        refresh=None if point.refresh is None else 0.5 * point.refresh,
        daily_budget=daily_budget if point.non_volatile else None,
        resolution=_resolution(point),
    )


def highest_beat(point: Point) -> int:
    """Return the largest number of the heartbeat's counter that its register tells from the one before.

    Raises GuardRuleError where the register cannot show a change.
    """
    high = min(point.high, float(HIGHEST_BEAT))
    beats = int(high) if math.isfinite(high) else 0
    if beats < 1 or point.low > 0.0 or abs(point.scale) > 1.0:
        raise GuardRuleError(
            f"heartbeat: {point.low:g} to {point.high:g} with scale {point.scale:g} cannot count 0, 1, ...: give it "
            "`low: 0`, a `high` of at least 1, and no scale"
        )
    return beats


def _resolution(point: Point) -> float:
    return 1e-6 if point.type in _FLOATS else abs(point.scale)


def _representable(point: Point, bound: float, *, upward: bool) -> float:
    """Return the nearest value on the allowed side of `bound` that the register shows exactly."""
    value = bound
    for _ in range(3):
        shown = decode(point, encode(point, value))
        if shown is None:
            break
        if shown >= bound if upward else shown <= bound:
            return shown
        # Half a step: from half-way between two values, which may be rounded either way, a whole one skips a value.
        step = 0.5 * _resolution(point) if point.type not in _FLOATS else max(abs(bound), 1e-30) * 2.0**-23
        value = value + step if upward else value - step
    return value
