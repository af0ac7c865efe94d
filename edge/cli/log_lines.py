"""Log lines of the commands that run for long: for journald where it listens, else for a person."""

from __future__ import annotations

import contextlib
import logging
import os
import sys

from igrow.edge.hand_off import HandOff, LateError

JOURNAL_SECONDS = 1.0
_JOURNAL_PRIORITY = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}


class _OneLine(logging.Formatter):
    """Shows what does not print in what somebody else may have named (a topic, a file), so that it passes for no line.

    A traceback keeps its lines.
    """

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's own name
        line = super().formatMessage(record)
        return "".join(one if one.isprintable() else repr(one)[1:-1] for one in line)


class _JournalFormatter(_OneLine):
    """Begins each line with its priority, as journald reads it (sd-daemon(3)); journald adds the time itself."""

    def format(self, record: logging.LogRecord) -> str:
        priority = _JOURNAL_PRIORITY.get(record.levelno, 6)
        return "\n".join(f"<{priority}>{line}" for line in super().format(record).splitlines())


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


def set_up_logging(*, verbose: bool) -> JournalHandler:
    """Log to standard error: for journald when it listens, else with the time for a person."""
    handler = JournalHandler()
    if os.environ.get("JOURNAL_STREAM"):
        handler.setFormatter(_JournalFormatter("%(message)s"))
    else:
        handler.setFormatter(_OneLine("%(asctime)s %(levelname)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.INFO, handlers=[handler], force=True)
    logging.captureWarnings(True)
    # The library repeats at ERROR what our bus reports better.
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    return handler
