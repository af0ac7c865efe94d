"""The incremental mechanism of Cao et al. (2022), and what it forgets: virtual seasons first, then a real greenhouse.

Three steps: (1) all stages learn from virtual seasons; (2) the climate stage starts anew on windows of which a share
comes from the first weeks of a real greenhouse in the place of virtual ones; (3) it is then fine-tuned week by week
on the stream of real data, each week being predicted before it is learned. Against forgetting, windows of the virtual
seasons are rehearsed in (3); the same fine-tuning without rehearsal stands beside it.

A real log holds no leaf area, plant load or net growth by the hour. So growth and harvest stay as the virtual seasons
taught them, and the leaf area that the climate stage reads is that of the growth stage under the measured climate.
"""

from __future__ import annotations

import json
from argparse import ArgumentParser
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from igrow.core import gaps
from igrow.core.arrays import Floats, Integers
from igrow.core.errors import IgrowError
from igrow.core.local_time import to_local
from igrow.core.simulator.network import NetworkSimulator, Stage
from igrow.core.simulator.network_run import free_growth, free_run
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data.public import agc2019
from igrow.trainer.research.network.simulator import Layouts, derived, hourly_data, train_simulator
from igrow.trainer.research.paper.scores import SCORED, score
from igrow.trainer.research.paper.table1 import split_seasons
from igrow.trainer.research.paper.wur2020 import Seasons, read_seasons
from igrow.trainer.training.stage import StageData, TrainingPlan, run_windows, train_stage, untrained

WEEK = 168
REAL_SHARE = 0.4
"""Share of windows from the real greenhouse in steps 2 and 3."""
MIXED = TrainingPlan(updates=((4, 6000), (16, 2000), (48, 800)))
WEEKLY = TrainingPlan(updates=((24, 60),), learning_rate=3e-4)
TEST_WEEKS = 5
FIRST_WEEKS = 6


@dataclass(frozen=True)
class RealRun:
    """One real greenhouse on the clock of the virtual seasons."""

    data: StageData
    """One run of the climate stage, padded with hours that are not valid."""
    weeks: int


