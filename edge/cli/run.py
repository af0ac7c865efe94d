"""`igrow-edge run`: the daemon."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import faulthandler
import logging
import os
import sys

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import add_configuration
from igrow.edge.daemon import run_daemon
from igrow.edge.hand_off import HandOff, LateError

EXAMPLE = "igrow-edge run /etc/igrow/daemon.yaml"

JOURNAL_SECONDS = 1.0
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


class JournalHandler(logging.Handler):
    """Writes lines aside: a journal or a terminal that reads no more must not hold whoever has something to say."""

    def __init__(self) -> None:
        super().__init__()
        self._aside = HandOff("journal")

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line over; one that does not fit behind those that wait is lost."""
        line = self.format(record) + "\n"
        with contextlib.suppress(LateError):
            self._aside.post(lambda: self._write(line))

    def close(self) -> None:
        """Let what waits be written, within a second."""
        self._aside.close(JOURNAL_SECONDS)
        super().close()

    @staticmethod
    def _write(line: str) -> None:
        sys.stderr.write(line)
        sys.stderr.flush()


def run(options: argparse.Namespace) -> int:
    """Run the daemon. Ends the process itself, as an orderly exit would wait for threads that may hang for ever."""
    journal = set_up_logging(verbose=options.verbose)
    # The watchdog ends a daemon that hangs with SIGABRT; standard error, and so the journal, then shows where it hung.
    faulthandler.enable(2)
    code = 0
    try:
        asyncio.Runner().run(run_daemon(options.configuration))
    except IgrowError:
        raise
    except BaseException:
        logging.getLogger("igrow.edge").exception("the daemon ends by a fault of its own")
        code = 1
    journal.close()
    os._exit(code)


def set_up_logging(*, verbose: bool) -> JournalHandler:
    """Log to standard error: for journald when it listens, else with the time for a person."""
    handler = JournalHandler()
    if os.environ.get("JOURNAL_STREAM"):
        handler.setFormatter(_JournalFormatter("%(message)s"))
    else:
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler], force=True)
    logging.captureWarnings(True)
    # The library repeats at ERROR what our bus reports better.
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    return handler
