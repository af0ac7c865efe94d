"""`igrow-edge restore`."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.edge.backup import put_back

EXAMPLE = "sudo -u igrow igrow-edge restore /etc/igrow/daemon.yaml igrow-backup.tar.gz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file; taken from the backup if not there")
    parser.add_argument("archive", type=Path, help="the backup; stop the daemon first")


def run(options: argparse.Namespace) -> int:
    """Put the backup in place."""
    found = put_back(options.archive, options.configuration)
    print(f"{found.state_folder}: restored from {options.archive}; configuration: {found.path}")
    return 0
