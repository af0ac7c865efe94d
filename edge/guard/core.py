"""The guard's decision as a pure function: what is asked for, what was written, what is measured -> what to write.

For each point, in this order:

1. while somebody operates the PLC by hand (`plc_manual`), nothing is written, by nobody;
2. a request that is no number is refused;
3. the crop's limits bring it to the nearest value that leaves none (`igrow.edge.guard.crop`);
4. absolute limits cut it;
5. slew lets a ramp run towards it;
6. interlocks force it between their bounds at once, the earlier interlock first, also when only the ramp, or what
   stands in the PLC, is outside them; what they took from a point that no source decides they give back;
7. a change by hand at the PLC is left alone while it is respected, and so is a point whose sensor has just shown
   something that may be a fault (an interlock still comes first);
8. dead band, minimum interval and daily budget say whether this is the moment to write.

Invariants, tested with arbitrary input: a write never leaves the limits; two writes never differ by more than the
slew allows for the time between them, unless an interlock, the stop or a hand at the PLC moved the point in
between; no 24 h see more writes than the budget.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from igrow.edge.guard import crop
from igrow.edge.guard.crop import CropMemory
from igrow.edge.guard.interlocks import evaluate, in_doubt
from igrow.edge.guard.point import DAY, PointInCycle, Standstill
from igrow.edge.guard.rules import GuardRules
from igrow.edge.guard.state import (
    Clamp,
    GuardState,
    PointState,
    Request,
    Verdict,
    Write,
    begin_again,
    go_on,
    never_sent,
    postponed,
    with_earlier_writes,
)
from igrow.edge.image import Image

__all__ = [
    "DAY",
    "Clamp",
    "GuardState",
    "PointState",
    "Request",
    "Verdict",
    "Write",
    "begin_again",
    "go_on",
    "guard",
    "never_sent",
    "postponed",
    "with_earlier_writes",
]

LONGEST_RAMP = 900.0
"""A ramp never makes up for more than this many seconds at once, however long the daemon was away."""


def guard(
    requests: Mapping[str, Request],
    shown: Mapping[str, float | None],
    held: Mapping[str, float],
    image: Image,
    state: GuardState,
    rules: GuardRules,
    *,
    stopping: bool = False,
    manual: bool = False,
) -> Verdict:
    """Decide what to write now.

    `shown` is what stands in the PLC as far as we know (None: unknown); `held` maps points that somebody changed
    by hand to the seconds that this is still respected (0: it is not known yet whether it was a hand). With
    `stopping` every point that a source decides goes to its safe value at once, without slew, dead band or interval,
    as the PLC's own fallback would do it; a hand keeps its point, and an interlock gives back what it took. With
    `manual` nothing is written at all.
    """
    now = image.monotonic
    forces, engaged = evaluate(rules.interlocks, image, state.engaged)
    doubts = {} if stopping else in_doubt(rules.interlocks, image)
    passed = 0.0 if state.at is None else min(max(0.0, now - state.at), LONGEST_RAMP)
    writes: list[Write] = []
    clamps: list[Clamp] = []
    points: dict[str, PointState] = {}
    requests, had = _for_the_crop(requests, shown, image, state, rules, passed, clamps)
    for name, rule in rules.points.items():
        request = Request(rule.safe, "stop") if stopping and rule.decided else requests.get(name)
        if request is not None and not math.isfinite(request.value):
            clamps.append(Clamp(name, None, None, "the request is not a finite number", "refused", request.source))
            request = None
        memory = state.points.get(name, PointState())
        point = PointInCycle(name, rule, memory, shown.get(name), now, passed, writes, clamps)
        if manual:
            points[name] = point.left_alone(request, "somebody operates the PLC by hand: nothing is written")
        else:
            points[name] = point.decide(request, forces, _standstill(name, held, doubts), stopping=stopping)
    writes.sort(key=lambda write: not write.urgent)
    return Verdict(tuple(writes), tuple(clamps), GuardState(points, engaged, now, had), tuple(forces))


def _for_the_crop(
    requests: Mapping[str, Request],
    shown: Mapping[str, float | None],
    image: Image,
    state: GuardState,
    rules: GuardRules,
    passed: float,
    clamps: list[Clamp],
) -> tuple[Mapping[str, Request], CropMemory]:
    """Return the requests as the crop's limits leave them, and what the crop has had by now."""
    if rules.crop is None:
        return requests, state.crop
    standing = {name: shown.get(name) for name in rules.points}
    ramp = state.points.get("heating_setpoint", PointState()).ramp
    if ramp is not None:
        # The drift of the crop counts from where the ramp is, not from what was worth a write.
        standing["heating_setpoint"] = ramp
    had = crop.observed(rules.crop, state.crop, image, standing)
    asked = {
        name: request.value
        for name, request in requests.items()
        if request.source not in crop.EXEMPT and math.isfinite(request.value)
    }
    changed = dict(requests)
    for name, (value, reason) in crop.held(rules.crop, had, image.monotonic, passed, asked).items():
        changed[name] = replace(requests[name], value=value)
        clamps.append(Clamp(name, asked[name], value, reason, "crop", requests[name].source))
    return changed, had


def _standstill(name: str, held: Mapping[str, float], doubts: Mapping[str, str]) -> Standstill | None:
    if name in held and held[name] <= 0.0:
        return Standstill("doubt", "it has changed at the PLC, and it is not known yet by whom")
    if name in held:
        return Standstill("hand", f"changed by hand at the PLC, respected for {held[name] / 60:.0f} min more")
    if name in doubts:
        return Standstill("doubt", doubts[name])
    return None
