"""The diagnosis on real logs: errors before and after on later weeks, withheld drivers, and a placebo.

    python -m benchmarks.diagnosis real DATA

DATA is the folder with ``agc2019`` and ``agc2018``. Each compartment's model is calibrated on its first eight weeks
and diagnosed on the four that follow, once more with the built-in bundle as it is. Then the known truth: an actuator's
column is taken out of the log, and the diagnosis must name it wherever the error rises by a fifth. Then the placebo:
wind and rain of another half of the season, put in the place of the true ones, must not be found. (A term that the
model lacks is asked of its calibration log: `omission DATA`.)
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.logs import built_in
from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import Log, read_log
from igrow.trainer.diagnosis import Diagnosis, diagnose

COMPARTMENTS = (
    ("agc2019", "Reference"),
    ("agc2018", "Reference"),
    ("agc2018", "AiCU"),
    ("agc2018", "Croperators"),
    ("agc2018", "deep_greens"),
)
BEGINNING, CALIBRATION_DAYS, DIAGNOSIS_DAYS = 14, 56, 28
"""Days of the log that are left out, those that a model is calibrated on, and those that follow and are diagnosed."""
WITHHELD = ("lamp_power", "rail_pipe_temperature", "grow_pipe_temperature", "energy_screen", "blackout_screen")
"""Columns that are taken out of the log."""
RISE = 0.2
"""Share by which an error rises from which on a withheld column must be named."""
PLACEBO = ("wind_speed", "wind_direction", "rain")


@dataclass(frozen=True)
class Compartment:
    name: str
    site: Site
    before: Log
    after: Log


def compartments(data: Path, beginning: int = BEGINNING) -> Iterator[Compartment]:
    """Yield the compartments of the public data; one whose log cannot be read is said so.

    Args:
        data: folder of the public data sets.
        beginning: days of each log that are left out.
    """
    for folder, name in COMPARTMENTS:
        try:
            log = read_log(data / folder, compartment=name)
        except IgrowError as error:
            print(f"{folder} {name}: {error}")
            continue
        start = log.telemetry.time[0] + np.timedelta64(beginning, "D")
        middle = start + np.timedelta64(CALIBRATION_DAYS, "D")
        end = middle + np.timedelta64(DIAGNOSIS_DAYS, "D")
        yield Compartment(f"{folder} {name}", log.known_site, log.select(start, middle), log.select(middle, end))


def say(title: str, diagnosis: Diagnosis, whole: Diagnosis | None = None) -> None:
    """Print a diagnosis; beside that of the whole log by how much a withheld column raises the error (recalibrated)."""
    causes = ", ".join(f"{one.effect} ({'/'.join(one.confounded)})" for one in diagnosis.findings) or "-"
    print(f"{title:72} {diagnosis.verdict:12} {causes}", flush=True)
    for quantity, horizons in diagnosis.errors.items():
        if "24_h" in horizons:
            stages = "  ".join(f"{stage} {value:.3g}" for stage, value in horizons["24_h"].items())
            more = ""
            if whole is not None and quantity in whole.errors:
                rise = horizons["24_h"]["recalibrated"] / whole.errors[quantity]["24_h"]["recalibrated"] - 1.0
                more = f"  (withheld: {100.0 * rise:+.0f} %)"
            print(f"{'':44} {quantity:16} 24 h: {stages}{more}")


def rise_of(told: Diagnosis, whole: Diagnosis) -> float:
    """Return the largest rise of a recalibrated error a day ahead over that of the whole log, as a share of it."""
    return max(
        horizons["24_h"]["recalibrated"] / whole.errors[quantity]["24_h"]["recalibrated"] - 1.0
        for quantity, horizons in told.errors.items()
        if "24_h" in horizons and quantity in whole.errors
    )


def placebo(log: Log, other: Log) -> Log:
    """Return a log whose wind and rain come from another stretch of the season."""
    rows = np.arange(len(log)) % len(other)
    given = other.telemetry
    return log.with_columns({name: given[name][rows] for name in PLACEBO if name in log.telemetry and name in given})


def main(data: Path | None, only: str = "", beginning: int | None = None, *, withheld_only: bool = False) -> int:
    """Print it all.

    Args:
        data: folder of the public data sets.
        only: of compartments whose name has this in it.
        beginning: days of each log that are left out (None: `BEGINNING`).
        withheld_only: leave out built-in bundle and placebo.
    """
    if data is None or not data.is_dir():
        print("error: name the folder of the public data sets: python -m benchmarks.diagnosis real DATA")
        return 2
    found: dict[str, set[str]] = {}
    withheld: list[tuple[bool, bool]] = []
    for one in compartments(data, BEGINNING if beginning is None else beginning):
        if only not in one.name:
            continue
        print(f"calibrating {one.name} on {CALIBRATION_DAYS} days", file=sys.stderr)
        model = calibrate(one.before)
        diagnosis = diagnose(one.after, model)
        say(one.name, diagnosis)
        found[one.name] = {finding.effect for finding in diagnosis.findings}
        for column in WITHHELD:
            if column in one.after.telemetry:
                told = diagnose(one.after.without(column), model)
                say(f"  log without {column}", told, whole=diagnosis)
                withheld.append((rise_of(told, diagnosis) >= RISE, column in {one.effect for one in told.findings}))
        if withheld_only:
            continue
        transferred = diagnose(one.after, built_in(one.site))
        say("  with the built-in bundle", transferred)
        false = diagnose(placebo(one.after, one.before), model)
        say("  wind and rain of other weeks", false)
    for matters, where in ((True, "rises by a fifth"), (False, "does not")):
        named = [is_named for does, is_named in withheld if does == matters]
        print(f"withheld columns named, where an error {where}: {sum(named)} of {len(named)}")
    shared = {name for names in found.values() for name in names if sum(name in other for other in found.values()) > 1}
    print(f"causes found in more than one compartment: {', '.join(sorted(shared)) or 'none'}")
    return 0
