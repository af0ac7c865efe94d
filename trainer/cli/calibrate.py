"""`igrow-trainer calibrate`: fit the simulator to a log, and tell its errors on weeks that the fit has not seen."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.language import LANGUAGES, speak
from igrow.trainer.calibration import calibrate
from igrow.trainer.cli.log_arguments import add_log_arguments, log_of
from igrow.trainer.cli.progress import progress
from igrow.trainer.exporting import export, read_model
from igrow.trainer.fit.population import read_population
from igrow.trainer.report.sentences import omission

EXAMPLE = "igrow-trainer calibrate DATA/agc2019 --compartment Reference --out out/reference"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    add_log_arguments(parser)
    parser.add_argument(
        "--bundle", type=Path, help="bundle of what is known of the greenhouse before (default: its description alone)"
    )
    parser.add_argument(
        "--population", type=Path, metavar="FILE", help="what `igrow-trainer fleet learn` wrote of greenhouses like it"
    )
    parser.add_argument(
        "--fit-weeks", type=int, help="fit to so many first weeks of the log only (default: all; see evaluate)"
    )
    parser.add_argument(
        "--complete", action="store_true", help="put the term into the bundle that its log says the model lacks"
    )
    parser.add_argument("--language", choices=LANGUAGES, default=LANGUAGES[0], help="of what the model lacks (en)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the new bundle; must not exist yet")


def run(arguments: argparse.Namespace) -> int:
    """Fit, tell, write the bundle."""
    if arguments.out.exists():
        raise IgrowError(f"{arguments.out} exists already; name a new folder")
    log = log_of(arguments)
    log.require("a calibration")
    if arguments.fit_weeks is not None:
        if arguments.fit_weeks < 1:
            raise IgrowError("--fit-weeks: one week at least")
        log = log.select(None, log.telemetry.time[0] + np.timedelta64(7 * arguments.fit_weeks, "D"))
    if arguments.bundle and arguments.population:
        raise IgrowError("--bundle and --population: one of them says what is known before, not both")
    before = read_model(arguments.bundle, log.known_site) if arguments.bundle else None
    population = read_population(arguments.population) if arguments.population else None
    with progress("calibrating") as say:
        model = calibrate(log, prior_model=before, population=population, complete=arguments.complete, progress=say)
        say("writing the bundle")
        bundle = export(model, arguments.out)
    print(f"{model.summary()}\n")
    if model.omission is not None:
        told = omission(model.omission, speak(arguments.language), completed=arguments.complete)
        print("\n".join([*told, ""]))
    print(f"wrote {bundle.folder} ({bundle.label})")
    return 0
