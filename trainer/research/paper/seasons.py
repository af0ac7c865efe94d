"""Score a trained network simulator on seasons it has not seen: free runs of whole seasons, R2 per quantity."""

from __future__ import annotations

import json
from argparse import ArgumentParser
from dataclasses import asdict
from pathlib import Path

import numpy as np

from igrow.core.simulator.network_run import free_run
from igrow.trainer.research.network.checkpoint import load_simulator
from igrow.trainer.research.paper.scores import PUBLISHED_BASELINE, PUBLISHED_INCREMENTAL, SCORED, Score, score
from igrow.trainer.research.paper.wur2020 import read_seasons


def run(bundle: Path, data: Path, out: Path | None = None) -> dict[str, Score]:
    """Run every season of `data` (a file in the format of trajectories.parquet) with the networks of `bundle`.

    `bundle` is a bundle of the network variant, a folder of results that holds one, or a file of networks. Returns
    and prints the scores without the two faulty days, prints those over every hour too, and writes both as JSON to
    `out` where given.
    """
    simulator, seasons = load_simulator(bundle), read_seasons(data)
    predicted = free_run(simulator, seasons.columns, seasons.hour)
    scores = score(seasons.columns, predicted, seasons.valid)
    every_hour = score(seasons.columns, predicted, np.ones_like(seasons.valid))
    print(f"{len(seasons.names)} seasons of {seasons.time.size} hours, free runs from the first hour, R2")
    print("| quantity | mean | worst season | every hour | published | published, incremental |")
    print("|---|---|---|---|---|---|")
    for name in SCORED:
        mine = scores[name]
        print(
            f"| {name} | {mine.mean:.4f} | {mine.low:.4f} | {every_hour[name].mean:.4f} |"
            f" {PUBLISHED_BASELINE[name]:.3f} | {PUBLISHED_INCREMENTAL[name]:.3f} |"
        )
    if out is not None:
        content = {"seasons": seasons.names, "scores": {name: asdict(value) for name, value in scores.items()}}
        content["every_hour"] = {name: asdict(value) for name, value in every_hour.items()}
        out.write_text(json.dumps(content, indent=1))
    return scores


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `reproduce seasons`."""
    parser.add_argument("--bundle", type=Path, required=True, help="network bundle, or the folder of table1")
    parser.add_argument("--data", type=Path, required=True, help="a file in the format of trajectories.parquet")
    parser.add_argument("--out", type=Path, help="write the scores to this JSON file")
