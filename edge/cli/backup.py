"""`igrow-edge backup`."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.edge.cli.common import configuration_of, store_folder
from igrow.edge.store import backup

EXAMPLE = "igrow-edge backup /etc/igrow/daemon.yaml /media/usb/igrow-backup.tar.gz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("target", type=Path, help="the file to write, .tar.gz")


def run(options: argparse.Namespace) -> int:
    """Write the backup."""
    target = backup(store_folder(configuration_of(options)), options.target)
    print(f"{target}: {target.stat().st_size / 1e6:.1f} MB")
    return 0
