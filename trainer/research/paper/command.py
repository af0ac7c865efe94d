"""`igrow-trainer reproduce`: one subcommand for each published table or figure."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from inspect import signature

from igrow.trainer.research.paper import figure3, incremental, pilot, seasons, table1

EXAMPLE = "igrow-trainer reproduce table1 --data data/wur2020 --out reproduced"

PARTS = {
    "table1": (table1, "R2 of whole virtual seasons run freely, beside the published table 1"),
    "incremental": (incremental, "table 1 before and after real data join the virtual ones"),
    "seasons": (seasons, "R2 of a trained network bundle on seasons that it has not seen"),
    "figure3": (figure3, "net profit of the 2020 champion, predicted against measured"),
    "pilot": (pilot, "the pilot in Liaoyang: its table with spreads and tests, figures 5 and S4 to S13"),
}


def add_arguments(parser: ArgumentParser) -> None:
    """Add a subparser for each table or figure."""
    parts = parser.add_subparsers(dest="part", metavar="PART", required=True)
    for name, (module, summary) in PARTS.items():
        part = parts.add_parser(name, help=summary, description=summary)
        module.add_arguments(part)


def run(arguments: Namespace) -> int:
    """Run one part, which takes its arguments by the names that they have on the command line."""
    part, _ = PARTS[arguments.part]
    given = vars(arguments)
    part.run(**{name: given[name] for name in signature(part.run).parameters if name in given})
    return 0
