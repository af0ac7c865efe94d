"""What control carries over: from the run before a restart, and from itself before a reload."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.core import agronomy
from igrow.edge.earlier import Earlier
from igrow.edge.guard.core import DAY, with_earlier_writes
from igrow.edge.guard.crop import restored
from igrow.edge.moment import Moment
from igrow.edge.remembering import registers_of
from igrow.edge.wiring import Control


def log_to_remember(control: Control) -> float:
    """Return how many seconds of the log `remember` needs."""
    return 2 * DAY if control.configuration.guard_rules.crop is not None else 0.0


def remember(control: Control, earlier: Earlier) -> None:
    """Carry over what a restart must not forget.

    Hands that are respected, intervals, interlocks, what the crop has had, and writes of the last day.

    To be called when the clock was first read. A write whose age cannot be known counts as just done.
    """
    control.clock.recall(earlier.time)
    now = Moment(control.boot, control.clock.monotonic(), control.clock.true_time())
    rules = control.configuration.guard_rules
    respect_hand = control.configuration.file.cycle.respect_hand.total_seconds()
    ledgers_time = control.notes.recall(control.cycle, earlier.state, now, respect_hand=respect_hand)
    if rules.crop is not None and now.time is not None:
        first, last = (np.datetime64(int(time), "s") for time in (now.time - 2 * DAY, now.time))
        had = restored(agronomy.remember(rules.crop, earlier.log.select(first, last), now.time))
        control.cycle.state = replace(control.cycle.state, crop=had)
    times: dict[str, list[float]] = {}
    for record in earlier.writes:
        rule = rules.points.get(record.point)
        if rule is not None and rule.daily_budget is not None:
            age = 0.0 if ledgers_time is None or record.time is None else max(0.0, ledgers_time - record.time)
            times.setdefault(record.point, []).append(now.monotonic - age)
    control.cycle.state = with_earlier_writes(control.cycle.state, times)


def carry_over(control: Control, before: Control) -> None:
    """Let control go on where it stood before a reload, for all points that still mean the same register."""
    old, new = before.configuration.register_map, control.configuration.register_map
    was = registers_of(old, old.points)
    now = registers_of(new, new.points)
    control.cycle.carry_over(before.cycle, [name for name, register in now.items() if was.get(name) == register])
    points, earlier = control.cycle.readback.points, before.cycle.readback.points
    # A line that is taken out and put in again, by whoever edits the files, must not cost a hand.
    left_out = {**before.left_out, **{name: (was[name], memory) for name, memory in earlier.items()}}
    for name, (register, memory) in left_out.items():
        if name not in points:
            control.left_out[name] = register, memory
        elif name not in earlier and register == now[name]:
            points[name] = memory
