"""What is kept of one site: the bundles that were published for it; its runs, in `history.py`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path

from igrow.core.bundle import Bundle, BundleError, default_bundle_folder, read_bundle

KEPT = 5
"""Published bundles that are kept for each site, besides the one in force."""
REFUSED = frozenset({"rejected", "refused", "went_back", "withdrawn"})
"""Verdicts of a gateway after which a bundle is not in force there."""

Publish = Callable[[Path], object]
"""Takes the folder of a bundle that passed."""


def site_folder(state: Path, site: str) -> Path:
    """Return the folder of one site's memory."""
    return state / "sites" / site


def publish_new(
    folder: Path,
    write_bundle: Callable[[Path], tuple[str, ...]],
    publish_bundle: Publish,
    now: datetime,
    in_force: Path,
) -> tuple[str, tuple[str, ...]]:
    """Write a new bundle of a site, publish it, and forget old ones; returns its name, and notes on its making."""
    fresh = folder / "bundles" / now.strftime("%Y%m%dT%H%M%SZ")
    fresh.parent.mkdir(parents=True, exist_ok=True)
    notes = write_bundle(fresh)
    publish_bundle(fresh)
    forget_old(fresh.parent, in_force)
    return fresh.name, notes


def refused_bundles(reports: Sequence[Mapping[str, object]]) -> dict[str, str]:
    """Return the bundles whose newest report says that they are not in force: identity -> verdict."""
    newest = {str(report.get("identity")): str(report.get("verdict")) for report in reports}
    return {identity: verdict for identity, verdict in newest.items() if verdict in REFUSED}


def bundle_in_force(folder: Path, reports: Sequence[Mapping[str, object]]) -> tuple[Bundle, tuple[str, ...]]:
    """Return the newest published bundle that the gateway has not refused or taken back, and sentences on damaged ones.

    Where there is none it is the default bundle.
    """
    refused, notes = refused_bundles(reports), []
    published = sorted((folder / "bundles").glob("*"), reverse=True) if (folder / "bundles").is_dir() else []
    for candidate in published:
        if candidate.name.endswith(".new"):
            continue
        try:
            bundle = read_bundle(candidate)
        except BundleError as error:
            notes.append(f"{error}; its predecessor is built upon")
            continue
        if bundle.identity not in refused:
            return bundle, tuple(notes)
    return read_bundle(default_bundle_folder()), tuple(notes)


def forget_old(bundles: Path, in_force: Path) -> None:
    """Delete all but the newest published bundles; never the one in force, however many were refused since."""
    for old in sorted(bundles.iterdir())[:-KEPT]:
        if old.resolve() != in_force.resolve():
            shutil.rmtree(old)
