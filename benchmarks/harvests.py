"""Measured harvests of ten compartments against four predictors, each fitted without the compartment it predicts.

    python -m benchmarks.harvests DATA

DATA holds the folders `agc2019` and `agc2018` of the Autonomous Greenhouse Challenges.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from igrow.trainer.research.paper.compartments import Compartment, read_2018, read_2019
from igrow.trainer.research.paper.harvests import PREDICTORS


@dataclass(frozen=True)
class HarvestError:
    """Errors of one predictor on one compartment that it had not seen, kg m-2."""

    compartment: str
    predictor: str
    mean_absolute: float
    """Of the cumulative harvest over the harvest days."""
    season: float
    """Predicted less measured at the last harvest."""
    measured: float
    """Measured total."""


def leave_one_out(compartments: Sequence[Compartment]) -> list[HarvestError]:
    """Return the errors of all predictors on each compartment, fitted on the others."""
    errors = []
    for crop in compartments:
        others = [other for other in compartments if other is not crop]
        for name, predictor in PREDICTORS.items():
            miss = predictor(others, crop)[crop.harvest_day] - crop.harvested
            errors.append(
                HarvestError(crop.name, name, float(np.abs(miss).mean()), float(miss[-1]), float(crop.harvested[-1]))
            )
    return errors


def as_text(title: str, errors: Sequence[HarvestError]) -> str:
    """Return a table: compartments down, predictors across; mean absolute error and season's error in kg m-2."""
    names = list(PREDICTORS)
    rows = [
        f"{title}: mean absolute error of the cumulative harvest (error of the season's total), kg m-2",
        "| compartment | measured | " + " | ".join(names) + " |",
        "|---" * (len(names) + 2) + "|",
    ]
    for crop in dict.fromkeys(error.compartment for error in errors):
        mine = {error.predictor: error for error in errors if error.compartment == crop}
        cells = [f"{mine[name].mean_absolute:.2f} ({mine[name].season:+.2f})" for name in names]
        rows.append(f"| {crop} | {mine[names[0]].measured:.2f} | " + " | ".join(cells) + " |")
    cells = []
    for name in names:
        mine_all = [error for error in errors if error.predictor == name]
        absolute = np.mean([error.mean_absolute for error in mine_all])
        cells.append(f"{absolute:.2f} ({np.mean([abs(error.season) for error in mine_all]):.2f} absolute)")
    rows.append("| mean | | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with agc2019 and agc2018")
    data = parser.parse_args().data
    for title, read, folder in (
        ("2019, cherry tomato", read_2019, "agc2019"),
        ("2018, cucumber", read_2018, "agc2018"),
    ):
        print(as_text(title, leave_one_out(read(data / folder))), end="\n\n")


if __name__ == "__main__":
    main()
