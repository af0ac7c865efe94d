"""`igrow-trainer recalibrate`: collect and diagnose the sites of an exchange, and publish what is better."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.site import load_site
from igrow.trainer.cli.common import add_exchange, exchange_of, utc_now
from igrow.trainer.publishing import publish
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect
from igrow.trainer.service.recalibration import DAYS, recalibrate
from igrow.trainer.service.site_memory import site_folder

EXAMPLE = "igrow-trainer recalibrate --exchange /srv/igrow --keys keys --state state --site site.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_exchange(parser)
    parser.add_argument("--keys", type=Path, required=True, help="folder of the signing keys")
    parser.add_argument(
        "--state", type=Path, required=True, help="folder of the archive, the histories and the bundles"
    )
    parser.add_argument("--site", type=Path, action="append", required=True, help="a site's YAML file; may be repeated")
    parser.add_argument("--days", type=int, default=DAYS, help=f"newest days of the log to look at (default {DAYS})")
    parser.add_argument("--force", action="store_true", help="run also where the site's pace says not yet")


def run(arguments: argparse.Namespace) -> int:
    """Run every site once; returns 1 where one failed, which is tried again at the next run."""
    place, archive = exchange_of(arguments), Archive(arguments.state / "archive")
    failed = False
    for path in arguments.site:
        try:
            site = load_site(path)
            collected = collect(place, site.name, archive, utc_now())
        except IgrowError as error:
            print(f"{path.stem}: error; {error}", flush=True)
            failed = True
            continue
        turn = recalibrate(
            site,
            archive,
            site_folder(arguments.state, site.name),
            partial(publish, exchange=place, keys=arguments.keys),
            now=utc_now(),
            days=arguments.days,
            force=arguments.force,
        )
        failed |= turn.verdict == "error"
        causes = f" ({', '.join(turn.causes)})" if turn.causes else ""
        print(f"{turn.site}: {turn.verdict}{causes}; {turn.note}")
        for note in (*collected.notes, *turn.notes):
            print(f"  {note}", flush=True)
    return int(failed)
