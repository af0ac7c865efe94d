"""`igrow-trainer import`: find out how an export is to be read, and write that down as its mapping."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.site import Site, load_site
from igrow.core.whole_files import write_whole
from igrow.trainer.data.importing.check import Checked, check
from igrow.trainer.data.importing.proposal import Proposal, propose
from igrow.trainer.data.importing.question import Answers, Question
from igrow.trainer.data.importing.show import as_yaml, mapping_path, understood
from igrow.trainer.data.reading import prepare_log
from igrow.trainer.data.telemetry_files import files_in

EXAMPLE = "igrow-trainer import export.csv --site site.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "file", nargs="+", type=Path, metavar="FILE", help="export: CSV, text, Excel or Parquet; or a folder of such"
    )
    parser.add_argument("--site", type=Path, help="the site's YAML file: its zone and its sun tell much")
    parser.add_argument(
        "--time-zone", metavar="ZONE", help="of times that do not tell theirs, such as Europe/Amsterdam"
    )
    parser.add_argument("--date-order", choices=("dmy", "mdy", "ymd"), help="of day, month and year")
    parser.add_argument("--compartment", metavar="NAME", help="the one to read, where the export has several")
    parser.add_argument("--sheet", metavar="NAME", help="of a workbook (default: the fullest)")
    parser.add_argument("--column", action="append", default=[], metavar="QUANTITY=COLUMN", help="what a column is")
    parser.add_argument("--unit", action="append", default=[], metavar="QUANTITY=UNIT", help="what a column is in")
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="plot of the log (default: NAME.import.svg beside it)"
    )
    parser.add_argument("--dry-run", action="store_true", help="show what is understood, and write nothing")
    parser.add_argument("--force", action="store_true", help="replace a mapping that is there")


def run(arguments: argparse.Namespace) -> int:
    """Import; returns 0, or 2 where something is open that only the user knows.

    Raises:
        IgrowError: a file is no table of readings over time.
    """
    site = load_site(arguments.site) if arguments.site is not None else None
    answers = Answers(
        arguments.time_zone,
        arguments.date_order,
        arguments.compartment,
        arguments.sheet,
        _pairs("--column", arguments.column),
        _pairs("--unit", arguments.unit),
    )
    done = [_import(given, site, answers, arguments) for given in arguments.file]
    if not all(done):
        return 2
    if not arguments.dry_run:
        files, place = " ".join(map(str, arguments.file)), arguments.site or "site.yaml"
        print(f"\nnext: igrow-trainer calibrate {files} --site {place} --fit-weeks 4 --out bundle")
        print(f"then: igrow-trainer diagnose {files} --site {place} --bundle bundle --out diagnosis")
    return 0


def _pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    pairs = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not value:
            raise IgrowError(f"{option} {text}: QUANTITY=... is needed, such as {option} air_temperature=...")
        pairs[name.strip()] = value.strip()
    return pairs


def _import(given: Path, site: Site | None, answers: Answers, arguments: argparse.Namespace) -> bool:
    """Import one file, or the layout that all files of a folder share; tells whether nothing is left open."""
    path = files_in(given)[0]
    target = mapping_path(path, given)
    if target.exists() and not (arguments.force or arguments.dry_run):
        raise IgrowError(f"{target} exists already: --force replaces it")
    if sys.stderr.isatty():
        print(f"reading {path}", file=sys.stderr)
    proposal, open_ones = _asked(path, site, answers)
    checked = check(proposal, site)
    print("\n".join(understood(proposal, checked)))
    for label, lines in (
        ("note", (*proposal.notes, *checked.merged.notes)),
        ("set right", checked.mended),
        ("data fault", tuple(map(str, checked.faults))),
    ):
        for line in lines:
            print(f"{label}: {line}")
    needed = [question for question in open_ones if not _settled(question, proposal, checked)]
    for question in needed:
        print(f"open: {question.text} ({', '.join(question.choices[:8])}): answer with {question.option}")
    if arguments.dry_run:
        return not needed
    if any(question.about in ("compartment", "date_order", "time_zone") for question in needed):
        print(f"error: {target} is not written while this is open", file=sys.stderr)
        return False
    remarks = [f"How {given.name} is to be read; written by igrow-trainer import.", *checked.mended]
    write_whole(target, as_yaml(checked.mapping, remarks).encode())
    print(f"wrote {target}")
    plot = arguments.plot or path.with_name(f"{path.name.split('.')[0]}.import.svg")
    if len(checked.merged.telemetry) > 1 and checked.mapping.columns:
        prepare_log(checked.merged.telemetry, site, name=path.name).plot(plot)
        print(f"wrote {plot}")
    return True


def _settled(question: Question, proposal: Proposal, checked: Checked) -> bool:
    """Tell whether the sun has answered a question about the clock."""
    return question.about == "time_zone" and checked.mapping.time.time_zone != proposal.mapping.time.time_zone


def _asked(path: Path, site: Site | None, answers: Answers) -> tuple[Proposal, tuple[Question, ...]]:
    """Return the proposal with the answers that a user at a terminal gives, and the questions that stay open."""
    proposal = propose(path, site, answers)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return proposal, proposal.questions
    skipped: set[str] = set()
    while True:
        question = next((one for one in proposal.questions if one.about not in skipped), None)
        if question is None:
            return proposal, tuple(one for one in proposal.questions if one.about in skipped)
        print(f"{path.name}: {question.text}")
        for number, choice in enumerate(question.choices, 1):
            print(f"  {number}  {choice}")
        reply = input("number or name (nothing: leave it open): ").strip()
        if not reply:
            skipped.add(question.about)
            continue
        chosen = (
            question.choices[int(reply) - 1] if reply.isdigit() and 0 < int(reply) <= len(question.choices) else reply
        )
        try:
            answered = _with_answer(answers, question.about, chosen)
            proposal, answers = propose(path, site, answered), answered
        except IgrowError as error:
            print(f"error: {error}")


def _with_answer(answers: Answers, about: str, chosen: str) -> Answers:
    kind, _, quantity = about.partition(":")
    changes: dict[str, Any] = {kind: {**getattr(answers, kind), quantity: chosen} if quantity else chosen}
    return replace(answers, **changes)
