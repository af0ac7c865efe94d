"""`igrow-trainer evaluate`: score a bundle on a log that it has not seen, beside persistence."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.trainer.cli.log_arguments import add_log_arguments, log_of
from igrow.trainer.cli.progress import progress
from igrow.trainer.scoring.bundles import score_bundle, unseen_part
from igrow.trainer.scoring.comparison import as_table

EXAMPLE = "igrow-trainer evaluate later.csv --bundle out/bundle --site config/site.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    add_log_arguments(parser)
    parser.add_argument("--bundle", type=Path, help="of either variant (default: the built-in one)")
    parser.add_argument("--out", type=Path, help="write the errors to this JSON file too")


def run(arguments: argparse.Namespace) -> int:
    """Score and print."""
    log = log_of(arguments)
    bundle = read_bundle(arguments.bundle or default_bundle_folder())
    for note in unseen_part(log, bundle.manifest).notes[len(log.notes) :]:
        print(f"note: {note}", file=sys.stderr)
    with progress("evaluating") as say:
        found = score_bundle(log, bundle, progress=say)
    if not any(found.values()):
        raise IgrowError(f"{log.name}: no stretch of the log is complete enough to run the bundle on")
    print(f"\n{bundle.label} on {log.name}\n{as_table(found, intervals=True)}")
    if arguments.out is not None:
        content = {
            how: {name: {horizon: asdict(one) for horizon, one in by.items()} for name, by in scores.items()}
            for how, scores in found.items()
        }
        arguments.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return 0
