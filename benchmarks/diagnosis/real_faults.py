"""Faults put into what real greenhouses logged: does the diagnosis say which, how large and since when?

    python -m benchmarks.diagnosis real-faults DATA

DATA is the folder with ``agc2019`` and ``agc2018``. The compartments are those of `real`, four weeks later: calibrated
on eight weeks as they were logged, diagnosed on the four that follow, or as many as there are, which `real` does not
see. Into these a fault is put that the model knows nothing of: a sensor that is off, drifts or lags, lamps that give
more than is logged. The greenhouse and its disturbances are as they were; what the climate computer would have done
otherwise, had it read the faulty sensor, is not in the log. A fault counts as one that matters where it raises an error
a day ahead by a fifth, recalibrated, beside the log without it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.naming import is_named
from benchmarks.diagnosis.real import RISE, Compartment, compartments
from benchmarks.jobs import Jobs
from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.telemetry import Telemetry
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import Diagnosis, diagnose
from igrow.trainer.fit.model import FittedModel

BEGINNING = 42
"""Days of each log that are left out: those that follow the calibration are others than `real`'s."""
BEGINS = 7
"""Days into the log after which a fault begins that does not stand in all of it."""
NEAR = 2.0
"""Days within which a beginning is right."""

Columns = Mapping[str, Floats]


@dataclass(frozen=True)
class Fault:
    """What is done to a log."""

    name: str
    cause: str
    """Effect of the catalogue that it is; empty where there is none."""
    size: float | None
    """In the unit of the effect's amplitude; None where it has another form."""
    columns: Callable[[Telemetry, Floats], Columns]
    """What the log then shows, from what it showed and from 0 before the fault to 1 with it, by row."""
    within: bool = False
    """It begins `BEGINS` days into the log."""
    needs: tuple[str, ...] = ()
    """Quantities without which it cannot be there, or be told."""


def _shifted(quantity: str, by: float) -> Callable[[Telemetry, Floats], Columns]:
    """Return a reading that is off by so much, within what a sensor of humidity shows."""
    high = 100.0 if quantity == "air_humidity" else np.inf
    return lambda table, on: {quantity: np.clip(table[quantity] + by * on, -np.inf, high)}


def _drifting(quantity: str, by: float) -> Callable[[Telemetry, Floats], Columns]:
    """Return a reading that is off by more and more, by so much at the end."""
    return lambda table, on: {quantity: table[quantity] + by * np.linspace(0.0, 1.0, len(table)) * on}


def _times(quantity: str, share: float) -> Callable[[Telemetry, Floats], Columns]:
    """Return a record of so much more than there was, or less."""
    return lambda table, on: {quantity: table[quantity] * (1.0 + (share - 1.0) * on)}


def _in_the_sun(table: Telemetry, on: Floats) -> Columns:
    return {"air_temperature": table["air_temperature"] + 2.0 * on * table["global_radiation"] / 500.0}


def _lagging(table: Telemetry, _on: Floats) -> Columns:
    """Return the air's temperature behind a first-order lag of 25 minutes."""
    follows = 1.0 - np.exp(-table.step / (25.0 * 60.0))
    shown, reading = np.array(table["air_temperature"], dtype=np.float64), np.nan
    for row, value in enumerate(table["air_temperature"]):
        if np.isfinite(value):
            reading = value if np.isnan(reading) else reading + follows * (value - reading)
        shown[row] = reading
    return {"air_temperature": shown}


def _pipes(by: float) -> Callable[[Telemetry, Floats], Columns]:
    names = ("rail_pipe_temperature", "grow_pipe_temperature")
    return lambda table, on: {name: table[name] + by * on for name in names if name in table}


def _vents(by: float) -> Callable[[Telemetry, Floats], Columns]:
    names = ("vent_lee", "vent_wind")
    return lambda table, on: {name: np.clip(table[name] - by * on, 0.0, 100.0) for name in names if name in table}


def _late(quantity: str, rows: int) -> Callable[[Telemetry, Floats], Columns]:
    return lambda table, _on: {quantity: np.roll(table[quantity], rows)}


