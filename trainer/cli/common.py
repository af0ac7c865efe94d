"""What several commands share."""

from __future__ import annotations

import argparse
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from igrow.core.bundle import Bundle
from igrow.core.exchange import FolderPlace
from igrow.core.exchange.remote import RemotePlace, open_place

if TYPE_CHECKING:
    from igrow.trainer.fit import FittedModel


def utc_now() -> datetime:
    """Return the time, UTC."""
    return datetime.now(UTC)


def add_exchange(parser: argparse.ArgumentParser) -> None:
    """Declare where the exchange is."""
    parser.add_argument(
        "--exchange", required=True, metavar="URL", help="a folder, sftp://user@host/folder or s3://bucket/folder"
    )
    parser.add_argument("--known-hosts", metavar="FILE", help="the SFTP server's key (default: ~/.ssh/known_hosts)")
    parser.add_argument("--identity", metavar="FILE", help="our private key for SFTP (default: the user's own)")


def exchange_of(arguments: argparse.Namespace) -> FolderPlace | RemotePlace:
    """Return the exchange; raises IgrowError."""
    return open_place(arguments.exchange, known_hosts=arguments.known_hosts, identity=arguments.identity)


def replace_bundle(folder: Path, model: FittedModel, *, created: datetime | None = None, seed: int = 0) -> Bundle:
    """Write a model as a bundle in the place of an earlier one, which stays until the new one is whole."""
    from igrow.trainer.exporting import export  # noqa: PLC0415  (collecting needs no graphs)

    fresh = folder.with_name(f"{folder.name}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    bundle = export(model, fresh, created=created, seed=seed)
    shutil.rmtree(folder, ignore_errors=True)
    fresh.rename(folder)
    return bundle
