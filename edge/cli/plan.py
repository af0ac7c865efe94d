"""`igrow-edge plan`: one plan, computed now and printed; nothing is written to the PLC."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

from igrow.core.co2_count import CO2Count
from igrow.core.errors import IgrowError
from igrow.core.planner.explain import WORDS, limits_in_force
from igrow.core.quantities import QUANTITIES
from igrow.edge.cli.common import add_configuration, configuration_of, parse_time
from igrow.edge.configuration import Configuration
from igrow.edge.planning.make_plan import make_plan
from igrow.edge.ports import Plan, PlanRequest
from igrow.edge.sources.recipe import recipe_course
from igrow.edge.store import read_event, read_telemetry
from igrow.edge.updates.state import load_state

EXAMPLE = "igrow-edge plan /etc/igrow/daemon.yaml --explain"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--bundle", type=Path, help="folder of a bundle (default: the one in force)")
    parser.add_argument("--explain", action="store_true", help="tell what each change is for, and which limit binds")
    parser.add_argument("--at", default=None, help="plan from this UTC time (default: the end of the log)")


def run(options: argparse.Namespace) -> int:
    """Compute and print."""
    configuration = configuration_of(options)
    plan = compute(configuration, options.bundle, options.at)
    print("\n".join(table(plan, configuration.zone)))
    if options.explain:
        print("\n".join(reasons(plan, configuration.zone)))
    return 0


def compute(configuration: Configuration, bundle: Path | None, at: str | None) -> Plan:
    """Return one plan from the stored log; raises IgrowError when log or bundle are missing."""
    settings, site = configuration.file.planning, configuration.site
    folder = bundle or _bundle_in_force(configuration) or configuration.bundle_folder
    if folder is None:
        raise IgrowError("no bundle is in force; name one with --bundle")
    log = read_telemetry(configuration.store_folder, 0.0, 8e9)
    if not len(log):
        raise IgrowError(f"{configuration.store_folder}: the log is empty, so there is nothing to plan from")
    now = parse_time(at) if at else float(log.time[-1].astype("datetime64[s]").astype(float))
    step = settings.step.total_seconds()
    start = now - now % step
    steps = round(site.planning.horizon.total_seconds() / step)
    request = PlanRequest(
        time=start,
        step_seconds=step,
        telemetry=read_telemetry(configuration.store_folder, now - settings.history.total_seconds(), now + 1.0),
        recipe=recipe_course(configuration.file.recipe, configuration.zone, start, step, steps),
        bundle=folder,
        forecast=configuration.forecast_file,
        seed=settings.seed,
        co2_counted=CO2Count.of_plan(read_event(configuration.store_folder, "plan")),
    )
    return make_plan(site, request)


def _bundle_in_force(configuration: Configuration) -> Path | None:
    updates = configuration.state_folder / "updates"
    identity = load_state(updates / "state.json").active
    return None if identity is None else updates / "bundles" / identity


def table(plan: Plan, zone: ZoneInfo) -> Iterator[str]:
    """Yield the plan for people, in the site's own time."""
    names = list(plan.setpoints)
    predicted = list(plan.predicted)
    yield f"simulator {plan.bundle}"
    yield f"expected  {plan.expected_profit:.4f} EUR m-2 by the plan, {plan.recipe_profit:.4f} by the recipe"
    if plan.leaves_range:
        yield "careful: this plan leaves the range of the data that the simulator was made from"
    yield from filter(None, (plan.note, plan.problem))
    heads = [f"{name} ({QUANTITIES[name].unit})" for name in names] + [f"-> {name}" for name in predicted]
    yield "  ".join(["time            ", *heads])
    for step in range(len(plan.setpoints[names[0]])):
        moment = datetime.fromtimestamp(plan.start + step * plan.step_seconds, zone)
        cells = [*(plan.setpoints[name][step] for name in names), *(plan.predicted[name][step] for name in predicted)]
        padded = (f"{cell:>{len(head)}.4g}" for cell, head in zip(cells, heads, strict=True))
        yield "  ".join([moment.strftime("%Y-%m-%d %H:%M"), *padded])


def reasons(plan: Plan, zone: ZoneInfo) -> Iterator[str]:
    """Yield what the plan is expected to bring, what each change is for and which limits bind."""
    explained = plan.explanation
    if plan.season:
        yield ""
        yield from plan.season
    if explained is not None:
        yield ""
        yield f"{'EUR m-2':12s}" + "".join(f"{WORDS.get(name, name):>12s}" for name in explained.plan)
        for head, amounts in (("plan", explained.plan), ("recipe", explained.recipe)):
            yield f"{head:12s}" + "".join(f"{amount.mean:12.4f}" for amount in amounts.values())
        low, high = explained.gain.interval
        yield f"gain {explained.gain.mean:+.4f}, 95 % between {low:+.4f} and {high:+.4f} by its own uncertainty"
        yield ""
        yield "What each change is for, EUR m-2, if it alone were taken back:"
        for change in explained.changes:
            yield f"  {change.sentence(zone)}"
        if not explained.changes:
            yield "  nothing is changed: the plan is the recipe"
    yield ""
    yield "Limits of the crop that bind:"
    bound = list(limits_in_force(plan.binding))
    for setpoint, limit, first, last in bound:
        begin, end = (datetime.fromtimestamp(plan.start + step * plan.step_seconds, zone) for step in (first, last + 1))
        yield f"  {begin:%a %H:%M} to {end:%a %H:%M}: {setpoint} by {limit}"
    if not bound:
        yield "  none"
