"""`igrow-edge exchange`: what waits for the trainer, and a round by hand, such as to a USB stick."""

from __future__ import annotations

import argparse
import time
from datetime import UTC, datetime
from pathlib import Path

from igrow import __version__
from igrow.core.errors import IgrowError
from igrow.core.exchange.address import parse_address
from igrow.core.exchange.documents import parse_object
from igrow.edge.cli.common import DEFAULT_CONFIGURATION, configuration_of
from igrow.edge.clock import EARLIEST_PLAUSIBLE
from igrow.edge.configuration import Configuration
from igrow.edge.daemon_file import ClockSource
from igrow.edge.exchange import Order, run_round
from igrow.edge.exchange.courier import STATUS_FILE, RoundStatus

EXAMPLE = "igrow-edge exchange status\n  sudo -u igrow igrow-edge exchange sync --url /media/stick"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's actions."""
    actions = parser.add_subparsers(title="actions", dest="action", metavar="ACTION", required=True)
    status = actions.add_parser("status", help="show what waits, and how the last round ended")
    sync = actions.add_parser("sync", help="make a round now")
    for one in (status, sync):
        one.add_argument("configuration", type=Path, nargs="?", default=DEFAULT_CONFIGURATION, help="the daemon's file")
    sync.add_argument("--url", help="another place than the configured one, such as the folder of a USB stick")


def run(options: argparse.Namespace) -> int:
    """Show or do; returns 1 where the round had a problem."""
    configuration = configuration_of(options)
    folder = configuration.state_folder / "exchange"
    if options.action == "status":
        try:
            document = parse_object((folder / STATUS_FILE).read_bytes(), str(folder / STATUS_FILE))
            status = RoundStatus(**document)
        except FileNotFoundError:
            print("no round was made yet")
            return 0
        except TypeError:
            raise IgrowError(f"{folder / STATUS_FILE}: written by another version of igrow") from None
    else:
        status = run_round(order(configuration, options.url))
    print_status(status)
    return int(bool(status.problem))


def order(configuration: Configuration, url: str | None) -> Order:
    """Return the order of a round by hand; raises IgrowError where no exchange is named."""
    if url is None and configuration.exchange is None:
        raise IgrowError(f"{configuration.path}: no exchange in it; name a place with --url")
    transfer, hosts, identity = configuration.file.transfer, configuration.known_hosts, configuration.identity
    if url is not None and (address := parse_address(url)).scheme == "file" and not Path(address.path).is_dir():
        raise IgrowError(f"{url}: there is no such folder; is the stick mounted?")
    now = time.time()
    # A simulated plant has a time of its own, which the daemon knows: then only what is sealed is sent.
    known = configuration.file.cycle.clock is ClockSource.SYSTEM and now >= EARLIEST_PLAUSIBLE
    return Order(
        str(configuration.state_folder / "exchange"),
        str(configuration.store_folder),
        configuration.site.name,
        url or str(configuration.exchange),
        __version__,
        now if known else None,
        int(transfer.segment.total_seconds()),
        transfer.budget * 10**6,
        partly=True,
        by_hand=True,
        known_hosts=None if hosts is None else str(hosts),
        identity=None if identity is None else str(identity),
    )


def print_status(status: RoundStatus) -> None:
    """Print how a round ended."""
    print(f"round of {datetime.fromtimestamp(status.ended, UTC):%Y-%m-%d %H:%M} UTC: {status.problem or 'all is well'}")
    print(
        f"  sealed {status.sealed}, sent {status.sent} ({status.sent_bytes / 1e6:.2f} MB), receipts {status.receipted}"
    )
    print(f"  {status.waiting} segments wait for a receipt ({status.waiting_bytes / 1e6:.2f} MB)")
