"""Units that a column's size alone does not tell, but its place on earth does, or what stands beside it.

5 degC outside in degF is 41, as mild as a day in Spain; in January at 52 degrees north nothing is. A sky that is
warmer than the air below it, a pipe at rest that is far warmer than its greenhouse: each is another unit.
"""

from __future__ import annotations

import numpy as np

from igrow.core import sun
from igrow.core.arrays import Floats
from igrow.core.quantities import difference_with_unit, with_unit
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault, Remedy
from igrow.trainer.data.plausibility.units import (
    FAHRENHEIT,
    LEAST_VALUES,
    PIPES,
    RELATIVE_IN_PER_CENT,
    in_another_unit,
    readings,
)

LAG_DAYS = 30
"""By which the seasons of the air follow the sun."""
WARMEST = ((25.0, 75.0, 90.0), (40.0, 14.0, 8.0))
"""Degrees between the latitude and the sun's, and degC that the median of a log's outdoor temperature never exceeds
there. The warmest places stay 3 K below it and more: July in Kuwait 38, in Phoenix 36, in Seville 29; January in
Bangkok 27, in Miami 21, in Lisbon 12, in the Netherlands 8."""
SKY_ABOVE = 4.0
"""K by which no sky is warmer than the air below it, in the median."""
PIPE_ABOVE = 25.0
"""K by which the air lies at least below a pipe at rest that is in degF."""
AT_REST = (-4.0, 10.0)
"""K by which a pipe at rest differs from the air."""
MILD = 15.0
"""degC outside at which no greenhouse needs pipes that hot."""
DRY_MEDIAN, DRY_HIGH = 25.0, 45.0
"""% of relative humidity: g m-3 are never more."""
CARBON_OUTSIDE = (370.0, 480.0)
"""ppm."""
_MILLIGRAMS = Remedy(0.546)
_LEAST_ROWS = 48


def units_by_relation(telemetry: Telemetry, site: Site | None) -> list[DataFault]:
    """Return the columns whose unit is another, as their place or the columns beside them show."""
    found = [
        _outdoor_temperature(telemetry, site),
        _sky(telemetry),
        *(_pipe(telemetry, name) for name in PIPES),
        _outdoor_humidity(telemetry),
        _carbon_outside(telemetry),
    ]
    return [fault for fault in found if fault is not None]


def warmest_median(telemetry: Telemetry, latitude: float) -> float:
    """Return the median in degC that the outdoor temperature of a log's dates never exceeds at its latitude."""
    lag = np.timedelta64(LAG_DAYS, "D")
    declination, _ = sun.declination_and_equation(np, sun.unix_seconds(telemetry.time - lag))
    away = np.abs(latitude - np.degrees(declination))
    return float(np.median(np.interp(away, *WARMEST)))


def _outdoor_temperature(telemetry: Telemetry, site: Site | None) -> DataFault | None:
    name = "outdoor_temperature"
    values = readings(telemetry, name)
    if site is None or len(values) < LEAST_VALUES:
        return None
    middle, most = float(np.median(values)), warmest_median(telemetry, site.latitude)
    if middle <= most or middle > 140.0:
        return None
    inside = readings(telemetry, "air_temperature")
    if len(inside) and float(np.median(inside)) <= most:
        # What is warm here may be the air inside, and the column of that the weather.
        return None
    limit = with_unit(name, most, ".3g")
    seen = (
        f"{name} has a median of {middle:.4g}, where these weeks at {site.latitude:g} deg of latitude never "
        f"have more than {limit}, so it is in degF"
    )
    return in_another_unit("fahrenheit", name, seen, FAHRENHEIT)


def _side_by_side(telemetry: Telemetry, name: str, beside: str) -> tuple[Floats, Floats]:
    """Return two columns where both were read, (k,) each; nothing where the log lacks one."""
    if name not in telemetry or beside not in telemetry:
        return np.empty(0), np.empty(0)
    known = np.isfinite(telemetry[name]) & np.isfinite(telemetry[beside])
    return telemetry[name][known], telemetry[beside][known]


def _sky(telemetry: Telemetry) -> DataFault | None:
    name = "sky_temperature"
    both = _side_by_side(telemetry, name, "outdoor_temperature")
    if len(both[0]) < LEAST_VALUES:
        return None
    sky, air = (float(np.median(values)) for values in both)
    if sky <= air + SKY_ABOVE or sky * FAHRENHEIT.scale + FAHRENHEIT.offset > air + SKY_ABOVE:
        return None
    warmer = difference_with_unit(name, sky - air, ".3g")
    seen = f"{name} is {warmer} warmer than the air outside, so it is in degF"
    return in_another_unit("fahrenheit", name, seen, FAHRENHEIT)


def _pipe(telemetry: Telemetry, name: str) -> DataFault | None:
    """Judge a pipe by its coolest tenth: at rest it is as warm as the air around it.

    In weeks that are cold throughout a greenhouse may heat all the time, and its pipes never rest.
    """
    pipe, air = _side_by_side(telemetry, name, "air_temperature")
    pipe, air = pipe[pipe > 1.0], air[pipe > 1.0]
    outside = readings(telemetry, "outdoor_temperature")
    if len(pipe) < _LEAST_ROWS or not len(outside) or float(np.quantile(outside, 0.9)) < MILD:
        return None
    coolest = pipe <= np.quantile(pipe, 0.1)
    above = float(np.median((pipe - air)[coolest]))
    converted = float(np.median((pipe * FAHRENHEIT.scale + FAHRENHEIT.offset - air)[coolest]))
    # A pipe that is held at a least temperature keeps to that; one at rest goes with the air.
    follows = float(np.std(pipe[coolest])) > 0.5
    if above < PIPE_ABOVE or not AT_REST[0] <= converted <= AT_REST[1] or not follows:
        return None
    warmer = difference_with_unit(name, above, ".3g")
    seen = f"{name} at rest is {warmer} warmer than the air, so it is in degF"
    return in_another_unit("fahrenheit", name, seen, FAHRENHEIT)


def _outdoor_humidity(telemetry: Telemetry) -> DataFault | None:
    """Relative humidity falls as a day grows warmer; grams a cubic metre do not."""
    name = "outdoor_humidity"
    humidity, warmth = _side_by_side(telemetry, name, "outdoor_temperature")
    if len(humidity) < _LEAST_ROWS or np.std(humidity) == 0.0 or np.std(warmth) == 0.0:
        return None
    middle, high = (float(one) for one in np.quantile(humidity, (0.5, 0.995)))
    if not 1.5 < middle < DRY_MEDIAN or high >= DRY_HIGH or float(np.corrcoef(humidity, warmth)[0, 1]) < 0.0:
        return None
    seen = f"{name} has a median of {middle:.3g} and rises with the temperature: it is no relative humidity"
    return DataFault("absolute_humidity", name, seen, RELATIVE_IN_PER_CENT)


def _carbon_outside(telemetry: Telemetry) -> DataFault | None:
    name = "outdoor_co2"
    values = readings(telemetry, name)
    if len(values) < LEAST_VALUES:
        return None
    middle = float(np.median(values))
    if not CARBON_OUTSIDE[0] <= middle * _MILLIGRAMS.scale <= CARBON_OUTSIDE[1]:
        return None
    seen = f"{name} has a median of {middle:.4g}, so it is in mg m-3"
    return in_another_unit("milligrams", name, seen, _MILLIGRAMS)
