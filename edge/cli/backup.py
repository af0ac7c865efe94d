"""`igrow-edge backup`."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.edge.backup import back_up
from igrow.edge.cli.common import configuration_of

EXAMPLE = "igrow-edge backup /etc/igrow/daemon.yaml /media/usb/igrow-backup.tar.gz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("target", type=Path, help="the file to write, .tar.gz")


def run(options: argparse.Namespace) -> int:
    """Write the backup."""
    elsewhere = back_up(configuration_of(options), options.target)
    print(f"{options.target}: {options.target.stat().st_size / 1e6:.1f} MB")
    for path in elsewhere:
        print(f"not in it, as it lies outside the configuration's folder: {path}")
    return 0
