"""Overriding a setpoint, however the grower's word comes in: command line, page or MQTT. The guard's limits hold."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration
from igrow.edge.sources.override import RECIPE, Lease, read_leases, write_leases
from igrow.edge.state_file import alone_in

OVERRIDE_FILE = "override.json"


def override_file(state_folder: Path) -> Path:
    """Return where the grower's overrides are kept."""
    return state_folder / OVERRIDE_FILE


def override(
    configuration: Configuration,
    values: Mapping[str, float],
    seconds: float,
    give_back: Collection[str] = (),
    *,
    by: str,
    recipe: bool = False,
) -> dict[str, Lease]:
    """Override setpoints for some time, and give others back; a running daemon sees it in its next cycle.

    Args:
        configuration: of the daemon.
        values: by setpoint.
        seconds: how long they last.
        give_back: setpoints whose override ends now, or `RECIPE`: plans may rule again.
        by: who asks, for the journal.
        recipe: let the recipe rule instead of plans for that time.

    Returns:
        All overrides that then stand, also those that have run out since; `RECIPE` among them.

    Raises:
        IgrowError: no such setpoint, a value outside the site's limits, or nowhere to write to.
    """
    path = override_file(configuration.state_folder)
    if not path.parent.is_dir():
        # Made by root, it would shut out the service's own user.
        raise IgrowError(f"{path.parent}: is not there; the daemon makes it when it first starts, override after that")
    for name, value in values.items():
        if name not in configuration.setpoints:
            raise IgrowError(f"{name[:40]} is no setpoint of this site: {', '.join(configuration.setpoints)}")
        rule = configuration.guard_rules.points[name]
        if not rule.low <= value <= rule.high:
            raise IgrowError(f"{name}={value:g}: the site's limits are {rule.low:g} to {rule.high:g}")
    wanted = {**values, RECIPE: 1.0} if recipe else values
    taken = {name: Lease(value, seconds, by=by, asked=time.time_ns()) for name, value in wanted.items()}
    with alone_in(path.parent):
        kept = {name: lease for name, lease in read_leases(path).items() if name not in give_back}
        problem = write_leases(path, kept | taken, by if give_back else "")
    if problem:
        raise IgrowError(problem)
    return kept | taken