def hourly_run(telemetry: Telemetry, seasons: Seasons, simulator: NetworkSimulator) -> RealRun:
    """Return a log as one run of the climate stage, hours of the local clock (Europe/Amsterdam in winter time).

    Gaps in drivers are bridged by the last value and count as not valid, as do gaps in the climate.
    """
    grid = to_grid(telemetry, 3600)
    local = to_local(grid.time[:1], "Europe/Amsterdam")[0]
    first = int((local + np.timedelta64(3600, "s") - seasons.time[0]) / np.timedelta64(3600, "s"))
    hours = seasons.time.size
    stage = simulator.climate
    names = {*stage.drivers, *stage.states} - {"leaf_area_index"}
    missing = sorted(name for name in names if name not in grid)
    if missing:
        raise IgrowError(f"the log lacks {', '.join(missing)}, which the climate stage needs")
    columns: dict[str, Floats] = {}
    good = np.zeros(hours, dtype=bool)
    rows = np.arange(grid.time.size) + first
    keep = (rows >= 0) & (rows < hours)
    good[rows[keep]] = True
    for name in names:
        values = np.full(hours, np.nan)
        values[rows[keep]] = grid[name][keep]
        known = np.isfinite(values)
        good &= known
        if not known.any():
            raise IgrowError(f"the log has no value of {name}")
        columns[name] = gaps.held(values)[None]
    light = simulator.light.par(np, columns["global_radiation"], columns["lamp_on"])
    full = derived({**columns, "par": light})
    crop = (*simulator.growth.states, *simulator.harvest.states)
    start = {name: float(seasons.columns[name][0, 0]) for name in crop}
    full["leaf_area_index"] = free_growth(simulator, full, start, seasons.hour)["leaf_area_index"]
    data = hourly_data(stage, full, seasons.hour, good[None])
    return RealRun(data, int(np.flatnonzero(good)[-1]) // WEEK + 1)


def only_weeks(data: StageData, first: int, last: int) -> StageData:
    """Return the data with nothing valid outside weeks `first` to `last` (not included)."""
    valid = data.valid.copy()
    valid[:, : first * WEEK] = False
    valid[:, last * WEEK :] = False
    return replace(data, valid=valid)


def joined(virtual: StageData, real: StageData, share: float) -> StageData:
    """Return both, windows drawn from the real run with probability `share`."""
    count = virtual.states.shape[0]
    ratio = virtual.valid.sum() / max(int(real.valid.sum()), 1) * share / (1.0 - share)
    weight = np.concatenate([np.ones(count), np.full(real.states.shape[0], float(ratio))])
    return StageData(
        np.concatenate([virtual.drivers, real.drivers]),
        np.concatenate([virtual.states, real.states]),
        virtual.hour,
        np.concatenate([virtual.valid, real.valid]),
        weight,
    )


def day_starts(data: StageData) -> Integers:
    """Return (run, hour) of each midnight with 24 valid hours before it and 24 after."""
    starts = [
        (run, hour)
        for run, valid in enumerate(data.valid)
        for hour in range(24, valid.size - 24)
        if data.hour[hour] == 0 and valid[hour - 24 : hour + 25].all()
    ]
    if not starts:
        raise IgrowError("no day without gaps to score")
    return np.array(starts)


def day_errors(stage: Stage, data: StageData) -> tuple[Floats, Floats]:
    """Return the mean absolute error of 24 h free runs from each midnight, and that of persistence, (states,).

    Persistence says that each hour will be as the same hour of the day before.
    """
    starts = day_starts(data)
    rows = starts[:, 1:] + 1 + np.arange(24)
    truth = data.states[starts[:, :1], rows]
    yesterday = data.states[starts[:, :1], rows - 24]
    miss = np.abs(run_windows(stage, data, starts, 24) - truth).mean(axis=(0, 1))
    return np.asarray(miss), np.asarray(np.abs(yesterday - truth).mean(axis=(0, 1)))


@dataclass(frozen=True)
class Step:
    """The simulator after one step of the mechanism, scored on seasons and weeks it has not seen."""

    name: str
    virtual: dict[str, float]
    """R2 of free runs over whole virtual test seasons, mean over the seasons."""
    real: dict[str, float]
    """Mean absolute error of 24 h free runs in the last weeks of the real greenhouse, in the unit of the quantity."""


def stream(stage: Stage, virtual: StageData, real: StageData, weeks: range, share: float, seed: int) -> Stage:
    """Return the stage fine-tuned after each week on all real weeks so far, rehearsing virtual ones (share < 1)."""
    for week in weeks:
        known = only_weeks(real, 0, week + 1)
        data = known if share >= 1.0 else joined(virtual, known, share)
        stage = train_stage(stage, data, replace(WEEKLY, seed=seed + week))
    return stage


def run(
    virtual: Path, real: Path, compartment: str, out: Path, seed: int = 7, layouts: Layouts | None = None
) -> list[Step]:
    """Run the three steps, print the table and write incremental.json to `out`."""
    chosen = layouts or Layouts()
    seasons = read_seasons(virtual)
    split = split_seasons(len(seasons.names), seed)
    training, test = seasons.select(split.training), seasons.select(split.test)
    base = train_simulator(training.columns, seasons.hour, seasons.valid, chosen, seed, print)
    measured = hourly_run(agc2019.read(real, compartment).telemetry, seasons, base)
    virtual_data = hourly_data(base.climate, derived(training.columns), seasons.hour, seasons.valid)
    last = measured.weeks - TEST_WEEKS
    if last <= FIRST_WEEKS:
        raise IgrowError(f"{real}: {measured.weeks} weeks; more than {FIRST_WEEKS + TEST_WEEKS} are needed")
    held_out = only_weeks(measured.data, last, measured.weeks)

    def scored(name: str, simulator: NetworkSimulator) -> Step:
        followed = score(test.columns, free_run(simulator, test.columns, test.hour), seasons.valid)
        errors, persistence = day_errors(simulator.climate, held_out)
        print(f"{name}: 24 h errors {np.round(errors, 2)}, persistence {np.round(persistence, 2)}")
        return Step(
            name,
            {key: value.mean for key, value in followed.items()},
            dict(zip(simulator.climate.states, (float(error) for error in errors), strict=True)),
        )

    steps = [scored("virtual seasons only", base)]
    mixed_data = joined(virtual_data, only_weeks(measured.data, 0, FIRST_WEEKS), REAL_SHARE)
    start = untrained(chosen.climate, mixed_data, seed)
    mixed = replace(base, climate=train_stage(start, mixed_data, replace(MIXED, seed=seed), print))
    steps.append(scored(f"real weeks 1 to {FIRST_WEEKS} replace virtual ones", mixed))
    for name, share in (("stream, virtual seasons rehearsed", REAL_SHARE), ("stream, nothing rehearsed", 1.0)):
        tuned = stream(mixed.climate, virtual_data, measured.data, range(FIRST_WEEKS, last), share, seed)
        steps.append(scored(name, replace(mixed, climate=tuned)))
    print(as_text(steps))
    out.mkdir(parents=True, exist_ok=True)
    (out / "incremental.json").write_text(json.dumps([asdict(step) for step in steps], indent=1))
    return steps


def as_text(steps: list[Step]) -> str:
    """Return the table: R2 on the virtual test seasons, then 24 h errors on the real test weeks."""
    rows = ["| quantity | " + " | ".join(step.name for step in steps) + " |", "|---" * (len(steps) + 1) + "|"]
    for name in SCORED:
        rows.append(f"| virtual, R2: {name} | " + " | ".join(f"{step.virtual[name]:.3f}" for step in steps) + " |")
    for name in steps[0].real:
        rows.append(f"| real, 24 h error: {name} | " + " | ".join(f"{step.real[name]:.2f}" for step in steps) + " |")
    return "\n".join(rows)


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `reproduce incremental`."""
    parser.add_argument("--virtual", type=Path, required=True, help="folder with trajectories.parquet, or the file")
    parser.add_argument("--real", type=Path, required=True, help="folder of the second challenge")
    parser.add_argument("--compartment", default="Reference", help="with measured climate (Reference)")
    parser.add_argument("--out", type=Path, required=True, help="folder for incremental.json")
    parser.add_argument("--seed", type=int, default=7, help="of the split, the weights and the windows (7)")
