"""The physical parameters of the hybrid climate stage: value, unit, prior spread, bounds and source of each.

The spread is the standard deviation of what is known before any log of the site has been seen, relative to the
value. Calibration starts from it; a bundle carries the posterior, which is the prior of the next diagnosis.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class PhysicalParameter:
    """One parameter of the balances."""

    name: str
    unit: str
    value: float
    """Value for a modern Venlo greenhouse with tomato, before the site's own description is applied."""
    spread: float
    """Relative standard deviation of the prior."""
    low: float
    high: float
    meaning: str
    source: str


_ROWS = (
    # thermal
    (
        "heat_capacity_factor",
        "1",
        3.0,
        0.3,
        1.0,
        12.0,
        "heat capacity of air, crop and light structure over that of the air alone",
        "Bot (1983)",
    ),
    (
        "cover_heat_transfer",
        "W m-2 K-1",
        5.5,
        0.2,
        1.0,
        15.0,
        "heat transfer from air to outside through the cover, per floor area",
        "De Zwart (1996)",
    ),
    (
        "cover_wind_heat_transfer",
        "W m-2 K-1 (m s-1)-1",
        0.15,
        0.5,
        0.0,
        1.5,
        "rise of it with the wind speed",
        "Bot (1983)",
    ),
    (
        "sky_share",
        "1",
        0.15,
        0.5,
        0.0,
        0.6,
        "weight of the sky, against outdoor air, as what the cover sees",
        "De Zwart (1996)",
    ),
    (
        "energy_screen_saving",
        "1",
        0.45,
        0.25,
        0.0,
        0.9,
        "share of the cover's heat loss that a closed energy screen saves",
        "Bailey (1988)",
    ),
    ("blackout_screen_saving", "1", 0.4, 0.3, 0.0, 0.9, "the same for the blackout screen", "Bailey (1988)"),
    (
        "second_screen_share",
        "1",
        0.6,
        0.5,
        0.0,
        1.0,
        "share of its own saving that the lesser of two closed screens adds: 0.7 where both are resistances in "
        "series, 0 where they are as one",
        "ISO 6946 (2017)",
    ),
    (
        "rail_pipe_heat_transfer",
        "W m-2 K-1",
        2.1,
        0.1,
        0.2,
        6.0,
        "heat from the rail pipe to the air",
        "Hemming et al. (2020), data documentation",
    ),
    (
        "grow_pipe_heat_transfer",
        "W m-2 K-1",
        0.62,
        0.15,
        0.05,
        3.0,
        "heat from the grow pipe to the air",
        "Hemming et al. (2020), data documentation",
    ),
    (
        "lamp_heat_share",
        "1",
        0.55,
        0.2,
        0.1,
        1.0,
        "share of the lamps' electric power that warms the air directly",
        "Katzin et al. (2020)",
    ),
    (
        "lamp_radiation_share",
        "1",
        0.3,
        0.25,
        0.05,
        0.7,
        "share of it that reaches the crop as radiation",
        "Katzin et al. (2020)",
    ),
    ("transmissivity", "1", 0.6, 0.12, 0.2, 0.95, "short-wave radiation that passes the cover", "De Zwart (1996)"),
    (
        "solar_heat_share",
        "1",
        0.65,
        0.2,
        0.1,
        1.1,
        "share of the transmitted radiation that crop and air take up",
        "Vanthoor (2011)",
    ),
    ("mass_solar_share", "1", 0.15, 0.4, 0.0, 0.6, "share that the floor takes up", "Vanthoor (2011)"),
    ("mass_heat_transfer", "W m-2 K-1", 5.0, 0.3, 0.5, 25.0, "heat transfer between air and floor", "De Zwart (1996)"),
    (
        "mass_heat_capacity",
        "kJ m-2 K-1",
        120.0,
        0.4,
        20.0,
        1500.0,
        "heat capacity of the floor that follows within a day",
        "De Zwart (1996)",
    ),
    (
        "soil_heat_transfer",
        "W m-2 K-1",
        3.0,
        0.5,
        0.0,
        12.0,
        "heat transfer between floor and the soil that follows within days",
        "De Zwart (1996)",
    ),
    # air exchange
    (
        "leakage_still",
        "h-1",
        0.1,
        0.5,
        0.0,
        2.0,
        "air changes through the closed envelope without wind",
        "Vanthoor (2011)",
    ),
    ("leakage_wind", "h-1 (m s-1)-1", 0.06, 0.25, 0.0, 0.6, "rise of them with the wind speed", "Vanthoor (2011)"),
    (
        "vent_wind",
        "1",
        0.010,
        0.3,
        0.0005,
        0.08,
        "air exchange per floor area of fully open lee vents at 1 m/s",
        "De Jong (1990)",
    ),
    (
        "vent_curvature",
        "1",
        0.5,
        0.8,
        -0.95,
        1.0,
        "how early the flow past the lee vents saturates: 1 + this is the slope at the first opening over the mean",
        "De Jong (1990): 0.9 for vents that open to 44 degrees",
    ),
    (
        "vent_windward_ratio",
        "1",
        1.5,
        0.25,
        0.3,
        5.0,
        "effect of a windward vent over that of a lee vent",
        "De Jong (1990)",
    ),
    (
        "vent_stack",
        "m s-1 K-0.5",
        0.004,
        0.4,
        0.0,
        0.04,
        "air exchange of fully open vents for 1 K",
        "Boulard and Baille (1995)",
    ),
    (
        "screen_air_resistance",
        "s m-1",
        3000.0,
        0.6,
        100.0,
        60000.0,
        "of closed screens to the air that passes them, for 1 K between below and above",
        "Balemans (1989) in Vanthoor (2011), and a gap of one part in a hundred",
    ),
    # vapour
    (
        "transpiration_radiation",
        "1",
        0.45,
        0.2,
        0.05,
        1.2,
        "share of the radiation on a closed canopy that evaporates water",
        "Baille et al. (1994)",
    ),
    (
        "transpiration_moist_air",
        "W m-2 kPa-1",
        50.0,
        0.6,
        2.0,
        240.0,
        "evaporation per leaf area and kilopascal of deficit, by day in moist air",
        "Baille et al. (1994), whose leaves stood at a kilopascal",
    ),
    (
        "transpiration_night_share",
        "1",
        0.4,
        0.4,
        0.0,
        1.5,
        "the same in the dark, relative to the day",
        "Baille et al. (1994)",
    ),
    (
        "crop_long_wave_loss",
        "W m-2 K-1",
        1.0,
        0.5,
        0.0,
        6.0,
        "heat that the crop radiates to an unscreened cover, per kelvin between the air and what the cover sees",
        "Stanghellini (1987)",
    ),
    (
        "condensation_transfer",
        "m s-1",
        0.004,
        0.5,
        0.0,
        0.02,
        "mass transfer to the cover",
        "Stanghellini and de Jong (1995)",
    ),
    (
        "cover_share",
        "1",
        0.35,
        0.3,
        0.05,
        0.8,
        "cover temperature between what it sees outside (0) and the air below it (1)",
        "Stanghellini and de Jong (1995)",
    ),
    # CO2
    (
        "assimilation_maximum",
        "g m-2 h-1",
        10.0,
        0.3,
        0.5,
        30.0,
        "gross uptake of a closed canopy in saturating light and CO2",
        "Nederhoff (1994)",
    ),
    ("assimilation_light", "umol m-2 s-1", 500.0, 0.3, 100.0, 2500.0, "PAR of half the uptake", "Nederhoff (1994)"),
    ("assimilation_co2", "ppm", 350.0, 0.25, 80.0, 1200.0, "CO2 of half the uptake", "Nederhoff (1994)"),
    (
        "respiration",
        "g m-2 h-1",
        0.5,
        0.4,
        0.0,
        5.0,
        "CO2 that crop and substrate respire at 20 degC",
        "Vanthoor (2011)",
    ),
    (
        "dosing_share",
        "1",
        1.0,
        0.08,
        0.4,
        2.0,
        "share of the dosed CO2 that reaches the air, times the air's density at the sea over that here",
        "Nederhoff (1994)",
    ),
)

PARAMETERS: Mapping[str, PhysicalParameter] = MappingProxyType({row[0]: PhysicalParameter(*row) for row in _ROWS})
"""Every physical parameter by its name."""


def fitted_to_these_balances(names: Collection[str]) -> bool:
    """Tell whether parameters were fitted to the balances as they are: a model of others had others, or fewer.

    Without any, nothing is said: a network has none.
    """
    return not names or set(names) == set(PARAMETERS)
