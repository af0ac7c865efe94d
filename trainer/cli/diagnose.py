"""`igrow-trainer diagnose`: find what the simulator lacks, and why; write the report and the corrected bundle."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.trainer.cli.log_arguments import add_log_arguments, log_of
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.exporting import export, read_model
from igrow.trainer.fit import FittedModel
from igrow.trainer.report import write_diagnosis

EXAMPLE = "igrow-trainer diagnose logs/ --bundle bundle/ --site site.yaml --out diagnosis/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_log_arguments(parser)
    parser.add_argument("--bundle", type=Path, help="the bundle in force (default: the built-in one)")
    parser.add_argument("--out", type=Path, required=True, help="folder for diagnosis.json, report.html and the bundle")
    parser.add_argument("--without", action="append", default=[], metavar="EFFECT", help="an effect not to consider")
    parser.add_argument("--seed", type=int, default=0, help="of random flips and bootstraps")


def run(arguments: argparse.Namespace) -> int:
    """Diagnose; returns 0 nothing, 10 named, 11 ambiguous, 12 unexplained, 13 data fault.

    Raises:
        IgrowError: a file cannot be read or the log cannot be diagnosed.
    """
    log = log_of(arguments)
    bundle = read_bundle(arguments.bundle or default_bundle_folder())
    model = read_model(bundle, log.known_site)
    result = diagnose(log, model, without=arguments.without, seed=arguments.seed)
    write_diagnosis(arguments.out, result)
    if result.findings:
        replace_bundle(arguments.out / "bundle", result.corrected)
    print(result.summary())
    print(f"written to {arguments.out}", file=sys.stderr)
    return result.exit_code


def replace_bundle(folder: Path, model: FittedModel) -> None:
    """Write a model as a bundle in the place of an earlier one, which stays until the new one is whole."""
    fresh = folder.with_name(f"{folder.name}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    export(model, fresh)
    shutil.rmtree(folder, ignore_errors=True)
    fresh.rename(folder)
