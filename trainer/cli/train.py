"""`igrow-trainer train`: train the growth and yield stages on seasons, and put them into a bundle."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from igrow.core.bundle import default_bundle_folder
from igrow.core.errors import IgrowError
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.site import load_site
from igrow.trainer.cli.progress import progress
from igrow.trainer.data import read_log
from igrow.trainer.exporting import export, read_model
from igrow.trainer.training.crop import fit_net_growth, train_networks

EXAMPLE = "igrow-trainer train out/virtual/*.csv.gz --site config/site.yaml --out out/trained"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("seasons", type=Path, nargs="+", help="telemetry files, one a season, equally long")
    parser.add_argument("--site", type=Path, required=True, help="site file")
    parser.add_argument("--bundle", type=Path, help="bundle that brings the climate stage (default: the built-in one)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the new bundle; must not exist yet")
    parser.add_argument("--seed", type=int, default=0, help="of weights and windows (default 0)")


def run(arguments: argparse.Namespace) -> int:
    """Train and write the bundle."""
    if arguments.out.exists():
        raise IgrowError(f"{arguments.out} exists already; name a new folder")
    site = load_site(arguments.site)
    model = read_model(arguments.bundle or default_bundle_folder(), site)
    seasons = [read_log(path, site).telemetry for path in arguments.seasons]
    with progress("training") as say:
        growth, harvest = train_networks(seasons, seed=arguments.seed, progress=say)
        say("fitting the net growth")
        records = [site_record(season, site, max(300.0, season.step)) for season in seasons]
        conversion, maintenance = fit_net_growth(records, model.posterior.values, seasons)
        crop = CropStages(growth, harvest, conversion, maintenance)
        bundle = export(replace(model, crop=crop), arguments.out)
    print(f"wrote {bundle.folder} ({bundle.label})")
    return 0
