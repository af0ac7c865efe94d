"""`igrow-edge restore`."""

from __future__ import annotations

import argparse
from pathlib import Path

from edge.cli.common import configuration_of, store_folder
from edge.store import restore

EXAMPLE = "systemctl stop igrow-edge && igrow-edge restore /etc/igrow/daemon.yaml igrow-backup.tar.gz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("archive", type=Path, help="the backup; stop the daemon first")


def run(options: argparse.Namespace) -> int:
    """Put the backup in place."""
    folder = store_folder(configuration_of(options))
    restore(options.archive, folder)
    print(f"{folder}: restored from {options.archive}")
    return 0
