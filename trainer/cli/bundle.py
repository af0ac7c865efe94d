"""`igrow-trainer bundle`: build the default bundle from the mechanistic greenhouse."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.core.bundle import BUILT_IN
from igrow.core.site import Site, load_site
from igrow.trainer.cli.common import replace_bundle
from igrow.trainer.cli.progress import progress
from igrow.trainer.default_bundle import CREATED, default_model

EXAMPLE = "igrow-trainer bundle --out igrow_core/default_bundle"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("--site", type=Path, help="site file; without one, the defaults of a site")
    parser.add_argument("--out", type=Path, required=True, help="folder of the bundle; replaced if it is there")
    parser.add_argument("--seed", type=int, default=0, help="of the virtual seasons (default 0)")


def run(arguments: argparse.Namespace) -> int:
    """Build the bundle."""
    site = load_site(arguments.site) if arguments.site else Site(name=BUILT_IN, latitude=52.0, longitude=4.5)
    with progress("building") as say:
        model = default_model(site, seed=arguments.seed, progress=say)
        say("writing the bundle")
        bundle = replace_bundle(arguments.out, model, created=CREATED, seed=arguments.seed)
    print(f"wrote {arguments.out} ({bundle.label})")
    return 0
