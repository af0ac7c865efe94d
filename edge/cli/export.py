"""`igrow-edge export`."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.edge.cli.common import configuration_of, parse_time
from igrow.edge.store import export

EXAMPLE = "igrow-edge export /etc/igrow/daemon.yaml export/ --from 2026-03-01 --until 2026-04-01"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    parser.add_argument("folder", type=Path, help="where the CSV files go")
    parser.add_argument("--from", dest="start", default=None, help="first UTC day or time (default: all)")
    parser.add_argument("--until", default=None, help="UTC day or time to end before (default: all)")


def run(options: argparse.Namespace) -> int:
    """Write the files and name them."""
    start = parse_time(options.start) if options.start else 0.0
    end = parse_time(options.until) if options.until else 8e9
    for path in export(configuration_of(options).store_folder, options.folder, start=start, end=end):
        print(path)
    return 0
