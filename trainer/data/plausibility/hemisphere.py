"""Days that are as long as on the other side of the equator: the sign of the site's latitude is wrong."""

from __future__ import annotations

import numpy as np

from igrow.core import sun
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault

HIGH = 5.0
"""Degrees above the horizon from which on some light always comes, and below it from which on none does."""
LIGHT, DARK = 20.0, 1.0
"""W m-2 that no night shows, not even by a sensor's offset, and that every hour of day exceeds."""
LEAST_SHARE, LEAST_RATIO = 0.04, 4.0
"""Share of a log's rows that are against the sun, and how many times those that would be on the other side."""


def other_hemisphere(telemetry: Telemetry, site: Site) -> DataFault | None:
    """Return the fault of a latitude whose sign is wrong; around the equinoxes nothing can be said."""
    here, there = (_against(telemetry, latitude, site.longitude) for latitude in (site.latitude, -site.latitude))
    if here < LEAST_SHARE or here < LEAST_RATIO * there:
        return None
    right = f"{-site.latitude:g}"
    seen = f"days and nights are not as long as at latitude {site.latitude:g}, but as at {right}"
    mend = f"north is positive and south is negative: latitude: {right} in the site file"
    return DataFault("latitude", "", seen, mend)


def _against(telemetry: Telemetry, latitude: float, longitude: float) -> float:
    """Return the share of the readings that are light by night or dark by day."""
    height, light = sun.elevation(telemetry.time, latitude, longitude), telemetry["global_radiation"]
    known = np.isfinite(light)
    wrong = ((height < -HIGH) & (light > LIGHT)) | ((height > HIGH) & (light < DARK))
    return float(wrong[known].mean())
