"""`igrow-edge run`: the daemon."""

from __future__ import annotations

import argparse
import asyncio
import faulthandler
import logging
import os
import signal
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import add_configuration
from igrow.edge.cli.log_lines import set_up_logging
from igrow.edge.configuration import load_configuration
from igrow.edge.daemon import Daemon
from igrow.edge.hand_off import HandOff, settled
from igrow.edge.state_lock import StateLock

EXAMPLE = "igrow-edge run /etc/igrow/daemon.yaml"
LOCK_SECONDS = 5.0
"""Longest time for the disk to say whether another daemon has the state folder; then control comes first."""

log = logging.getLogger("igrow.edge")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--verbose", action="store_true", help="log what goes on in more detail")


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
        log.exception("the daemon ends by a fault of its own")
        code = 1
    journal.close()
    os._exit(code)


async def run_daemon(path: Path) -> None:
    """Run until SIGTERM or SIGINT; SIGHUP reads the configuration again.

    Raises IgrowError for a bad configuration, and where another daemon has the same state folder.
    """
    configuration = load_configuration(path)
    lock, aside = StateLock(configuration.state_folder), HandOff("lock")
    taken = aside.post(lock.hold)
    await settled(taken, LOCK_SECONDS)
    if taken.done():
        taken.result()
    else:
        log.warning("%s does not answer, so nobody knows of another daemon there", configuration.state_folder)
    daemon = Daemon(configuration, hold=lambda: aside.ask(lock.hold))
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, daemon.stop)
    loop.add_signal_handler(signal.SIGHUP, daemon.reload)
    await daemon.run()
