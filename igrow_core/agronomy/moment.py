"""What calendar and sun say of an instant at a place."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass

from igrow.core.local_time import zone
from igrow.core.site import Agronomy, Site
from igrow.core.sun import declination_and_equation, position

PHOTONS = 2.1
"""umol of PAR per J of global radiation: 46 % of it is PAR, at 4.57 umol J-1."""
_DAY = 86_400.0
TOMORROW = _DAY - 1800.0
"""From a sunset to the next, s: it comes earlier by minutes at most, but where the sun soon stays down."""


@dataclass(frozen=True)
class Place:
    """Where a crop stands, under what light, and what its limits are."""

    limits: Agronomy
    latitude: float
    longitude: float
    time_zone: str
    drift: float
    """Fastest change of the heating setpoint, K h-1: the crop's, or the setpoint's own where that is slower."""
    transmissivity: float
    """PAR above the crop per PAR outside."""
    lamp_light: float
    """PAR of all lamps, mol m-2 h-1."""

    @classmethod
    def of(cls, site: Site) -> Place:
        """Return that of a site."""
        greenhouse, limits = site.greenhouse, site.crop.agronomy
        slew = site.limits.heating_setpoint.slew
        return cls(
            limits=limits,
            latitude=site.latitude,
            longitude=site.longitude,
            time_zone=site.time_zone,
            drift=min(limits.temperature_drift, math.inf if slew is None else slew),
            transmissivity=greenhouse.cover_transmissivity,
            lamp_light=greenhouse.lamps.power * greenhouse.lamps.efficacy * 3.6e-3 if greenhouse.lamps else 0.0,
        )

    def sunlight(self, radiation: float) -> float:
        """Return the sun's PAR above the crop, mol m-2 h-1, at a global radiation in W m-2."""
        return radiation * PHOTONS * 3.6e-3 * self.transmissivity


@dataclass(frozen=True)
class Moment:
    """An instant, UTC."""

    seconds: float
    """Since 1970."""
    night: int
    """Number of the night that runs, or comes next, from one solar noon to the next."""
    night_begins: float
    """Seconds since 1970 at which its sun sets (its noon where the sun stays down)."""
    night_ends: float
    """At which it rises again; not later than the next noon, not before `night_begins`."""
    day: int
    """Number of the local day."""
    hour: float
    """Hours since that day began."""
    hours_left: float
    """Hours until it ends."""
    clock: float
    """Local hour as a clock shows it."""

    @property
    def sun_up(self) -> bool:
        """Tell whether the sun is up."""
        return not self.night_begins <= self.seconds < self.night_ends

    @property
    def hours_to_change(self) -> float:
        """Hours until the sun sets or rises."""
        changes = (self.night_begins, self.night_ends, self.night_begins + TOMORROW)
        return min((one - self.seconds) / 3600.0 for one in changes if one > self.seconds)


def moment(place: Place, seconds: float) -> Moment:
    """Return what calendar and sun say at `seconds` since 1970 UTC.

    The half length of a day is arccos(-tan(latitude) tan(declination)) (Spencer 1971, Search 2, 172).
    """
    solar = float(position(math, seconds, place.latitude, place.longitude)[2])
    noon = seconds - (solar - 12.0) % 24.0 * 3600.0
    declination, _ = declination_and_equation(math, noon + 0.5 * _DAY)
    cosine = -math.tan(math.radians(place.latitude)) * math.tan(declination)
    half_day = math.acos(min(1.0, max(-1.0, cosine))) * (12.0 / math.pi)
    local = datetime.datetime.fromtimestamp(seconds, zone(place.time_zone))
    midnight = local.replace(hour=0, minute=0, second=0, microsecond=0, fold=0)
    return Moment(
        seconds=seconds,
        night=round((noon + 240.0 * place.longitude) / _DAY - 0.5),
        night_begins=noon + half_day * 3600.0,
        night_ends=noon + (24.0 - half_day) * 3600.0,
        day=local.toordinal(),
        hour=(seconds - midnight.timestamp()) / 3600.0,
        hours_left=((midnight + datetime.timedelta(days=1)).timestamp() - seconds) / 3600.0,
        clock=local.hour + local.minute / 60.0 + local.second / 3600.0,
    )
