"""`igrow-edge page`: the grower's page, from a process of its own."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import os
import signal

from igrow.edge.cli.common import add_configuration
from igrow.edge.cli.log_lines import set_up_logging
from igrow.edge.page.pages import Pages
from igrow.edge.page.server import PageServer

EXAMPLE = "igrow-edge page /etc/igrow/daemon.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--port", type=int, help="TCP port (default: the configuration's; 0 takes a free one)")
    parser.add_argument("--verbose", action="store_true", help="log what goes on in more detail")


def run(options: argparse.Namespace) -> int:
    """Serve until told to stop."""
    pages = Pages(options.configuration)
    journal = set_up_logging(verbose=options.verbose)
    asyncio.run(_serve(pages, options.port))
    journal.close()
    # Not an orderly exit: it would wait for a thread whose disk hangs.
    os._exit(0)


async def _serve(pages: Pages, port: int | None) -> None:
    settings = pages.configuration().file.page
    server = PageServer(pages)
    await server.start(settings.address, settings.port if port is None else port)
    log = logging.getLogger("igrow.edge.page")
    log.info(
        "the page is on http://%s:%d", "localhost" if settings.address == "127.0.0.1" else settings.address, server.port
    )
    if pages.password() is None:
        log.info("it only shows; `igrow-edge password` sets a password to act from there")
    told = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, told.set)
    await told.wait()
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(server.close(), 2.0)
