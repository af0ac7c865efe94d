"""The limits that a crop states. Defaults are those of tomato.

| limit | default | source |
|---|---|---|
| dark hours | 6 h a night | Velez-Ramirez et al. (2012), Acta Hort. 956, 51-57: six hours of darkness are needed; Demers and Gosselin (2002), Acta Hort. 580, 83-88: no gain beyond 14 h of light, chlorosis under continuous light |
| temperature by day | 17 to 24 degC | Adams, Cockshull and Cave (2001), Annals of Botany 88, 869-877: few flowers and poor set at 26 degC; two kelvin are left to the sun |
| temperature at night | 15 to 20 degC | the same: small fruits without seed at 14 degC |
| mean of a day | 17 to 22 degC | the same: fruit ripens in 95, 65, 46 and 42 d at 14, 18, 22 and 26 degC |
| difference within a day | 8 K | growers' practice; Khanal et al. (2013), American J. of Plant Sciences 4(7A), found pollen unharmed up to 13 K |
| drift | 2 K h-1 | growers' practice: fruit warms slower than air, and wets where the air runs ahead |
| light sum | 30 mol m-2 d-1 | growers' practice; no harm is published at a threshold |
| CO2 with people inside | 5000 ppm | Directive 2006/15/EC, mean of a working day |
| damp hours | 12 h a day above `humidity_high` or below 0.2 kPa | growers' practice for the hours; O'Neill, Shtienberg and Elad (1997), Plant Disease 81, 36-40, for the deficit: below it wounds stay open to Botrytis and spores form |
| rest | lamps 1 h on, 30 min off; irrigation 3 min and 3 min | manufacturers of lamps and valves |

Temperatures bound what is asked of the heating; the sun may warm the air beyond.
"""  # noqa: E501 - rows of a table

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

from igrow.core.yaml_schema import SettingError, setting

ZERO, DAY = datetime.timedelta(0), datetime.timedelta(days=1)


@dataclass(frozen=True)
class Band:
    """Lowest and highest temperature, degC."""

    low: float = setting(unit="degC", low=0, high=40, help="lowest")
    high: float = setting(unit="degC", low=0, high=40, help="highest")

    def __post_init__(self) -> None:
        if self.low >= self.high:
            raise SettingError(f"low {self.low:g} must lie below high {self.high:g}", "low")


@dataclass(frozen=True)
class Rest:
    """Least times between switching, so that equipment lasts."""

    on: datetime.timedelta = setting(low=ZERO, high=DAY, default=ZERO, help="least time on")
    off: datetime.timedelta = setting(low=ZERO, high=DAY, default=ZERO, help="least time off")


def _rest() -> Mapping[str, Rest]:
    minutes = datetime.timedelta(minutes=1)
    return {"lamp_on": Rest(60 * minutes, 30 * minutes), "irrigation_on": Rest(3 * minutes, 3 * minutes)}


@dataclass(frozen=True)
class Agronomy:
    """What no plan may leave."""

    dark_hours: float = setting(
        unit="h", low=0, high=16, default=6.0, help="least time of each night without lamps, in one stretch"
    )
    day_temperature: Band = setting(
        help="heating setpoint while the sun is up", default_factory=lambda: Band(17.0, 24.0)
    )
    night_temperature: Band = setting(
        help="heating setpoint while the sun is down", default_factory=lambda: Band(15.0, 20.0)
    )
    mean_temperature: Band = setting(
        help="mean heating setpoint of a local day", default_factory=lambda: Band(17.0, 22.0)
    )
    temperature_difference: float = setting(
        unit="K", low=1, high=30, default=8.0, help="largest difference of the heating setpoint within a local day"
    )
    temperature_drift: float = setting(
        unit="K h-1", low=0.1, high=20, default=2.0, help="fastest change of the heating setpoint"
    )
    dead_zone: float = setting(
        unit="K", low=0, high=10, default=1.0, help="least that vents begin to open above the heating setpoint"
    )
    light_sum_high: float = setting(
        unit="mol m-2 d-1", low=1, high=100, default=30.0, help="light of sun and lamps beyond which no lamp may add"
    )
    co2_with_people: float = setting(
        unit="ppm", low=400, high=5000, default=5000.0, help="highest CO2 setpoint while people work inside"
    )
    people_from: datetime.time = setting(default=datetime.time(7), help="local time at which people come")
    people_until: datetime.time = setting(default=datetime.time(17), help="local time at which they have left")
    damp_hours: float = setting(
        unit="h", low=0, high=24, default=12.0, help="most hours a day that a plan may expect to be damp"
    )
    deficit_low: float = setting(
        unit="kPa", low=0, high=2, default=0.2, help="a smaller vapour pressure deficit counts as damp"
    )
    rest: Mapping[str, Rest] = setting(
        keys=("lamp_on", "irrigation_on"), default_factory=_rest, help="least times between switching"
    )

    def __post_init__(self) -> None:
        bands = {name: getattr(self, name) for name in ("day_temperature", "night_temperature", "mean_temperature")}
        for (first, one), (second, other) in combinations(bands.items(), 2):
            if min(one.high, other.high) < max(one.low, other.low):
                raise SettingError(f"{first} and {second} have no temperature in common", second)

    @property
    def anchor(self) -> float:
        """A temperature that may be held day and night, degC: the middle of what all bands have in common."""
        bands = (self.day_temperature, self.night_temperature, self.mean_temperature)
        return 0.5 * (max(band.low for band in bands) + min(band.high for band in bands))
