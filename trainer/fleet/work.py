"""What a task does for one site. Arguments and results are plain JSON, since they may travel to another machine."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange import Place
from igrow.core.exchange.documents import LARGEST_DOCUMENT, parse_object
from igrow.core.exchange.remote import open_place
from igrow.core.site import load_site
from igrow.core.whole_files import write_whole
from igrow.trainer.service import history
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect
from igrow.trainer.service.forwarding import forward
from igrow.trainer.service.recalibration import recalibrate
from igrow.trainer.service.site_memory import bundle_in_force, site_folder

Exchange = Mapping[str, Any]
"""The arguments of `_place`."""
COLLECTED = "collected.json"
LEARNED = "learned.json"
"""What a site's own log said of its parameters and its discrepancy; no row of the log."""
REFRESH_BEFORE = timedelta(days=30)
"""Signatures that hold for less than this are made again."""


def collect_site(
    site: str, state: str, exchange: Exchange, now: float, forward_to: str | None = None, *, take_over: bool = False
) -> dict[str, Any]:
    """Collect one site; its newest outcome stands in `collected.json`, and what people should know in its history."""
    moment = datetime.fromtimestamp(now, UTC)
    archive = Archive(Path(state) / "archive")
    done = collect(_place(**exchange), site, archive, moment, take_over=take_over)
    document = {
        "time": moment.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "command": "collect",
        "site": site,
        "verdict": "done",
        **asdict(done),
        "newest": None if done.newest is None else done.newest.strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    folder = site_folder(Path(state), site)
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / COLLECTED, json.dumps(document).encode())
    if done.notes:
        history.append(folder, document)
    if forward_to is not None:
        forward(archive, site, forward_to, moment.date() + timedelta(days=1))
    return document


def recalibrate_site(
    file: str,
    state: str,
    exchange: Exchange,
    keys: str,
    now: float,
    *,
    publish: bool,
    force: bool,
    days: int,
) -> dict[str, Any]:
    """Diagnose one site, and publish what is better where `publish` says so; an error is a verdict."""
    from igrow.trainer.publishing import publish as publish_bundle  # noqa: PLC0415  (collecting needs no signatures)

    site = load_site(file)
    turn = recalibrate(
        site,
        Archive(Path(state) / "archive"),
        site_folder(Path(state), site.name),
        partial(publish_bundle, exchange=_place(**exchange), keys=keys) if publish else None,
        now=datetime.fromtimestamp(now, UTC),
        days=days,
        force=force,
    )
    return turn.to_json()


def learn_from_site(file: str, state: str, now: float, *, days: int) -> dict[str, Any]:
    """Fit one site by itself, and keep what that says of it, means and variances in `learned.json`.

    Raises:
        IgrowError: nothing was collected of it, or its log cannot be fitted to.
    """
    from igrow.trainer.calibration import calibrate  # noqa: PLC0415
    from igrow.trainer.data import prepare_log  # noqa: PLC0415  (collecting needs no fits)
    from igrow.trainer.diagnosis import learned_from  # noqa: PLC0415

    site, moment = load_site(file), datetime.fromtimestamp(now, UTC)
    start, end = (moment - timedelta(days=days)).date(), moment.date() + timedelta(days=2)
    log = Archive(Path(state) / "archive").read(site.name, start, end)
    if len(log.telemetry) == 0:
        raise IgrowError(f"no telemetry of site {site.name} in the last {days} days: nothing was collected of it")
    learned = learned_from(calibrate(prepare_log(log.telemetry, site, name=site.name)))
    folder = site_folder(Path(state), site.name)
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / LEARNED, json.dumps(asdict(learned)).encode())
    seen = f"{len(learned.shift)} parameters, effects and patterns were seen in its log"
    return {"site": site.name, "note": seen}


def calibrate_site(
    file: str, state: str, exchange: Exchange, keys: str, now: float, *, days: int, population: str | None
) -> dict[str, Any]:
    """Calibrate a site that has no bundle of its own yet, and publish it; an error is a verdict."""
    from igrow.trainer.publishing import publish  # noqa: PLC0415
    from igrow.trainer.service.first_calibration import calibrate_first  # noqa: PLC0415

    site = load_site(file)
    turn = calibrate_first(
        site,
        Archive(Path(state) / "archive"),
        site_folder(Path(state), site.name),
        partial(publish, exchange=_place(**exchange), keys=keys),
        now=datetime.fromtimestamp(now, UTC),
        days=days,
        population=None if population is None else Path(population),
    )
    return turn.to_json()


def publish_site(site: str, state: str, exchange: Exchange, keys: str, now: float, *, again: bool) -> dict[str, Any]:
    """Sign a site's bundles again where the signatures expire soon; with `again` publish its bundle once more."""
    from igrow.trainer.publishing import publish_in, refresh, repository_of  # noqa: PLC0415
    from igrow.trainer.publishing.repository import lacks_root, targets_hold_until  # noqa: PLC0415

    repository, moment = repository_of(_place(**exchange), site), datetime.fromtimestamp(now, UTC)
    folder = site_folder(Path(state), site)
    stamp = repository.get("metadata/timestamp.json", LARGEST_DOCUMENT)
    # What names the bundle holds for a year, and only publishing the bundle again renews it.
    if again or (stamp is not None and targets_hold_until(repository, Path(keys)) - moment <= REFRESH_BEFORE):
        reports, _ = Archive(Path(state) / "archive").reports(site)
        bundle, _ = bundle_in_force(folder, reports)
        if bundle.manifest.site != site:
            return {"site": site, "note": "nothing was published for it yet"}
        publish_in(bundle.folder, repository, Path(keys), now=moment)
        return {"site": site, "note": f"published {bundle.label} again"}
    if stamp is None:
        return {"site": site, "note": "nothing was published for it yet"}
    expires = datetime.fromisoformat(str(parse_object(stamp, "timestamp.json").get("signed", {}).get("expires", "")))
    if expires - moment > REFRESH_BEFORE and not lacks_root(repository, Path(keys)):
        return {"site": site, "note": f"signed until {expires:%Y-%m-%d}"}
    refresh(repository, Path(keys), now=moment)
    return {"site": site, "note": "signed again"}


def _place(url: str, base: str, known_hosts: str | None, identity: str | None) -> Place:
    """Open an exchange by what a task is given of it."""
    return open_place(url, base=Path(base), known_hosts=known_hosts, identity=identity)
