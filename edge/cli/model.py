"""`igrow-edge model`: the bundles of this gateway, the step of adoption of each, and the operator's word on them."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from igrow.core.bundle import BundleError, read_bundle
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.updates.state import UpdateState, load_state
from igrow.edge.updates.wishes import Wishes, pin, read_wishes, take_back, unpin

EXAMPLE = "igrow-edge model pin /etc/igrow/daemon.yaml"

_ACTIONS = {
    "list": "show the bundles and what became of them",
    "pin": "keep the bundle in force: no update replaces it, until `unpin`",
    "unpin": "let updates replace the bundle in force again",
    "back": "go back to the earlier bundle; the one in force is never tried again",
}
_DONE: dict[str, Callable[[Path, UpdateState], Wishes]] = {
    "pin": pin,
    "unpin": lambda folder, _: unpin(folder),
    "back": take_back,
}
_SAID = {
    "pin": "{active} is pinned: no update replaces it",
    "unpin": "{active} is not pinned: the next update may replace it, after its shadow run",
    "back": "{previous} takes the place of {active} as soon as the daemon runs its next cycles",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's actions."""
    actions = parser.add_subparsers(title="actions", dest="action", metavar="ACTION", required=True)
    for name, meaning in _ACTIONS.items():
        add_configuration(actions.add_parser(name, help=meaning, description=meaning.capitalize() + "."))


def run(options: argparse.Namespace) -> int:
    """Print a line for each bundle, or leave a wish for the daemon, which sees it while it runs or when it starts."""
    configuration = configuration_of(options)
    folder = configuration.state_folder / "updates"
    state = load_state(folder / "state.json")
    if options.action == "list":
        lines = describe(state, folder / "bundles", read_wishes(folder))
        if not lines and configuration.bundle_folder is not None:
            lines = [f"no bundle yet: the daemon begins with the one in {configuration.bundle_folder}"]
        print(*lines or ["no bundle: the grower's recipe rules"], sep="\n")
        return 0
    _DONE[options.action](folder, state)
    print(_SAID[options.action].format(active=state.active or "no bundle", previous=state.previous))
    return 0


def describe(state: UpdateState, shelf: Path, wishes: Wishes | None = None) -> list[str]:
    """Return a line for each bundle: its step, identity, label, and what was said of it."""
    wishes = wishes or Wishes()
    lines = []
    steps = (
        (state.active, _step_of_active(state, wishes)),
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
    return lines


def _step_of_active(state: UpdateState, wishes: Wishes) -> str:
    if wishes.taken_back == state.active and state.previous is not None:
        return "in force, to go back"
    if wishes.pinned == state.active:
        return "in force, pinned"
    return "in force, on probation" if state.watch_since is not None else "in force"
