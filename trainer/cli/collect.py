"""`igrow-trainer collect`: bring what gateways left in the exchange into the archive."""

from __future__ import annotations

import argparse
from datetime import timedelta
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.cli.common import add_exchange, exchange_of, utc_now
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect
from igrow.trainer.service.forwarding import forward
from igrow.trainer.service.known_sites import known_sites

EXAMPLE = (
    "igrow-trainer collect north --exchange /srv/igrow --state state\n"
    "  igrow-trainer diagnose state/archive/telemetry/site=north --site site.yaml --out diagnosis"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("site", nargs="+", help="a site's name")
    add_exchange(parser)
    parser.add_argument("--state", type=Path, required=True, help="folder whose `archive` takes the logs, as Parquet")
    parser.add_argument(
        "--forward", metavar="TARGET", help="write new days to InfluxDB or PostgreSQL too, or to a file"
    )
    parser.add_argument("--take-over", action="store_true", help="go on where another archive has collected so far")
    parser.add_argument(
        "--again", action="store_true", help="set damaged days aside, and ask the gateway for its whole log once more"
    )


def run(arguments: argparse.Namespace) -> int:
    """Collect each site; returns 1 where one failed."""
    place, archive = exchange_of(arguments), Archive(arguments.state / "archive")
    failed = False
    for site in arguments.site:
        try:
            known = {*place.folders(), *archive.collected()}
            if site not in known:
                raise IgrowError(f"neither {place} nor {archive.root} has anything of it; {known_sites(site, known)}")
            done = collect(place, site, archive, utc_now(), take_over=arguments.take_over, again=arguments.again)
            if arguments.forward is not None:
                forward(archive, site, arguments.forward, utc_now().date() + timedelta(days=1))
        except (IgrowError, OSError) as error:
            print(f"{site}: error; {error}", flush=True)
            failed = True
            continue
        nothing = f"nothing came yet, and {site}/segments of {place} is empty"
        last = nothing if done.newest is None else f"the last row is of {done.newest:%Y-%m-%d %H:%M} UTC"
        print(f"{site}: {done.segments} segments, {done.rows} rows, {done.bytes / 1e6:.2f} MB; {last}")
        for note in done.notes:
            print(f"  {note}", flush=True)
    return int(failed)
