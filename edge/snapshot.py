"""What the status page shows, put together once in each cycle."""

from __future__ import annotations

from collections.abc import Iterable

from igrow.edge.cycle_result import CycleResult
from igrow.edge.journal import Journal
from igrow.edge.ports import Snapshot
from igrow.edge.services import Services
from igrow.edge.wiring import Control


def snapshot_of(
    control: Control, result: CycleResult, services: Services, journal: Journal, cycles: int, problems: Iterable[str]
) -> Snapshot:
    """Return the snapshot after a cycle; `problems` are the daemon's own, beside those of its services."""
    image, schedule, plan = result.image, control.schedule, control.keeper.plan
    found = [
        services.store.health,
        control.override.problem,
        services.planning.health if services.planning is not None else "",
        schedule.problem if schedule is not None else "",
        plan.problem if plan is not None else "",
        services.updates.health,
        services.exchange.health if services.exchange is not None else "",
        services.status.health,
        *problems,
    ]
    rules, points = control.configuration.guard_rules.points, control.cycle.state.points
    return Snapshot(
        site=control.configuration.site.name,
        time=image.true_time,
        monotonic=image.monotonic,
        clock_ok=image.true_time is not None,
        cycle=cycles,
        cycle_seconds=result.seconds,
        link_ok=image.link_ok,
        source=result.decision.source,
        why=result.decision.why,
        values=image.values,
        setpoints=result.setpoints,
        clamps=tuple(journal.clamps),
        alarms=journal.alarms.active,
        plan=plan,
        bundle=services.updates.describe(),
        problems=tuple(filter(None, found)),
        separating_test=control.separating_tests.describe(),
        writes_left={
            name: rule.daily_budget - len(points[name].budget)
            for name, rule in rules.items()
            if rule.daily_budget is not None and name in points
        },
    )
