"""The fleet's page: one static file that any web server can serve, with each site's report beside it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from jinja2 import Environment, PackageLoader, select_autoescape

from igrow.core.whole_files import write_whole
from igrow.trainer.fleet.overview import SiteRow, utc


def write_page(folder: Path, rows: Sequence[SiteRow], now: datetime) -> Path:
    """Write `index.html` and the sites' reports into a folder; returns the page. Raises OSError."""
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
    text = environment.get_template("fleet.html").render(
        rows=rows, links=links, now=now, utc=utc, waiting=sum(1 for row in rows if row.attention)
    )
    page = folder / "index.html"
    write_whole(page, text.encode())
    return page
