"""`igrow-edge mqtt`: publish the daemon's state to an MQTT broker, from a process of its own."""

from __future__ import annotations

import argparse
import asyncio

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.cli.log_lines import set_up_logging
from igrow.edge.status.client import fetch

EXAMPLE = "igrow-edge mqtt /etc/igrow/daemon.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Publish until interrupted."""
    configuration = configuration_of(options)
    if configuration.file.mqtt.host is None:
        raise IgrowError(f"{configuration.path}: mqtt.host is null: name the broker")
    try:
        from igrow.edge.mqtt.bridge import run_bridge  # noqa: PLC0415 - an extra that control does not need
    except ImportError:
        raise IgrowError("MQTT needs aiomqtt: install igrow[mqtt]") from None
    journal = set_up_logging(verbose=False)
    try:
        asyncio.run(run_bridge(configuration, lambda: fetch(configuration.file.status.port)))
    finally:
        journal.close()
    return 0
