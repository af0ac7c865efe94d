"""`igrow-trainer publish`: sign a bundle and put it into the exchange; make the keys and the exchange, once."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.publishing import create_keys, initialise, publish, refresh

EXAMPLE = (
    "igrow-trainer publish --init --keys keys --exchange /srv/igrow\n"
    "  igrow-trainer publish out/bundle --keys keys --exchange /srv/igrow"
)
REPOSITORY = "bundles"
"""Folder of the signed repository inside the exchange."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("bundle", type=Path, nargs="?", help="folder of the bundle to publish")
    parser.add_argument("--keys", type=Path, required=True, help="folder of the signing keys; keep it off the gateway")
    parser.add_argument("--exchange", type=Path, required=True, help="folder that gateway and trainer share")
    parser.add_argument("--init", action="store_true", help="make the keys and the signed repository, once")
    parser.add_argument("--refresh", action="store_true", help="only sign again, before the metadata expire")


def run(arguments: argparse.Namespace) -> int:
    """Publish, or do what the options say."""
    repository = arguments.exchange / REPOSITORY
    if arguments.init:
        create_keys(arguments.keys)
        root = initialise(repository, arguments.keys)
        print(f"made keys in {arguments.keys}; install {root} on each gateway as updates.trusted_root")
    if arguments.refresh:
        refresh(repository, arguments.keys)
        print(f"signed {repository} again")
    if arguments.bundle is not None:
        bundle = publish(arguments.bundle, repository, arguments.keys)
        print(f"published {bundle.label} for site {bundle.manifest.site} in {repository}")
    elif not (arguments.init or arguments.refresh):
        raise IgrowError("name the bundle to publish, or give --init or --refresh")
    return 0
