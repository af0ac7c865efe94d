"""The plausibility gate: how often it alarms on logs in which nothing is wrong, and what it sees of what was put in.

    python -m benchmarks.plausibility DATA [--places N] [--greenhouses N]

DATA is the folder with ``agc2019`` and ``agc2018``: every whole week, fortnight and four weeks of each compartment is a
log, by 5 minutes and by the hour. Beside them virtual greenhouses stand at several latitudes and in several seasons.
Every log that is clean is then spoilt in each way, and the table tells in how many the fault was named as what it is.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.greenhouse import generate_weather, recipe, simulate_many
from igrow.core.greenhouse.described import parameters_of
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.local_time import to_local
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data.open_source import open_source
from igrow.trainer.data.plausibility import find_faults
from igrow.trainer.data.rows import merge

COMPARTMENTS = (
    ("agc2019", "Reference"),
    ("agc2018", "Reference"),
    ("agc2018", "AiCU"),
    ("agc2018", "Croperators"),
    ("agc2018", "deep_greens"),
)
WINDOWS = (7, 14, 28)
DAYS = 14
"""Of a virtual log."""
PLACES = {
    "westland-winter": (52.0, 4.4, "Europe/Amsterdam", "2021-01-08", (10.8, 7.2, 3.0, 4.6, 0.66, 4.8)),
    "almeria-spring": (36.8, -2.5, "Europe/Madrid", "2021-04-10", (18.0, 7.0, 2.0, 6.0, 0.3, 3.5)),
    "ontario-autumn": (42.0, -82.6, "America/Toronto", "2021-10-01", (10.0, 13.0, 4.5, 5.0, 0.55, 4.5)),
    "uppsala-summer": (59.8, 17.6, "Europe/Stockholm", "2021-06-10", (6.5, 11.0, 3.0, 5.0, 0.6, 3.5)),
    "riyadh-summer": (24.7, 46.7, "Asia/Riyadh", "2021-07-01", (27.0, 10.0, 1.5, 7.0, 0.1, 3.5)),
    "melbourne-winter": (-37.8, 145.0, "Australia/Melbourne", "2021-07-10", (15.0, 5.5, 2.5, 5.0, 0.6, 4.0)),
    "quito": (-0.2, -78.5, "America/Guayaquil", "2021-03-05", (14.0, 0.6, 0.8, 5.5, 0.7, 1.5)),
    "liaoning-spring": (41.8, 123.4, "Asia/Shanghai", "2021-03-20", (8.5, 18.0, 4.0, 6.0, 0.4, 3.2)),
}
"""Name -> latitude, longitude, time zone, first day, and the climate as `WeatherClimate` has it from the mean
temperature on."""


@dataclass(frozen=True)
class Clean:
    """A log in which nothing is wrong."""

    name: str
    site: Site
    telemetry: Telemetry


def real_logs(data: Path) -> Iterator[Clean]:
    for folder, compartment in COMPARTMENTS:
        try:
            source = open_source(data / folder, compartment)
        except IgrowError as error:
            print(f"{folder} {compartment}: {error}")
            continue
        assert source.site is not None
        table = source.telemetry
        yield Clean(source.name, source.site, table)
        for days in WINDOWS:
            window = np.timedelta64(days, "D")
            for number in range(int((table.time[-1] - table.time[0]) / window)):
                part = table.select(table.time[0] + number * window, table.time[0] + (number + 1) * window)
                yield Clean(f"{source.name} {days} days from {part.time[0]}", source.site, part)


def virtual_logs(places: int, greenhouses: int) -> Iterator[Clean]:
    for name, (latitude, longitude, zone, first, described) in list(PLACES.items())[:places]:
        print(f"simulating {greenhouses} greenhouses: {name}", file=sys.stderr, flush=True)
        site = Site(name=name, latitude=latitude, longitude=longitude, time_zone=zone)
        start = np.datetime64(first, "s")
        end = start + np.timedelta64(DAYS, "D")
        climate = WeatherClimate(latitude, longitude, *described)
        weathers = [generate_weather(start, end, seed=seed, climate=climate) for seed in range(greenhouses)]
        seasons = simulate_many(parameters_of(site), weathers, recipe, start, end, count=greenhouses, seed=7)
        for seed, season in enumerate(seasons):
            yield Clean(f"{name} {seed}", site, season.measured)


def scaled(name: str, scale: float, offset: float = 0.0) -> Callable[[Clean], Telemetry]:
    return lambda log: log.telemetry.with_columns({name: log.telemetry[name] * scale + offset})


def shifted(hours: float) -> Callable[[Clean], Telemetry]:
    shift = np.timedelta64(int(3600 * hours), "s")
    return lambda log: Telemetry(log.telemetry.time + shift, log.telemetry.columns)


def summed(log: Clean) -> Telemetry:
    """Radiation as J cm-2 since local midnight."""
    table = log.telemetry
    day = to_local(table.time, log.site.time_zone).astype("datetime64[D]")
    came = np.cumsum(np.nan_to_num(table["global_radiation"]) * table.step / 1e4)
    first = np.searchsorted(day, day, side="left")
    return table.with_columns({"global_radiation": came - (came[first] - came[0])})


def wall_time(log: Clean) -> Telemetry:
    time = to_local(log.telemetry.time, log.site.time_zone)
    return merge(time, log.telemetry.columns).telemetry


def permuted(log: Clean) -> Telemetry:
    order = np.random.default_rng(0).permutation(len(log.telemetry))
    return Telemetry(log.telemetry.time, {name: values[order] for name, values in log.telemetry.columns.items()})


def exchanged(one: str, other: str) -> Callable[[Clean], Telemetry]:
    return lambda log: log.telemetry.with_columns({one: log.telemetry[other], other: log.telemetry[one]})


def daily(log: Clean) -> Telemetry:
    return to_grid(log.telemetry, 86_400)


@dataclass(frozen=True)
class Spoil:
    """A way to spoil a log, and the kinds that name it."""

    spoilt: Callable[[Clean], Telemetry]
    kinds: tuple[str, ...]
    needs: tuple[str, ...] = ()


SPOILS: Mapping[str, Spoil] = {
    "air temperature in degF": Spoil(scaled("air_temperature", 1.8, 32.0), ("fahrenheit",), ("air_temperature",)),
    "outdoor temperature in degF": Spoil(
        scaled("outdoor_temperature", 1.8, 32.0), ("fahrenheit",), ("outdoor_temperature",)
    ),
    "sky temperature in degF": Spoil(scaled("sky_temperature", 1.8, 32.0), ("fahrenheit",), ("sky_temperature",)),
    "pipe temperature in degF": Spoil(
        scaled("rail_pipe_temperature", 1.8, 32.0), ("fahrenheit",), ("rail_pipe_temperature",)
    ),
    "air temperature in kelvin": Spoil(scaled("air_temperature", 1.0, 273.15), ("kelvin",), ("air_temperature",)),
    "humidity 0 to 1": Spoil(scaled("air_humidity", 0.01), ("fraction",), ("air_humidity",)),
    "humidity outside 0 to 1": Spoil(scaled("outdoor_humidity", 0.01), ("fraction",), ("outdoor_humidity",)),
    "CO2 outside in mg m-3": Spoil(scaled("outdoor_co2", 1.0 / 0.546), ("milligrams",), ("outdoor_co2",)),
    "dosing in kg ha-1 h-1": Spoil(scaled("co2_dosing", 1e4), ("dose",), ("co2_dosing",)),
    "screen 0 to 1": Spoil(scaled("energy_screen", 0.01), ("fraction",), ("energy_screen",)),
    "vents 0 to 1": Spoil(scaled("vent_lee", 0.01), ("fraction",), ("vent_lee",)),
    "CO2 in %": Spoil(scaled("air_co2", 1e-4), ("percent",), ("air_co2",)),
    "radiation in J cm-2 a row": Spoil(scaled("global_radiation", 0.03), ("radiation_unit",), ("global_radiation",)),
    "radiation in klux": Spoil(scaled("global_radiation", 0.115), ("radiation_unit",), ("global_radiation",)),
    "radiation as PAR": Spoil(scaled("global_radiation", 2.05), ("radiation_unit",), ("global_radiation",)),
    "radiation as a sum of the day": Spoil(summed, ("radiation_sum",), ("global_radiation",)),
    "radiation in J cm-2 an hour": Spoil(scaled("global_radiation", 0.36), ("radiation_unit",), ("global_radiation",)),
    "wind in mph": Spoil(scaled("wind_speed", 1.0 / 0.44704), ("kilometres_per_hour",), ("wind_speed",)),
    "wind in knots": Spoil(scaled("wind_speed", 1.0 / 0.514444), ("kilometres_per_hour",), ("wind_speed",)),
    "wind in km/h": Spoil(scaled("wind_speed", 3.6), ("kilometres_per_hour",), ("wind_speed",)),
    "energy screen the other way round": Spoil(
        scaled("energy_screen", -1.0, 100.0), ("screen_reversed",), ("energy_screen",)
    ),
    "clock 1 h late": Spoil(shifted(1.0), ("clock", "local_time"), ("global_radiation",)),
    "clock 2 h early": Spoil(shifted(-2.0), ("clock", "local_time"), ("global_radiation",)),
    "clock 8 h late": Spoil(shifted(8.0), ("clock", "local_time"), ("global_radiation",)),
    "wall time read as UTC": Spoil(wall_time, ("clock", "local_time"), ("global_radiation",)),
    "rows shuffled": Spoil(permuted, ("shuffled_rows",)),
    "a row a day": Spoil(daily, ("sparse",)),
    "temperature and humidity exchanged": Spoil(
        exchanged("air_temperature", "air_humidity"), ("swapped_columns",), ("air_temperature", "air_humidity")
    ),
    "inside and outside exchanged": Spoil(
        exchanged("air_temperature", "outdoor_temperature"), ("swapped_columns",), ("air_temperature",)
    ),
}


def false_alarms(logs: list[Clean]) -> list[str]:
    """Return a line for each clean log that raises an alarm, by its own step and by the hour."""
    lines = []
    for log in logs:
        for table, step in ((log.telemetry, "own step"), (to_grid(log.telemetry, 3600), "hourly")):
            found = find_faults(table, log.site)
            if found:
                lines.append(f"  {log.name}, {step}: " + "; ".join(f"{one.kind} {one.quantity}" for one in found))
    return lines


def detection(logs: list[Clean]) -> list[str]:
    """Return a line for each way to spoil a log: in how many it was named, and what else was said."""
    lines = []
    for name, spoil in SPOILS.items():
        named, other, count = 0, Counter[str](), 0
        for log in logs:
            if not all(one in log.telemetry and np.isfinite(log.telemetry[one]).any() for one in spoil.needs):
                continue
            if find_faults(log.telemetry, log.site):
                continue
            spoilt = spoil.spoilt(log)
            if spoilt.time.shape == log.telemetry.time.shape and (spoilt.time == log.telemetry.time).all():
                unchanged = all(
                    np.array_equal(spoilt[one], log.telemetry[one], equal_nan=True) for one in spoilt.columns
                )
                if unchanged:
                    continue
            count += 1
            kinds = {fault.kind for fault in find_faults(spoilt, log.site)}
            named += bool(kinds & set(spoil.kinds))
            other.update(kinds - set(spoil.kinds))
        also = ", ".join(f"{kind} {number}" for kind, number in other.items())
        lines.append(f"{name:38} {named:4} of {count:4}" + (f"   also: {also}" if also else ""))
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of the public data sets")
    parser.add_argument("--places", type=int, default=len(PLACES), help="of virtual greenhouses (default: all)")
    parser.add_argument("--greenhouses", type=int, default=6, help="at each place (default 6)")
    given = parser.parse_args()
    groups = {
        "real compartments": list(real_logs(given.data)),
        "virtual greenhouses": list(virtual_logs(given.places, given.greenhouses)),
    }
    print("false alarms on logs in which nothing is wrong")
    for name, logs in groups.items():
        lines = false_alarms(logs)
        print(f"{name:24} {len(lines)} of {2 * len(logs)}")
        print("\n".join(lines) + "\n" * bool(lines), end="")
    for name, logs in groups.items():
        long = [log for log in logs if len(log.telemetry) * log.telemetry.step > 13 * 86_400.0]
        print(f"\nfaults put into {name}, logs of two weeks and more: named as what they are")
        print("\n".join(detection(long)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
