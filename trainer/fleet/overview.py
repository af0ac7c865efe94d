"""What is known of each site, from the trainer's own files alone: no exchange and no gateway is asked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import read_object
from igrow.trainer.fleet.registry import Entry, Registry
from igrow.trainer.fleet.work import COLLECTED
from igrow.trainer.service import history
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.ledger import read_ledger
from igrow.trainer.service.recalibration import COMMAND, next_run
from igrow.trainer.service.site_memory import bundle_in_force, refused_bundles, site_folder

SILENT = timedelta(days=2)
"""A site without a row for longer than this has a broken link."""
VERDICTS_OPEN = ("named", "ambiguous", "unexplained", "data_fault")


@dataclass(frozen=True)
class SiteRow:
    """One line of the page."""

    site: str
    attention: int
    """The higher, the sooner somebody should look."""
    reasons: tuple[str, ...]
    """Why, the gravest first."""
    newest: datetime | None
    """Time of the newest row of its log."""
    model: str
    """The bundle in force."""
    finding: str
    """What the last diagnosis said."""
    worth: float | None
    """What the finding takes from the whole greenhouse, EUR a week by the site's prices; None where nothing tells."""
    error_before: float | None
    error_after: float | None
    """Air temperature a day ahead, live at the gateway before and after the newest adoption (K)."""
    next_run: datetime | None
    report: Path | None
    paused: bool = False


def overview(registry: Registry, now: datetime) -> list[SiteRow]:
    """Return all sites, who needs attention first."""
    rows = [_row_of_any(registry, entry, now) for entry in registry.entries]
    rows += [_broken(name, problem) for name, problem in registry.problems.items()]
    return sorted(rows, key=lambda row: (-row.attention, -(row.worth or 0.0), row.site))


def _broken(name: str, problem: str) -> SiteRow:
    return SiteRow(name, 100, (problem,), None, "", "", None, None, None, None, None)


def _row_of_any(registry: Registry, entry: Entry, now: datetime) -> SiteRow:
    try:
        return _row(registry, entry, now)
    except Exception as error:  # whatever lies in one site's folder, the others are shown
        what = str(error) if isinstance(error, IgrowError | OSError) else f"{type(error).__name__}: {error}"
        folder = site_folder(registry.state, entry.site.name)
        return _broken(
            entry.site.name,
            f"its files cannot be shown: {what}; look into {folder}, and put back or delete what is odd",
        )


def _row(registry: Registry, entry: Entry, now: datetime) -> SiteRow:
    name, archive = entry.site.name, Archive(registry.state / "archive")
    folder = site_folder(registry.state, name)
    lines = history.read(folder)
    reports, _ = archive.reports(name)
    bundle, _ = bundle_in_force(folder, reports)
    newest = read_ledger(archive.root, name).newest
    diagnosis = read_object(folder / "diagnosis" / "diagnosis.json")
    last: Mapping[str, Any] = next((line for line in reversed(lines) if line.get("command") == COMMAND), {})
    collected = read_object(folder / COLLECTED)
    reasons: list[tuple[int, str]] = []
    failed = _last_failure(lines)
    if failed:
        reasons.append((90, failed))
    if newest is None:
        reasons.append((70, f"nothing was ever collected: does its gateway run, and is its exchange {entry.exchange}?"))
    elif now - newest > SILENT:
        days = (now - newest).days
        reasons.append((80, f"silent for {days} days: does its gateway run, and does it reach the exchange?"))
    reasons += [(60, str(note)) for note in collected.get("notes", [])[:3]]
    if last.get("verdict") in VERDICTS_OPEN:
        causes = ", ".join(map(str, last.get("causes", []))).replace("_", " ")
        reasons.append(
            (50, f"finding: {causes or str(last['verdict']).replace('_', ' ')}; the report says what to look at")
        )
    if reports and str(reports[-1].get("identity")) in refused_bundles(reports):
        reasons.append(
            (40, f"the gateway {str(reports[-1].get('verdict')).replace('_', ' ')}: {reports[-1].get('reason')}")
        )
    reasons.sort(key=lambda one: -one[0])
    before, after = _live(reports)
    report = folder / "diagnosis" / "report.html"
    return SiteRow(
        name,
        0 if entry.paused or not reasons else reasons[0][0],
        ("paused",) if entry.paused else tuple(text for _, text in reasons),
        newest,
        bundle.label,
        _finding(diagnosis),
        _worth(diagnosis),
        before,
        after,
        next_run(entry.site, folder),
        report if report.exists() else None,
        entry.paused,
    )


def _last_failure(lines: list[dict[str, Any]]) -> str:
    """Return the sentence of each command whose last run was an error."""
    newest = {str(line.get("command")): line for line in lines}
    return "; ".join(
        f"{command} failed: {line.get('note', '')} (tried again at the next run)"
        for command, line in newest.items()
        if line.get("verdict") == "error"
    )


def _finding(diagnosis: Mapping[str, Any]) -> str:
    findings = diagnosis.get("findings") or []
    if findings:
        return "; ".join(str(one.get("sentence") or one.get("effect")) for one in findings if isinstance(one, dict))
    return str(diagnosis.get("verdict") or "")


def _worth(diagnosis: Mapping[str, Any]) -> float | None:
    found = [one.get("eur_per_week") for one in diagnosis.get("findings") or [] if isinstance(one, dict)]
    known = [float(value) for value in found if isinstance(value, int | float)]
    return sum(known) if known else None


def _live(reports: list[Mapping[str, Any]]) -> tuple[float | None, float | None]:
    """Return the live errors before and after the newest adoption that a report tells of."""
    for report in reversed(reports):
        live = report.get("live_error")
        if isinstance(live, dict) and live:
            values = [
                float(one["air_temperature 24_h"])
                if isinstance(one := live.get(side), dict) and isinstance(one.get("air_temperature 24_h"), int | float)
                else None
                for side in ("before", "after")
            ]
            return values[0], values[1]
    return None, None


def utc(moment: datetime | None) -> str:
    """Return a time for people."""
    return "" if moment is None else moment.astimezone(UTC).strftime("%Y-%m-%d %H:%M")
