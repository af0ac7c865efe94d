"""`igrow-trainer recalibrate`: diagnose every site of an exchange, and publish what is better on unseen days.

    exchange/telemetry --> diagnose against the bundle in force --> better? --> publish --> history
                                        ^                                        |
                                        +--------- the gateway's reports <-------+

The state folder holds a folder for each site: `bundles/` with what was published, the newest last, `history.jsonl`
with one line a run, and the last diagnosis. A bundle that the gateway marked as rejected is not built upon.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from igrow.core.bundle import Bundle, default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.site import Site, load_site
from igrow.trainer.cli.diagnose import write, write_corrected
from igrow.trainer.diagnosis.deployed import from_manifest
from igrow.trainer.diagnosis.diagnose import diagnose
from igrow.trainer.diagnosis.result import Diagnosis
from igrow.trainer.publishing import publish
from igrow.trainer.publishing.exchange import read_exchange

EXAMPLE = "igrow-trainer recalibrate --exchange /srv/igrow --keys keys --state state --site site.yaml"
REPOSITORY = "bundles"
"""Folder of the signed repository inside the exchange."""
KEPT = 5
"""Published bundles that are kept for each site."""
LEAST_GAIN = 0.01
"""Relative fall of the 24 h error on unseen days, mean over quantities, that is worth a new bundle."""

Publish = Callable[[Path], object]


@dataclass(frozen=True)
class Turn:
    """What one run did for one site: a line of its history."""

    site: str
    time: datetime
    verdict: str
    published: bool
    note: str
    causes: tuple[str, ...] = ()
    gain: float = 0.0
    """Relative fall of the 24 h error on unseen days against the bundle in force."""

    def to_json(self) -> dict[str, Any]:
        """Return the line of the history."""
        return {
            "time": self.time.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "site": self.site,
            "verdict": self.verdict,
            "causes": list(self.causes),
            "gain": round(self.gain, 4),
            "published": self.published,
            "note": self.note,
        }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--exchange", type=Path, required=True, help="folder that gateways and trainer share")
    parser.add_argument("--keys", type=Path, required=True, help="folder of the signing keys")
    parser.add_argument("--state", type=Path, required=True, help="folder of the histories and published bundles")
    parser.add_argument("--site", type=Path, action="append", required=True, help="a site's YAML file; may be repeated")
    parser.add_argument("--days", type=int, default=56, help="newest days of the log to look at (default 56)")
    parser.add_argument("--force", action="store_true", help="run also where the site's pace says not yet")


def run(arguments: argparse.Namespace) -> int:
    """Run every site once; one site's trouble does not stop the others."""
    sites = [load_site(path) for path in arguments.site]
    repository = arguments.exchange / REPOSITORY
    trouble = False
    for site in sites:
        turn = recalibrate(
            site,
            arguments.exchange,
            arguments.state,
            lambda folder: publish(folder, repository, arguments.keys),
            now=datetime.now(UTC),
            days=arguments.days,
            force=arguments.force,
        )
        trouble |= turn.verdict == "error"
        causes = f" ({', '.join(turn.causes)})" if turn.causes else ""
        print(f"{turn.site}: {turn.verdict}{causes}; {turn.note}")
    return 2 if trouble else 0


def recalibrate(
    site: Site,
    exchange: Path,
    state: Path,
    publish_bundle: Publish,
    *,
    now: datetime,
    days: int = 56,
    force: bool = False,
) -> Turn:
    """Diagnose one site and publish a better bundle; what happened goes into its history.

    Args:
        site: whose log it is.
        exchange: folder with ``telemetry/<site>``.
        state: folder that holds this loop's memory.
        publish_bundle: is called with the folder of a bundle that passed.
        now: the time, UTC.
        days: newest days of the log to look at.
        force: run also before the site's pace says so.
    """
    folder = state / site.name
    folder.mkdir(parents=True, exist_ok=True)
    history = read_history(folder)
    due = last_time(history) + site.planning.recalibrate_every if history else now
    if now < due and not force:
        return Turn(site.name, now, "waiting", False, f"next at {due:%Y-%m-%d %H:%M} UTC")
    try:
        turn = _run(site, exchange, folder, publish_bundle, now, days)
    except IgrowError as error:
        turn = Turn(site.name, now, "error", False, str(error))
    with (folder / "history.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps(turn.to_json()) + "\n")
    return turn


def _run(site: Site, exchange: Path, folder: Path, publish_bundle: Publish, now: datetime, days: int) -> Turn:
    log = read_exchange(exchange, site.name, start=(now - timedelta(days=days)).date())
    bundle = bundle_in_force(folder, log.reports)
    deployed = from_manifest(bundle.manifest, site)
    diagnosis, evidence = diagnose(log.telemetry, site, deployed)
    write(folder / "diagnosis", diagnosis, evidence, deployed)
    gain = relative_gain(diagnosis)
    causes = tuple(one.effect for one in diagnosis.findings)
    if evidence is None:
        return Turn(site.name, now, diagnosis.verdict, False, "; ".join(diagnosis.notes), causes)
    if gain < LEAST_GAIN:
        note = f"the bundle in force stays: the new model is only {100 * gain:.1f} % better on unseen days"
        return Turn(site.name, now, diagnosis.verdict, False, note, causes, gain)
    fresh = folder / "bundles" / now.strftime("%Y%m%dT%H%M%SZ")
    fresh.parent.mkdir(exist_ok=True)
    write_corrected(fresh, bundle, site, diagnosis, evidence)
    publish_bundle(fresh)
    for old in sorted(fresh.parent.iterdir())[:-KEPT]:
        shutil.rmtree(old)
    note = f"published {fresh.name}: {100 * gain:.1f} % less error a day ahead on unseen days"
    return Turn(site.name, now, diagnosis.verdict, True, note, causes, gain)


def relative_gain(diagnosis: Diagnosis) -> float:
    """Return the relative fall of the 24 h error on unseen days, mean over quantities (0 where none is known)."""
    falls = [
        1.0 - day["corrected"] / day["deployed"]
        for horizons in diagnosis.errors.values()
        if (day := horizons.get("24_h")) and day.get("deployed", 0.0) > 0.0 and "corrected" in day
    ]
    return sum(falls) / len(falls) if falls else 0.0


def bundle_in_force(folder: Path, reports: Sequence[Mapping[str, object]]) -> Bundle:
    """Return the newest published bundle that no gateway rejected; the default bundle where there is none."""
    rejected = {str(report.get("identity")) for report in reports if report.get("verdict") in {"rejected", "withdrawn"}}
    published = sorted((folder / "bundles").glob("*"), reverse=True) if (folder / "bundles").is_dir() else []
    for candidate in published:
        if candidate.name.endswith(".new"):
            continue
        bundle = read_bundle(candidate)
        if bundle.identity not in rejected:
            return bundle
    return read_bundle(default_bundle_folder())


def read_history(folder: Path) -> list[dict[str, Any]]:
    """Return the lines of a site's history, oldest first."""
    path = folder / "history.jsonl"
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]


def last_time(history: Sequence[Mapping[str, Any]]) -> datetime:
    """Return when the last run was."""
    return datetime.fromisoformat(str(history[-1]["time"]))
