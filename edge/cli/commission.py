"""`igrow-edge commission`: walks through the checks with a new PLC."""

from __future__ import annotations

import argparse
import asyncio
import contextlib

from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.commission import Commissioning, Console
from igrow.edge.state_lock import daemon_stopped

EXAMPLE = "igrow-edge commission /etc/igrow/daemon.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--fallback-after", type=float, default=900.0, help="seconds of the PLC's heartbeat timeout")
    parser.add_argument("--only-read", action="store_true", help="confirm the points and write nothing at all")


def run(options: argparse.Namespace) -> int:
    """Walk through; the exit code is 0 when everything was confirmed, else 1."""
    configuration = configuration_of(options)
    commissioning = Commissioning(
        configuration, Console(), fallback_after=options.fallback_after, only_read=options.only_read
    )
    # A daemon would go on writing, and its heartbeat would keep the PLC from falling back.
    alone = contextlib.nullcontext() if options.only_read else daemon_stopped(configuration.state_folder)
    with alone:
        return 0 if asyncio.run(commissioning.run()) else 1
