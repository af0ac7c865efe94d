"""`igrow-edge alarms`: the alarms of this moment and of the last days, and saying that one knows of them."""

from __future__ import annotations

import argparse
import getpass
import time
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import configuration_of
from igrow.edge.notifications.acknowledged import (
    ACKNOWLEDGED_FILE,
    Acknowledgement,
    acknowledge,
    read_acknowledged,
)
from igrow.edge.status.client import fetch
from igrow.edge.store import read_records

EXAMPLE = 'igrow-edge alarms /etc/igrow/daemon.yaml --acknowledge "sensor wind_speed"'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", help="the daemon's YAML file")
    parser.add_argument("--acknowledge", nargs="*", metavar="ALARM", help="I know of these, or of all active ones")
    parser.add_argument("--by", default=None, help="who says so (default: the user)")
    parser.add_argument("--last", type=int, default=0, metavar="N", help="also list the last N that came or went")


def run(options: argparse.Namespace) -> int:
    """List, or acknowledge. An acknowledged alarm is not told again; it stays listed until it is over."""
    configuration = configuration_of(options)
    path = configuration.state_folder / ACKNOWLEDGED_FILE
    alarms = list(fetch(configuration.file.status.port)["alarms"])
    if options.acknowledge is not None:
        active = [str(alarm["name"]) for alarm in alarms]
        names = options.acknowledge or active
        for name in names:
            if name not in active:
                raise IgrowError(f"no alarm {name!r} is active: {', '.join(active) or 'there is none'}")
        problem = acknowledge(path, names, options.by or getpass.getuser(), time.time(), active)
        if problem:
            raise IgrowError(problem)
    print("\n".join(lines(alarms, read_acknowledged(path))))
    if options.last > 0:
        for record in reversed(read_records(configuration.store_folder, "alarm")[: options.last]):
            body = record.body
            print(f"{_date(record.time)}  {'came' if body['active'] else 'went':<5} {body['name']}: {body['text']}")
    return 0


def lines(alarms: list[Mapping[str, Any]], acknowledged: Mapping[str, Acknowledgement]) -> Iterator[str]:
    """Yield the active alarms for people, the worst first."""
    if not alarms:
        yield "no alarm is active"
    order = {"critical": 0, "warning": 1, "notice": 2}
    for alarm in sorted(alarms, key=lambda one: order[one["level"]]):
        known = acknowledged.get(alarm["name"])
        note = "" if known is None else f"  (known to {known.by} since {_date(known.time)})"
        yield f"{alarm['level']:<9} {_date(alarm['time'])}  {alarm['name']}: {alarm['text']}{note}"


def _date(seconds: float | None) -> str:
    return "undated         " if seconds is None else datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M")
