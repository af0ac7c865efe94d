"""`igrow-edge override`: the grower's word, for some time."""

from __future__ import annotations

import argparse
from datetime import timedelta
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.yaml_schema import duration
from igrow.edge.cli.common import configuration_of, parse_duration, parse_setpoint
from igrow.edge.sources.override import Lease, read_leases, write_leases
from igrow.edge.wiring import override_file

EXAMPLE = 'igrow-edge override /etc/igrow/daemon.yaml heating_setpoint=18 --for "2 h"'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("setpoints", nargs="*", metavar="SETPOINT=VALUE", help="such as heating_setpoint=18")
    parser.add_argument("--for", dest="duration", default="2 h", help="how long (default: 2 h)")
    parser.add_argument("--clear", nargs="*", metavar="SETPOINT", help="give these back, or all")


def run(options: argparse.Namespace) -> int:
    """Write the leases; a running daemon sees them in its next cycle. The guard's limits hold for them too."""
    configuration = configuration_of(options)
    path = override_file(configuration.state_folder)
    leases = read_leases(path)
    if options.clear is not None:
        for name in options.clear or list(leases):
            leases.pop(name, None)
    seconds = parse_duration(options.duration)
    for text in options.setpoints:
        name, value = parse_setpoint(text)
        if name not in configuration.setpoints:
            raise IgrowError(f"{name} is no setpoint of this site: {', '.join(configuration.setpoints)}")
        rule = configuration.guard_rules.points[name]
        if not rule.low <= value <= rule.high:
            raise IgrowError(f"{name}={value:g}: the site's limits are {rule.low:g} to {rule.high:g}")
        leases[name] = Lease(value, seconds)
    if not path.parent.is_dir():
        # Made by root, it would shut out the service's own user.
        raise IgrowError(f"{path.parent}: is not there; the daemon makes it when it first starts, override after that")
    problem = write_leases(path, leases)
    if problem:
        raise IgrowError(problem)
    for name, lease in leases.items():
        print(f"{name} = {lease.value:g} for {duration(timedelta(seconds=round(lease.seconds)))}")
    if not leases:
        print("nothing is overridden")
    return 0
