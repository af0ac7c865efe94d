"""`igrow-edge run`: the daemon."""

from __future__ import annotations

import argparse
import asyncio
import faulthandler
import logging
import os

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import add_configuration
from igrow.edge.cli.log_lines import set_up_logging
from igrow.edge.daemon import run_daemon

EXAMPLE = "igrow-edge run /etc/igrow/daemon.yaml"


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
        logging.getLogger("igrow.edge").exception("the daemon ends by a fault of its own")
        code = 1
    journal.close()
    os._exit(code)
