"""Table 1 of Cao et al. (2022): whole virtual seasons run freely from their first hour, R2 per quantity.

Seasons are split by trajectory into training, selection and test. What was chosen (drivers, architecture, number of
updates) was chosen on the selection seasons, which `--choose` scores after training on the training seasons; the table
trains on both and scores the test seasons. All seasons of this data set share one weather year, so beside the networks
stands the simplest predictor of all: the mean of the training seasons, hour by hour, which knows neither setpoints nor
the state.
"""

from __future__ import annotations

import json
import time
from argparse import ArgumentParser
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.errors import IgrowError
from igrow.core.simulator.network_run import free_run
from igrow.trainer.research.network.checkpoint import BUNDLE_FOLDER
from igrow.trainer.research.network.export import write_network_bundle
from igrow.trainer.research.network.simulator import CLIMATE, Layouts, train_simulator
from igrow.trainer.research.paper.scores import PUBLISHED_BASELINE, PUBLISHED_INCREMENTAL, SCORED, Score, score
from igrow.trainer.research.paper.wur2020 import Seasons, TrajectoryFileError, read_seasons

SITE = "wur2020"
SETTINGS = ("ventilation_offset", "lamp_radiation_limit")
"""Settings of the virtual greenhouse computer: inputs of the published seasons, the same in all of them."""
LAYOUTS = Layouts(replace(CLIMATE, drivers=(*CLIMATE.drivers, *SETTINGS)), members=4)


@dataclass(frozen=True)
class Split:
    """Rows of the seasons by their use."""

    training: Integers
    selection: Integers
    test: Integers


@dataclass(frozen=True)
class Table:
    """The table with what it was made from."""

    scores: dict[str, Score]
    """The held-out seasons without the two faulty days, as the paper scores."""
    every_hour: dict[str, Score]
    """The held-out seasons over all hours."""
    mean_season: dict[str, Score]
    """The held-out seasons predicted by the hourly mean of those learned from."""
    seconds: float
    learned: tuple[str, ...]
    held_out: tuple[str, ...]


def split_seasons(count: int, seed: int) -> Split:
    """Return a split of `count` seasons at random: 60 % training, 15 % selection, 25 % test."""
    order = np.random.default_rng(seed).permutation(count)
    first, second = round(0.6 * count), round(0.75 * count)
    return Split(order[:first], order[first:second], order[second:])


def run(
    data: Path, out: Path, seed: int = 7, layouts: Layouts = LAYOUTS, *, choose: bool = False, workers: int = 1
) -> Table:
    """Train, run the held-out seasons and write table1.json, table1.png and the folder `bundle` to `out`.

    Learns from training and selection seasons and holds out the test; with `choose` learns from the training seasons
    and holds out the selection.
    """
    begin = time.monotonic()
    if (out / BUNDLE_FOLDER).exists():
        raise IgrowError(f"{out / BUNDLE_FOLDER} exists already; name a new folder")
    seasons = read_seasons(data)
    if len(seasons.names) < 4:
        raise TrajectoryFileError(f"{data}: {len(seasons.names)} seasons; at least 4 are needed to hold some out")
    split = split_seasons(len(seasons.names), seed)
    rows = split.training if choose else np.concatenate([split.training, split.selection])
    learned, held_out = seasons.select(rows), seasons.select(split.selection if choose else split.test)
    simulator = train_simulator(learned.columns, seasons.hour, seasons.valid, layouts, seed, print, workers)
    write_network_bundle(
        out / BUNDLE_FOLDER,
        simulator,
        site=SITE,
        created=datetime.now(UTC),
        training_range={name: (float(values.min()), float(values.max())) for name, values in learned.columns.items()},
    )
    predicted = free_run(simulator, held_out.columns, held_out.hour)
    mean = {name: values.mean(axis=0, keepdims=True) for name, values in learned.columns.items()}
    table = Table(
        scores=score(held_out.columns, predicted, seasons.valid),
        every_hour=score(held_out.columns, predicted, np.ones_like(seasons.valid)),
        mean_season=score(held_out.columns, mean, seasons.valid),
        seconds=time.monotonic() - begin,
        learned=learned.names,
        held_out=held_out.names,
    )
    (out / "table1.json").write_text(json.dumps(asdict(table), indent=1))
    plot(out / "table1.png", held_out, predicted)
    print(as_text(table))
    return table


def as_text(table: Table) -> str:
    """Return the table for people; figures are R2, the mean over the held-out seasons unless said otherwise."""
    rows = [
        "| quantity | this work | worst season | every hour | mean of the seasons learned from | published |"
        " published, incremental |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in SCORED:
        mine, all_hours, mean = (part[name] for part in (table.scores, table.every_hour, table.mean_season))
        rows.append(
            f"| {name} | {mine.mean:.4f} | {mine.low:.4f} | {all_hours.mean:.4f} | {mean.mean:.4f} |"
            f" {PUBLISHED_BASELINE[name]:.3f} | {PUBLISHED_INCREMENTAL[name]:.3f} |"
        )
    learned, held_out = len(table.learned), len(table.held_out)
    rows.append(f"{learned} seasons learned from, {held_out} held out; {table.seconds / 60:.1f} minutes.")
    return "\n".join(rows)


def plot(path: Path, truth: Seasons, predicted: dict[str, Floats]) -> None:
    """Draw the worst held-out season by air temperature: a week of climate, the whole season of growth and harvest."""
    import matplotlib.figure  # noqa: PLC0415, only this function draws

    figure = matplotlib.figure.Figure(figsize=(11, 9), layout="constrained")
    error = np.abs(truth.columns["air_temperature"] - predicted["air_temperature"]).mean(axis=1)
    row = int(error.argmax())
    week = slice(100 * 24, 107 * 24)
    for axes, name in zip(figure.subplots(4, 2).flat, SCORED, strict=True):
        rows = week if name in ("air_temperature", "air_humidity", "air_co2", "par") else slice(None)
        axes.plot(truth.time[rows], truth.columns[name][row, rows], "k", label="season")
        axes.plot(truth.time[rows], predicted[name][row, rows], "C1", label="free run")
        axes.set_title(name, fontsize=9)
        axes.tick_params(labelsize=7)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", fontsize=8)
    figure.suptitle(f"{truth.names[row]}, the held-out season with the largest error of air temperature", fontsize=9)
    figure.savefig(path, dpi=120)


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `reproduce table1`."""
    parser.add_argument("--data", type=Path, required=True, help="folder with trajectories.parquet, or the file")
    parser.add_argument("--out", type=Path, required=True, help="folder for table1.json, table1.png and the bundle")
    parser.add_argument("--seed", type=int, default=7, help="of the split, the weights and the windows (7)")
    parser.add_argument("--workers", type=int, default=2, help="processes that train side by side (2)")
    parser.add_argument("--choose", action="store_true", help="hold out the selection seasons, not the test")
