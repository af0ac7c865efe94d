"""`igrow-edge override`: the grower's word, for some time."""

from __future__ import annotations

import argparse
import getpass
from datetime import timedelta
from pathlib import Path

from igrow.core.yaml_scalars import duration
from igrow.edge.cli.common import configuration_of, parse_duration, parse_setpoint
from igrow.edge.overriding import override
from igrow.edge.sources.override import RECIPE

EXAMPLE = 'igrow-edge override /etc/igrow/daemon.yaml heating_setpoint=18 --for "2 h"'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("setpoints", nargs="*", metavar="SETPOINT=VALUE", help="such as heating_setpoint=18")
    parser.add_argument("--for", dest="duration", default="2 h", help="how long (default: 2 h)")
    parser.add_argument(
        "--clear", nargs="*", metavar="SETPOINT", help="give these back (`recipe` lets plans rule again), or all"
    )
    parser.add_argument("--recipe", action="store_true", help="let the recipe rule instead of plans for that time")
    parser.add_argument("--by", default=None, help="who says so (default: the user)")


def run(options: argparse.Namespace) -> int:
    """Write the leases; a running daemon sees them in its next cycle. The guard's limits hold for them too."""
    configuration = configuration_of(options)
    give_back = () if options.clear is None else options.clear or (*configuration.setpoints, RECIPE)
    values = dict(parse_setpoint(text) for text in options.setpoints)
    leases = override(
        configuration,
        values,
        parse_duration(options.duration),
        give_back,
        by=options.by or getpass.getuser(),
        recipe=options.recipe,
    )
    for name, lease in leases.items():
        what = "the recipe rules" if name == RECIPE else f"{name} = {lease.value:g}"
        print(f"{what} for {duration(timedelta(seconds=round(lease.seconds)))}")
    if not leases:
        print("nothing is overridden")
    return 0