CO2 = ("air_co2", "co2_dosing")
_ALL = (
    Fault("air sensor +1.5 K", "air_temperature_offset", 1.5, _shifted("air_temperature", 1.5)),
    Fault("air sensor -1.5 K, from day 8", "air_temperature_offset", -1.5, _shifted("air_temperature", -1.5), True),
    Fault("air sensor +2 K in 500 W/m2 of sun", "air_temperature_radiation_error", None, _in_the_sun),
    Fault("air sensor 25 min late", "air_temperature_lag", None, _lagging),
    Fault("humidity sensor -8 %", "humidity_offset", -8.0, _shifted("air_humidity", -8.0)),
    Fault("humidity sensor -8 %, from day 8", "humidity_offset", -8.0, _shifted("air_humidity", -8.0), True),
    Fault("humidity sensor +8 %, from day 8", "humidity_offset", 8.0, _shifted("air_humidity", 8.0), True),
    Fault("humidity sensor drifts by -10 %", "humidity_drift", None, _drifting("air_humidity", -10.0)),
    Fault("CO2 sensor +120 ppm", "co2_offset", 120.0, _shifted("air_co2", 120.0), needs=CO2),
    Fault("CO2 sensor drifts by +150 ppm", "co2_drift", None, _drifting("air_co2", 150.0), needs=CO2),
    Fault("pipe sensors -5 K", "pipe_temperature_offset", -5.0, _pipes(-5.0)),
    Fault("pipe sensors +5 K", "pipe_temperature_offset", 5.0, _pipes(5.0)),
    Fault("lamps half as much again as logged", "lamp_heat", None, _times("lamp_power", 1.0 / 1.5)),
    Fault("lamps the same, from day 8", "lamp_heat", None, _times("lamp_power", 1.0 / 1.5), True),
    Fault("outdoor sensor +2 K", "", None, _shifted("outdoor_temperature", 2.0)),
    Fault("anemometer at two fifths", "", None, _times("wind_speed", 0.4)),
    Fault("vents 10 % wider than logged", "", None, _vents(10.0)),
    Fault("energy screen logged an hour late", "", None, _late("energy_screen", 12)),
)
FAULTS = {one.name: one for one in _ALL}


@dataclass(frozen=True)
class Told:
    """What a diagnosis made of a log."""

    compartment: str
    fault: str
    """Its name; empty for the log as it is."""
    verdict: str
    names: tuple[str, ...]
    size: float | None
    """Of the first name over the true one, where it is the fault's own."""
    covered: bool | None
    """The true size lies in the interval."""
    days_off: float | None
    """Of the beginning, where the fault began within the log and is named; infinite where none is told."""
    errors: Mapping[str, Mapping[str, float]]
    """A day ahead: quantity -> stage -> mean absolute error."""

    @property
    def has_name(self) -> bool:
        """Something has a name."""
        return self.verdict in {"named", "ambiguous"}

    @property
    def is_right(self) -> bool:
        """The first name is the fault's."""
        cause = FAULTS[self.fault].cause
        return self.has_name and bool(cause) and is_named(cause, self.names[:1])


@dataclass(frozen=True)
class Case:
    """What was told of a log with a fault, and of the same without it."""

    told: Told
    plain: Told

    def rise(self, quantity: str) -> float:
        """Return by which share of it the fault raises a recalibrated error."""
        return self.told.errors[quantity]["recalibrated"] / self.plain.errors[quantity]["recalibrated"] - 1.0

    @property
    def rises(self) -> dict[str, float]:
        """By quantity that is judged in both."""
        return {name: self.rise(name) for name in self.plain.errors if name in self.told.errors}

    @property
    def matters(self) -> bool:
        return max(self.rises.values()) >= RISE

    @property
    def recovered(self) -> list[float]:
        """Shares that correction takes off the errors that the fault raises by a fifth."""
        stages = (self.told.errors[name] for name, rise in self.rises.items() if rise >= RISE)
        return [1.0 - by["corrected"] / by["recalibrated"] for by in stages]


def calibrated(one: Compartment) -> FittedModel:
    """Calibrate a compartment as one job."""
    return calibrate(one.before)


def asked(job: tuple[Compartment, FittedModel, str]) -> Told:
    """Diagnose a compartment's log with a fault in it, by its name, as one job; without a name the log as it is."""
    compartment, model, name = job
    log, start = compartment.after, compartment.after.telemetry.time[0]
    if name:
        fault, table = FAULTS[name], log.telemetry
        on = (table.time >= start + np.timedelta64(BEGINS if fault.within else 0, "D")).astype(np.float64)
        log = prepare_log(table.with_columns(fault.columns(table, on)), compartment.site)
    diagnosis = diagnose(log, model)
    size, covered, days_off = _measured(FAULTS[name], diagnosis, start) if name else (None, None, None)
    return Told(
        compartment.name,
        name,
        str(diagnosis.verdict),
        tuple(one.effect for one in diagnosis.findings),
        size,
        covered,
        days_off,
        {quantity: dict(by["24_h"]) for quantity, by in diagnosis.errors.items() if "24_h" in by},
    )


