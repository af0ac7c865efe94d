"""The fleet's page: static files that any web server can serve, with each site's report beside them.

Who needs attention first stands first; a large fleet goes on over further pages, so that a telephone opens each.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from jinja2 import Environment, PackageLoader, select_autoescape

from igrow.core.whole_files import write_whole
from igrow.trainer.fleet.overview import SiteRow, utc

SITES = 500
"""On one page: a quarter of a megabyte."""


def write_page(folder: Path, rows: Sequence[SiteRow], now: datetime) -> Path:
    """Write `index.html`, what follows it, and the sites' reports into a folder; returns the first. Raises OSError."""
    reports = folder / "sites"
    reports.mkdir(parents=True, exist_ok=True)
    links = {}
    for row in rows:
        if row.report is not None:
            target = reports / f"{row.site}.html"
            if not target.exists() or target.stat().st_mtime_ns != row.report.stat().st_mtime_ns:
                shutil.copy2(row.report, target)
            links[row.site] = f"sites/{row.site}.html"
    environment = Environment(loader=PackageLoader("igrow.trainer.fleet"), autoescape=select_autoescape())
    template = environment.get_template("fleet.html")
    parts = [rows[first : first + SITES] for first in range(0, len(rows), SITES)] or [rows]
    names = ["index.html", *(f"page-{number}.html" for number in range(2, len(parts) + 1))]
    waiting = sum(1 for row in rows if row.attention)
    for place, (name, part) in enumerate(zip(names, parts, strict=True)):
        text = template.render(
            rows=part, total=len(rows), before=SITES * place, links=links, now=now, utc=utc, waiting=waiting,
            names=names, name=name,
        )  # fmt: skip
        write_whole(folder / name, text.encode())
    for old in folder.glob("page-*.html"):
        if old.name not in names:
            old.unlink()
    return folder / names[0]
