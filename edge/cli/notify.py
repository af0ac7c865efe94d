"""`igrow-edge notify`: tell people of alarms, from a process of its own."""

from __future__ import annotations

import argparse
import time

from igrow.core.errors import IgrowError
from igrow.edge.alarm_levels import Level
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE
from igrow.edge.notifications.message import Message
from igrow.edge.notifications.notifier import Notifier, send_to_all
from igrow.edge.notifications.services import open_services
from igrow.edge.status.client import fetch

EXAMPLE = "igrow-edge notify /etc/igrow/daemon.yaml --test"
LOOK_SECONDS = 15.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--test", action="store_true", help="send one message to every service, and end")


def run(options: argparse.Namespace) -> int:
    """Look at the daemon every 15 s until interrupted; with --test the exit code is 0 if a service took the message."""
    configuration = configuration_of(options)
    settings = configuration.file.notifications
    if not settings.services:
        raise IgrowError(f"{configuration.path}: notifications.services is empty: name at least one Apprise address")
    services = open_services(settings.services)
    site = configuration.site.name
    if options.test:
        taken = send_to_all(services, Message(f"{site}: test", "igrow can reach you here.", Level.NOTICE))
        print("sent" if taken else "no service took the message")
        return 0 if taken else 1
    notifier = Notifier(
        site,
        settings,
        services,
        lambda: fetch(configuration.file.status.port),
        configuration.state_folder / "notify",
        configuration.state_folder / ACKNOWLEDGED_FILE,
    )
    while True:
        message = notifier.look(time.time())
        if message is not None:
            print(f"told: {message.title}", flush=True)
        time.sleep(LOOK_SECONDS)