def _measured(
    fault: Fault, diagnosis: Diagnosis, start: np.datetime64
) -> tuple[float | None, bool | None, float | None]:
    """Return `size`, `covered` and `days_off` of `Told`, of a log that starts at `start`."""
    if not diagnosis.findings or diagnosis.findings[0].effect != fault.cause:
        return None, None, None
    first = diagnosis.findings[0]
    size, covered, days_off = None, None, None
    if fault.size is not None:
        told = first.parameters[EFFECTS[first.effect].amplitude.name]
        size, covered = told.value / fault.size, told.low <= fault.size <= told.high
    if fault.within:
        true = start + np.timedelta64(BEGINS, "D")
        days_off = float("inf") if first.onset is None else abs((first.onset.time - true) / np.timedelta64(1, "D"))
    return size, covered, days_off


def line(told: Told, case: Case | None) -> str:
    """Return what was told as a line, beside by how much the fault raises an error at most."""
    raised = "" if case is None else f"{100.0 * max(case.rises.values()):+.0f} %"
    errors = "  ".join("/".join(f"{value:.3g}" for value in stages.values()) for stages in told.errors.values())
    size = "" if told.size is None else f" ({told.size:.2f} of its size)"
    names = ", ".join(told.names) or "-"
    return f"  {told.fault or 'as logged':36} {raised:>6} {told.verdict:11} {names}{size}   {errors}"


def rows(cases: Sequence[Case]) -> list[tuple[str, float, int]]:
    """Return rows (what, figure, cases)."""

    def mean(values: Sequence[float]) -> tuple[float, int]:
        return (float(np.mean(values)) if values else float("nan")), len(values)

    own = [one for one in cases if FAULTS[one.told.fault].cause]
    beyond = [one.told for one in cases if not FAULTS[one.told.fault].cause]
    sizes = [abs(one.told.size - 1.0) for one in own if one.told.size is not None]
    recovered = [share for one in own if one.told.is_right for share in one.recovered]
    days_off = [one.told.days_off for one in own if one.told.days_off is not None]
    return [
        ("right first, where an error rises by a fifth", *mean([one.told.is_right for one in own if one.matters])),
        ("right first, where none does", *mean([one.told.is_right for one in own if not one.matters])),
        ("right, where a name is given", *mean([one.told.is_right for one in own if one.told.has_name])),
        ("something unexplained instead", *mean([one.told.verdict == "unexplained" for one in own])),
        ("size, median relative error", float(np.median(sizes)) if sizes else float("nan"), len(sizes)),
        ("90 % intervals that cover", *mean([one.told.covered for one in own if one.told.covered is not None])),
        (f"beginning within {NEAR:g} days", *mean([one <= NEAR for one in days_off])),
        ("share of such an error that a right name removes", *mean(recovered)),
        ("no cause of the catalogue: a name all the same", *mean([one.has_name for one in beyond])),
        ("no cause of the catalogue: silence", *mean([one.verdict == "nothing" for one in beyond])),
    ]


def main(data: Path | None, only: str, processes: int) -> int:
    """Print every case and the table; `only` compartments of this name."""
    if data is None or not data.is_dir():
        print("error: name the folder of the public data sets: python -m benchmarks.diagnosis real-faults DATA")
        return 2
    chosen = [one for one in compartments(data, BEGINNING) if only in one.name]
    plain: dict[str, Told] = {}
    cases: list[Case] = []
    with Jobs("diagnosis real-faults", processes) as jobs:
        models = list(jobs.each(calibrated, chosen))
        wanted = [(one, model, name) for one, model in zip(chosen, models, strict=True) for name in _names(one)]
        for number, told in enumerate(jobs.each(asked, wanted), 1):
            print(f"{number} of {len(wanted)}", file=sys.stderr)
            if not told.fault:
                plain[told.compartment] = told
                print(f"{told.compartment}: a day ahead deployed/recalibrated/corrected, of {', '.join(told.errors)}")
                print(line(told, None), flush=True)
                continue
            cases.append(Case(told, plain[told.compartment]))
            print(line(told, cases[-1]), flush=True)
    print(f"\n{'':50} {'figure':>8} {'cases':>6}")
    for what, figure, count in rows(cases):
        print(f"{what:50} {figure:8.2f} {count:6d}")
    return 0


def _names(one: Compartment) -> list[str]:
    """Return the faults that a compartment is asked with, by name, after none."""
    columns = one.after.telemetry
    return ["", *(name for name, fault in FAULTS.items() if all(need in columns for need in fault.needs))]
