"""The second pilot of Cao et al. (2022): seven tomato greenhouses in Liaoyang, two run by growers, five by iGrow.

Harvest, price and income are by day and greenhouse; costs are totals. The climate is published as pairs of one
experimental and one control greenhouse over the hours that both have, in order, without a time of day.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError

AREA = 667.0
"""m2 of each greenhouse."""
EUR_PER_RMB = 0.1276
"""As the paper uses it."""
CONTROL = ("gh01", "gh02")
EXPERIMENT = ("gh03", "gh04", "gh05", "gh06", "gh07")
GREENHOUSES = (*CONTROL, *EXPERIMENT)
COSTS = ("Energy", "Labour", "Fixed")
_QUANTITIES = {"AirT": "air_temperature", "AirRH": "air_humidity", "AirCO2": "air_co2", "AirPAR": "par"}


@dataclass(frozen=True)
class Pilot:
    """What seven greenhouses gave and cost, per m2 of greenhouse."""

    day: Times
    """(days,) datetime64[D]."""
    production: Mapping[str, Floats]
    """Greenhouse -> (days,) kg m-2 d-1 fresh weight."""
    income: Mapping[str, Floats]
    """Greenhouse -> (days,) EUR m-2 d-1."""
    costs: Mapping[str, Mapping[str, float]]
    """Greenhouse -> energy, labour and fixed costs of the season, EUR m-2."""

    def net_profit(self, greenhouse: str) -> float:
        """Return income less costs of the season, EUR m-2."""
        return float(self.income[greenhouse].sum()) - sum(self.costs[greenhouse].values())


def read(folder: Path) -> Pilot:
    """Read harvests, income and costs; raises IgrowError where a file is absent or lacks a greenhouse."""
    production, income = (_by_day(folder / name) for name in ("production.csv", "Income.csv"))
    if not np.array_equal(production[0], income[0]):
        raise IgrowError(f"{folder}: production.csv and Income.csv hold different days")
    path = folder / "overall_cost.xlsx"
    try:
        sheets = pd.read_excel(path, sheet_name=list(COSTS), engine="calamine")
    except (OSError, ValueError) as error:
        raise IgrowError(f"{path}: needs the sheets {', '.join(COSTS)} ({error})") from error
    costs = {
        greenhouse: {name.lower(): float(sheets[name][greenhouse].iloc[0]) / AREA for name in COSTS}
        for greenhouse in GREENHOUSES
    }
    return Pilot(
        production[0],
        {greenhouse: values / AREA for greenhouse, values in production[1].items()},
        {greenhouse: values * EUR_PER_RMB / AREA for greenhouse, values in income[1].items()},
        costs,
    )


def read_climate_pair(folder: Path, experiment: int, control: int) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return the climate (hours,) of an experimental and of a control greenhouse over the hours that both have.

    Raises IgrowError where the pair is not published.
    """
    path = folder / "sensors" / f"sensor_interval@1h_expr@{experiment}_ctrl@{control}.csv"
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise IgrowError(f"{path}: no such pair of greenhouses ({error})") from error
    parts = []
    for method in ("EGA", "Human"):
        rows = table[table["method"] == method]
        parts.append({ours: rows[theirs].to_numpy(dtype=np.float64) for theirs, ours in _QUANTITIES.items()})
    return parts[0], parts[1]


def _by_day(path: Path) -> tuple[Times, dict[str, Floats]]:
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise IgrowError(f"{path}: cannot be read as a table ({error})") from error
    missing = [name for name in ("date", *GREENHOUSES) if name not in table.columns]
    if missing:
        raise IgrowError(f"{path}: lacks {', '.join(missing)}")
    day = pd.to_datetime(table["date"]).to_numpy().astype("datetime64[D]")
    return day, {greenhouse: table[greenhouse].fillna(0.0).to_numpy(dtype=np.float64) for greenhouse in GREENHOUSES}
