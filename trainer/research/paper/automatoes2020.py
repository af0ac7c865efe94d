"""The champion of the second challenge: measured daily profit, and Wageningen's simulator on his settings.

From the data of Cao et al. (2022). The workbook's sheet 303 holds harvests above and, below, one row a day of
resources and cumulative money; the plants stand in its profit from the first day on. The simulator's balance leaves
the plants out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError

WORKBOOK = "HarvestAndIncomeAutomatoes.xlsx"
SIMULATED = "Automatoes_wursimres.csv"
_PROFIT_COLUMN = 12


@dataclass(frozen=True)
class Champion:
    """Cumulative net profit of the champion's crop by day, EUR m-2."""

    day: Times
    """(days,) datetime64[D]."""
    measured: Floats
    """By the books of the challenge, plants included, (days,)."""
    simulated: Floats
    """Wageningen's simulator on the champion's settings, plants not included, (days,)."""


def read(folder: Path) -> Champion:
    """Read the folder's two files; raises IgrowError where one is absent or holds no daily table."""
    try:
        sheet = pd.read_excel(folder / WORKBOOK, sheet_name=0, header=None, engine="calamine")
        simulated = pd.read_csv(folder / SIMULATED, index_col=0)
    except (OSError, ValueError) as error:
        raise IgrowError(f"{folder}: {WORKBOOK} and {SIMULATED} are needed ({error})") from error
    head = np.flatnonzero((sheet[0] == "Date").to_numpy())
    if sheet.shape[1] <= _PROFIT_COLUMN or head.size < 2 or "balance" not in simulated.columns:
        raise IgrowError(f"{folder}: no table of daily profit in {WORKBOOK}, or no balance in {SIMULATED}")
    rows = sheet.iloc[head[1] + 1 :]
    date = pd.to_datetime(rows[0], errors="coerce")
    # After the last day the sheet goes on with sums.
    daily = date.notna() & rows[1].notna()
    rows = rows[daily]
    day = date[daily].to_numpy().astype("datetime64[D]")
    profit = rows[_PROFIT_COLUMN].to_numpy(dtype=np.float64)
    balance = simulated["balance"].to_numpy(dtype=np.float64)
    if balance.size != profit.size:
        raise IgrowError(f"{folder}: {profit.size} measured days, {balance.size} simulated ones")
    return Champion(day, profit, balance)
