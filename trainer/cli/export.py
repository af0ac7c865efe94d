"""`igrow-trainer export`: write the bundle of a site from another bundle's simulator."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from igrow.core.bundle import default_bundle_folder, self_test
from igrow.core.errors import IgrowError
from igrow.core.site import load_site
from igrow.trainer.exporting import export, read_model

EXAMPLE = "igrow-trainer export --site config/site.yaml --out out/first-bundle"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("--site", type=Path, required=True, help="site file that the bundle is for")
    parser.add_argument("--bundle", type=Path, help="bundle that brings the simulator (default: the built-in one)")
    parser.add_argument(
        "--same-greenhouse",
        action="store_true",
        help="the bundle was calibrated on this very greenhouse, under another name (a diagnosis then believes it)",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the new bundle; must not exist yet")


def run(arguments: argparse.Namespace) -> int:
    """Export and test."""
    if arguments.out.exists():
        raise IgrowError(f"{arguments.out} exists already; name a new folder")
    site = load_site(arguments.site)
    model = read_model(arguments.bundle or default_bundle_folder(), site)
    if arguments.bundle is None:
        model = model.equipped()
    if arguments.same_greenhouse:
        model = replace(model, calibrated_on=site.name)
    bundle = export(model, arguments.out)
    worst = max(self_test(bundle), key=lambda deviation: deviation.relative)
    print(f"wrote {bundle.folder} ({bundle.label}); self-test: {worst.graph} {worst.output} {worst.relative:.1e}")
    return 0
