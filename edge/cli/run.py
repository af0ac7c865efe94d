"""`igrow-edge run`: the daemon."""

from __future__ import annotations

import argparse
import asyncio
import faulthandler
import logging
import os
import sys

from igrow.edge.cli.common import add_configuration
from igrow.edge.daemon import run_daemon

EXAMPLE = "igrow-edge run /etc/igrow/daemon.yaml"

_JOURNAL_PRIORITY = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}


class _JournalFormatter(logging.Formatter):
    """Begins each line with its priority, as journald reads it (sd-daemon(3)); journald adds the time itself."""

    def format(self, record: logging.LogRecord) -> str:
        priority = _JOURNAL_PRIORITY.get(record.levelno, 6)
        return "\n".join(f"<{priority}>{line}" for line in super().format(record).splitlines())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--verbose", action="store_true", help="log what goes on in more detail")


def run(options: argparse.Namespace) -> int:
    """Run the daemon."""
    set_up_logging(verbose=options.verbose)
    # The watchdog ends a daemon that hangs with SIGABRT; standard error, and so the journal, then shows where it hung.
    faulthandler.enable(2)
    asyncio.run(run_daemon(options.configuration))
    return 0


def set_up_logging(*, verbose: bool) -> None:
    """Log to standard error: for journald when it listens, else with the time for a person."""
    handler = logging.StreamHandler(sys.stderr)
    if os.environ.get("JOURNAL_STREAM"):
        handler.setFormatter(_JournalFormatter("%(message)s"))
    else:
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler], force=True)
    # The library repeats at ERROR what our bus reports better.
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
