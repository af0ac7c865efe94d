"""`igrow-edge status`: what a running daemon does and why, from its status endpoint."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.separating_tests import separating_tests_for
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.status.client import STATUS_FILE, fetch, last_state

EXAMPLE = "igrow-edge status /etc/igrow/daemon.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--port", type=int, help="the status port (default: the configuration's)")
    parser.add_argument("--json", action="store_true", help="print everything, for programs")


def run(options: argparse.Namespace) -> int:
    """Ask the daemon and print."""
    if options.port:
        state = fetch(options.port)
    else:
        configuration = configuration_of(options)
        try:
            state = fetch(configuration.file.status.port)
        except IgrowError as error:
            left = last_state(configuration.state_folder / STATUS_FILE)
            if left is None:
                raise
            print(f"{error}\nthe last state that it left:", file=sys.stderr)
            state = left
    if options.json:
        print(json.dumps(state, indent=1))
    else:
        print("\n".join(lines(state)))
    return 0


def lines(state: Mapping[str, Any]) -> Iterator[str]:
    """Yield the state for people."""
    when = "clock not trusted" if state["time"] is None else _date(state["time"])
    link = "PLC answers" if state["link_ok"] else "PLC DOES NOT ANSWER"
    yield f"{state['site']}: {when}, cycle {state['cycle']}, {link}"
    yield f"decides  {state['source']}: {state['why']}"
    for name, setpoint in state["setpoints"].items():
        held = "; changed by hand, respected" if setpoint["held_until"] is not None else ""
        yield (
            f"  {name:<22} asked {_number(setpoint['requested'])}, written {_number(setpoint['applied'])}, "
            f"PLC shows {_number(setpoint['shown'])}{_unit(name)} ({setpoint['source'] or 'nobody'}{held})"
        )
    yield "measured"
    for name, value in state["values"].items():
        if name in QUANTITIES and name not in state["setpoints"]:
            note = "" if value["quality"] == "good" else f"  {value['quality']}: {value['why']}"
            yield f"  {name:<22} {_number(value['value']):>8}{_unit(name)}{note}"
    plan = state.get("plan")
    if plan:
        expected, recipe = plan["expected_profit"], plan["recipe_profit"]
        yield f"plan     of {_date(plan['start'])}: {_number(expected)} EUR m-2 expected, the recipe {_number(recipe)}"
    bundle = state.get("bundle") or {}
    yield f"bundle   {bundle.get('name') or 'none'}"
    yield from _separating_test(state)
    for alarm in state["alarms"]:
        yield f"ALARM    {alarm['level']}: {alarm['text']}"
    for problem in state["problems"]:
        yield f"problem  {problem}"
    for clamp in list(state["clamps"])[:5]:
        applied = "nothing" if clamp["applied"] is None else _number(clamp["applied"])
        yield f"clamp    {clamp['point']}: asked {_number(clamp['requested'])}, applied {applied}: {clamp['reason']}"


def _separating_test(state: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the approved test stands, and which ones would tell apart what the diagnosis could not."""
    approved = state.get("separating_test") or {}
    if approved:
        ended, waits = approved["ended"], approved["waits_for"]
        how = "it runs" if approved["running"] else ended or f"it waits: {waits or 'the next cycle begins it'}"
        yield f"test     {approved['test']}, approved by {approved['by']}: {how}"
    for effects in (state.get("bundle") or {}).get("confounded", ()):
        for test in separating_tests_for(effects):
            yield f"test     {test.name} would tell {' from '.join(effects)} (igrow-edge separating-test)"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _unit(name: str) -> str:
    """Return the unit with a blank before it; nothing for a bare number."""
    unit = QUANTITIES[name].unit if name in QUANTITIES else "1"
    return "" if unit == "1" else f" {unit}"


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC")
