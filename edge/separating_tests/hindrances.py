"""What keeps a separating test from beginning, and what ends one that runs: pure functions of what a cycle showed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from igrow.core.agronomy import Place, moment
from igrow.core.quantities import with_unit
from igrow.core.separating_tests import SOURCE, Condition, SeparatingTest
from igrow.edge.alarm_levels import Level
from igrow.edge.cycle_result import CycleResult
from igrow.edge.image import Image
from igrow.edge.records import AlarmRecord
from igrow.edge.sensors.consequences import usable_for_control

ENDING_CLAMPS = frozenset({"crop", "limit", "interlock", "hand", "manual", "doubt", "refused", "budget"})
"""Clamps after which a course is not what the test says; slew and interval only delay it by minutes."""
FOLLOWS = 5.0
"""Opening in % by which a vent may be off what was written."""
FOLLOWS_AFTER = 900.0
"""Seconds that it has for it."""


def by_image(test: SeparatingTest, conditions: Iterable[Condition], image: Image, *, beginning: bool) -> str:
    """Return an empty text, or what the measurements say against the test."""
    if not image.link_ok:
        return "the PLC does not answer"
    for flag, text in (
        ("plc_manual", "somebody operates the PLC by hand"),
        ("plc_fallback", "the PLC has fallen back to its own safe setpoints"),
    ):
        if image.value_of(flag).says_yes:
            return text
    for point in test.points:
        if not image.answers(point):
            return f"{point} does not answer"
        if not image.makes_sense(point):
            return f"the numbers of the unit that holds {point} make no sense"
    for condition in conditions:
        if condition.if_measured and condition.quantity not in image.values:
            continue
        fault = condition.fault(usable_for_control(image.value_of(condition.quantity)), beginning=beginning)
        if fault:
            return fault
    return ""


def by_sun(test: SeparatingTest, place: Place, time: float) -> str:
    """Return an empty text, or that the test does not fit into what is left of this night or day."""
    now = moment(place, time)
    if now.sun_up != (test.when == "day"):
        return "it is no night" if test.when == "night" else "it is no day"
    if now.hours_to_change * 60.0 < test.minutes:
        night = test.when == "night"
        return "what is left of the night is too short" if night else "what is left of the day is too short"
    return ""


def by_cycle(test: SeparatingTest, result: CycleResult, alarms: Sequence[AlarmRecord]) -> str:
    """Return an empty text, or what hands, guard and alarms say against the test."""
    if any(choice.source == "override" for choice in result.decision.choices.values()):
        return "the grower has overridden a setpoint"
    if any(status.held_until is not None for status in result.setpoints.values()):
        return "somebody has changed a setpoint at the PLC"
    for force in result.verdict.engaged:
        return f"an interlock is engaged: {force.name}"
    for alarm in alarms:
        if alarm.level is not Level.NOTICE:
            return f"an alarm: {alarm.text}"
    for clamp in result.verdict.clamps:
        if clamp.point in test.points and clamp.source == SOURCE and clamp.kind in ENDING_CLAMPS:
            return f"the guard held {clamp.point} back: {clamp.reason}"
    return ""


def does_not_follow(test: SeparatingTest, result: CycleResult) -> str:
    """Return an empty text, or which point is elsewhere than the guard has put it."""
    for point in test.points:
        memory, shown = result.verdict.state.points.get(point), usable_for_control(result.image.value_of(point))
        if memory is None or memory.written is None or shown is None:
            continue
        waited = result.image.monotonic - memory.written_at
        if waited > FOLLOWS_AFTER and abs(shown - memory.written) > FOLLOWS:
            shows, wrote = with_unit(point, shown), with_unit(point, memory.written)
            return f"{point} shows {shows}, not the {wrote} that was written"
    return ""
