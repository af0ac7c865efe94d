"""Trains the crop stages of the hybrid simulator: growth hour by hour, harvest day by day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import nnls

from igrow.core import gaps
from igrow.core.arrays import Floats
from igrow.core.errors import IgrowError
from igrow.core.quantities import GROWTH, YIELD
from igrow.core.simulator.crop import GROWTH_DRIVERS, HARVEST_DRIVERS
from igrow.core.simulator.growth import warmth
from igrow.core.simulator.hybrid.record import Record, uptake
from igrow.core.simulator.network import Stage
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.progress import Progress, silent
from igrow.trainer.training.stage import StageData, StageLayout, TrainingPlan, train_stage, untrained

GROWTH_PLAN = TrainingPlan(updates=((8, 600), (24, 500), (96, 250)), batch=128, learning_rate=3e-3)
HARVEST_PLAN = TrainingPlan(updates=((4, 500), (14, 400)), batch=64, learning_rate=3e-3)
_GROWTH = StageLayout("growth", GROWTH, GROWTH_DRIVERS, (), (32, 32), cumulative=("net_growth",))
_HARVEST = StageLayout("harvest", YIELD, HARVEST_DRIVERS, (), (32, 32), step=24.0)


def train_networks(seasons: Sequence[Telemetry], *, seed: int = 0, progress: Progress = silent) -> tuple[Stage, Stage]:
    """Train the networks of growth and harvest on seasons of equal length that start at one time.

    Args:
        seasons: logs with climate, growth and yield (of the mechanistic greenhouse, say).
        seed: of weights and windows.
        progress: is told what is being done, in lines.

    Raises:
        IgrowError: a season lacks a quantity, or the seasons differ in length.
    """
    hourly = [to_grid(season, 3600) for season in seasons]
    lengths = {len(table) for table in hourly}
    if len(lengths) != 1:
        raise IgrowError(f"the seasons must be equally long, not {', '.join(map(str, sorted(lengths)))} hours")
    growth = StageData(
        drivers=_stacked(hourly, GROWTH_DRIVERS),
        states=_stacked(hourly, GROWTH),
        hour=np.zeros(lengths.copy().pop()),
        valid=np.ones((len(hourly), lengths.pop()), dtype=bool),
    )
    days = growth.drivers.shape[1] // 24
    daily = np.stack([_by_day(growth.drivers[..., GROWTH_DRIVERS.index("air_temperature")], days),
                      _by_day(growth.states[..., GROWTH.index("plant_load")], days),
                      _last(growth.states[..., GROWTH.index("net_growth")], days)], axis=-1)  # fmt: skip
    daily[..., 2] = np.diff(daily[..., 2], axis=1, prepend=daily[:, :1, 2])
    harvested = _last(_stacked(hourly, YIELD)[..., 0], days)[..., None]
    harvest = StageData(
        drivers=daily[:, 1:],
        states=harvested[:, 1:],
        hour=np.zeros(days - 1),
        valid=np.ones((len(hourly), days - 1), dtype=bool),
    )
    first, second = untrained(_GROWTH, growth, seed), untrained(_HARVEST, harvest, seed)
    return train_stage(first, growth, GROWTH_PLAN, progress), train_stage(second, harvest, HARVEST_PLAN, progress)


def fit_net_growth(
    records: Sequence[Record], parameters: Mapping[str, float], seasons: Sequence[Telemetry]
) -> tuple[float, float]:
    """Return conversion and maintenance of `CropStages`, by least squares on the growth of whole days.

    Args:
        records: of the seasons.
        parameters: of the climate stage, whose canopy assimilates.
        seasons: on the records' grids, with net_growth.
    """
    rows, grown = [], []
    for record, season in zip(records, seasons, strict=True):
        assimilated, air_temperature = uptake(record, parameters, {})
        day = round(86_400.0 / record.step)
        days = len(record) // day
        hours = record.step / 3600.0

        def total(values: Floats, day: int = day, days: int = days, hours: float = hours) -> Floats:
            return np.asarray(values[: day * days].reshape(days, day).sum(axis=1) * hours)

        cumulative = to_grid(season, int(record.step))["net_growth"]
        end = np.minimum(day * np.arange(1, days + 1), len(cumulative) - 1)
        grown.append(cumulative[end] - cumulative[day * np.arange(days)])
        rows.append(np.stack([total(3600.0 * assimilated), -total(warmth(air_temperature))], axis=1))
    table, target = np.concatenate(rows), np.concatenate(grown)
    fine = np.isfinite(table).all(axis=1) & np.isfinite(target)
    conversion, maintenance = nnls(table[fine], target[fine])[0]
    return float(conversion), float(maintenance)


def _stacked(tables: Sequence[Telemetry], names: Sequence[str]) -> Floats:
    """Return columns as (seasons, hours, names); gaps are bridged linearly."""
    return np.stack([np.stack([_bridged(table, name) for name in names], axis=-1) for table in tables])


def _bridged(table: Telemetry, name: str) -> Floats:
    if not np.isfinite(table[name]).any():
        raise IgrowError(f"a season to train on has no {name}")
    return gaps.interpolated(table[name])


def _by_day(values: Floats, days: int) -> Floats:
    """Return the means of whole days, (seasons, days)."""
    return np.asarray(values[:, : days * 24].reshape(len(values), days, 24).mean(axis=-1))


def _last(values: Floats, days: int) -> Floats:
    """Return the values at the end of whole days, (seasons, days)."""
    return values[:, 23 : days * 24 : 24]
