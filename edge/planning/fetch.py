"""Fetches a forecast from Open-Meteo into the file that plans read; run by `igrow-edge forecast`, never by the daemon.

What comes is read as a plan would read it before it takes the old file's place, so that a page of an error or half an
answer changes nothing.
"""

from __future__ import annotations

import http.client
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import LARGEST_DOCUMENT
from igrow.core.site import Site
from igrow.edge.planning.open_meteo import COLUMNS, read_forecast

FORECAST = "https://api.open-meteo.com/v1/forecast"
ENSEMBLE = "https://ensemble-api.open-meteo.com/v1/ensemble"
ENSEMBLE_MODEL = "icon_seamless"
SECONDS = 30.0
"""Longest wait for the server."""
EXTRA_DAYS = 2
"""Beyond the plan's horizon: the day after it, and the one that has begun."""


def address(site: Site, server: str | None, ensemble: bool) -> str:
    """Return the address of a forecast for a site, from Open-Meteo or from another server that speaks its language."""
    days = EXTRA_DAYS + -(-site.planning.horizon.total_seconds() // 86_400)
    asked = {
        "latitude": f"{site.latitude:g}",
        "longitude": f"{site.longitude:g}",
        "elevation": f"{site.elevation:g}",
        "hourly": ",".join(COLUMNS),
        "wind_speed_unit": "ms",
        "timeformat": "unixtime",
        "forecast_days": f"{min(days, 16):.0f}",
    }
    if ensemble:
        asked["models"] = ENSEMBLE_MODEL
    return f"{server or (ENSEMBLE if ensemble else FORECAST)}?{urllib.parse.urlencode(asked, safe=',')}"


def fetch(url: str, path: Path) -> int:
    """Bring the forecast at an address into a file, and return how many members it has.

    Raises IgrowError where the server does not answer, or not with a forecast; the file then stays as it was.
    """
    try:
        with urllib.request.urlopen(url, timeout=SECONDS) as answer:
            content = answer.read(LARGEST_DOCUMENT + 1)
    except urllib.error.HTTPError as error:
        raise IgrowError(f"{url}: the server says {error.code} {error.reason}") from None
    except (OSError, ValueError, http.client.HTTPException) as error:
        reason = getattr(error, "reason", None) or error
        raise IgrowError(f"{url}: no answer: {reason}") from None
    if len(content) > LARGEST_DOCUMENT:
        raise IgrowError(f"{url}: the answer is larger than {LARGEST_DOCUMENT >> 20} MiB, which is no forecast")
    partial = path.with_name(f".{path.stem}.partial.json")
    try:
        partial.write_bytes(content)
        members = len(read_forecast(partial))
        partial.replace(path)
    except OSError as error:
        raise IgrowError(f"{path}: cannot be written: {error.strerror}") from None
    finally:
        partial.unlink(missing_ok=True)
    return members
