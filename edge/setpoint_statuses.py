"""How each setpoint stands after a cycle, as the status page shows it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from igrow.core.quantities import with_unit
from igrow.core.separating_tests.definition import SOURCE
from igrow.edge.guard import GuardState, Verdict
from igrow.edge.image import Image, Quality, Value
from igrow.edge.ports import SetpointStatus
from igrow.edge.sources import Choice


def setpoint_statuses(
    points: Iterable[str],
    choices: Mapping[str, Choice],
    image: Image,
    verdict: Verdict,
    state: GuardState,
    held: Mapping[str, float],
) -> dict[str, SetpointStatus]:
    """Return the status of each point; `held` maps those that a hand has set to the seconds that it is respected.

    `state` is what the guard remembers after the cycle.
    """
    forced = {clamp.point: clamp.reason for clamp in verdict.clamps if clamp.kind == "interlock"}
    statuses = {}
    for name in points:
        choice, memory = choices.get(name), state.points.get(name)
        status = SetpointStatus(
            requested=choice.value if choice else None,
            applied=memory.written if memory else None,
            shown=image.value_of(name).value,
            source=choice.source if choice else "",
            why=choice.why if choice else "",
            held_until=image.monotonic + held[name] if name in held else None,
        )
        if name in forced:
            status = replace(status, source="interlock", why=forced[name])
        elif choice is None and memory is not None and memory.taken is not None:
            status = replace(
                status,
                source=SOURCE if memory.taken_by == SOURCE else "interlock",
                why=f"on its way back to {with_unit(name, memory.taken)}",
            )
        statuses[name] = status
    return statuses


def marks_of_tests(choices: Mapping[str, Choice], state: GuardState) -> Mapping[str, Value]:
    """Return what tells a separating test in the log: its course, and the way back from it."""
    moves = any(choice.source == SOURCE for choice in choices.values())
    returns = any(memory.taken_by == SOURCE for memory in state.points.values())
    return {SOURCE: Value(float(moves or returns), Quality.GOOD, 0.0)}
