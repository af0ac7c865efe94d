"""What several commands share."""

from __future__ import annotations

import argparse

from igrow.core.exchange import Place
from igrow.trainer.service.places import open_place


def add_exchange(parser: argparse.ArgumentParser) -> None:
    """Declare where the exchange is."""
    parser.add_argument(
        "--exchange", required=True, metavar="URL", help="a folder, sftp://user@host/folder or s3://bucket/folder"
    )
    parser.add_argument("--known-hosts", metavar="FILE", help="the SFTP server's key (default: ~/.ssh/known_hosts)")
    parser.add_argument("--identity", metavar="FILE", help="our private key for SFTP (default: the user's own)")


def exchange_of(arguments: argparse.Namespace) -> Place:
    """Return the exchange; raises IgrowError."""
    return open_place(arguments.exchange, known_hosts=arguments.known_hosts, identity=arguments.identity)
