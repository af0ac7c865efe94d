"""The arguments by which every command that reads a log is told of it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from igrow.trainer.data import Log, read_log


def add_log_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the log, its site, and how it is to be read."""
    parser.add_argument(
        "log", nargs="+", type=Path, metavar="LOG", help="telemetry or exports: files, or the folder of a data set"
    )
    parser.add_argument("--site", type=Path, help="the site's YAML file; a known data set brings its own")
    parser.add_argument("--compartment", help="its name, where a data set has several")
    parser.add_argument("--mapping", type=Path, help="how exports are to be read (default: the mapping beside them)")
    parser.add_argument(
        "--accept", action="append", default=[], metavar="KIND", help="a kind of data fault that is known to be none"
    )


def log_of(arguments: argparse.Namespace) -> Log:
    """Return the log; what was inferred or set aside is told on standard error.

    Raises:
        IgrowError: a file cannot be read, or the site is not known.
    """
    place = arguments.log[0] if len(arguments.log) == 1 else arguments.log
    log = read_log(
        place, arguments.site, compartment=arguments.compartment, mapping=arguments.mapping, accept=arguments.accept
    )
    for note in log.notes:
        print(f"note: {note}", file=sys.stderr)
    assert log.known_site  # raises where the site is not known
    return log


def typed(arguments: argparse.Namespace) -> list[str]:
    """Return the words by which a command was told of its log, for another command to take."""
    options = {"site": arguments.site, "compartment": arguments.compartment, "mapping": arguments.mapping}
    words = [*map(str, arguments.log)]
    for name, value in options.items():
        words += [f"--{name}", str(value)] if value is not None else []
    return [*words, *(word for kind in arguments.accept for word in ("--accept", kind))]
