"""`igrow-edge model`: the bundles of this gateway, and the step of adoption that each has come to."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.core.bundle import BundleError, read_bundle
from igrow.edge.cli.common import DEFAULT_CONFIGURATION, configuration_of
from igrow.edge.updates.state import UpdateState, load_state

EXAMPLE = "igrow-edge model list"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's actions."""
    actions = parser.add_subparsers(title="actions", dest="action", metavar="ACTION", required=True)
    show = actions.add_parser("list", help="show the bundles and what became of them")
    show.add_argument("configuration", type=Path, nargs="?", default=DEFAULT_CONFIGURATION, help="the daemon's file")


def run(options: argparse.Namespace) -> int:
    """Print a line for each bundle."""
    folder = configuration_of(options).state_folder / "updates"
    for line in describe(load_state(folder / "state.json"), folder / "bundles"):
        print(line)
    return 0


def describe(state: UpdateState, shelf: Path) -> list[str]:
    """Return a line for each bundle: its step, identity, label, and what was said of it."""
    lines = []
    steps = (
        (state.active, "in force, on probation" if state.watch_since is not None else "in force"),
        (state.candidate, "in the shadow"),
        (state.previous, "previous"),
    )
    for identity, step in steps:
        if identity is None:
            continue
        try:
            bundle = read_bundle(shelf / identity)
            said = f"{bundle.label}, made {bundle.manifest.created:%Y-%m-%d} for {bundle.manifest.site}"
        except BundleError as error:
            said = str(error)
        lines.append(f"{step:<22}  {identity}  {said}")
    lines += [f"{'refused':<22}  {identity}  {reason}" for identity, reason in state.rejected.items()]
    return lines or ["no bundle: the grower's recipe rules"]
