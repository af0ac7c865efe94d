"""`igrow-edge restore`."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.edge.cli.common import configuration_of, store_folder
from igrow.edge.state_lock import daemon_stopped
from igrow.edge.store import restore

EXAMPLE = "sudo -u igrow igrow-edge restore /etc/igrow/daemon.yaml igrow-backup.tar.gz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("archive", type=Path, help="the backup; stop the daemon first")


def run(options: argparse.Namespace) -> int:
    """Put the backup in place."""
    configuration = configuration_of(options)
    folder = store_folder(configuration)
    with daemon_stopped(configuration.state_folder):
        restore(options.archive, folder)
    print(f"{folder}: restored from {options.archive}")
    return 0
