"""`igrow-trainer publish`: sign a bundle and put it into the exchange."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.cli.common import add_exchange, exchange_of
from igrow.trainer.publishing import publish, refresh, repository_of

EXAMPLE = (
    "igrow-trainer publish out/bundle --keys keys --exchange /srv/igrow\n"
    "  igrow-trainer publish --refresh north --keys keys --exchange /srv/igrow"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("bundle", type=Path, nargs="?", help="folder of the bundle to publish, for the site it names")
    parser.add_argument("--keys", type=Path, required=True, help="folder of the signing keys (`igrow-trainer keys`)")
    add_exchange(parser)
    parser.add_argument(
        "--refresh", metavar="SITE", action="append", default=[], help="sign a site's again, before its metadata expire"
    )


def run(arguments: argparse.Namespace) -> int:
    """Publish, or do what the options say."""
    if arguments.bundle is None and not arguments.refresh:
        raise IgrowError("name the bundle to publish, or the site to --refresh")
    place = exchange_of(arguments)
    for site in arguments.refresh:
        until = refresh(repository_of(place, site), arguments.keys)
        print(f"signed the bundles of {site} again: gateways take them until {until:%Y-%m-%d}")
    if arguments.bundle is not None:
        bundle = publish(arguments.bundle, place, arguments.keys)
        print(f"published {bundle.label} for site {bundle.manifest.site} in {arguments.exchange}")
    return 0
