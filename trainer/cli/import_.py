"""`igrow-trainer import`: find out how an export is to be read, and write that down as its mapping."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.site import Site, load_site
from igrow.core.telemetry import concatenate
from igrow.core.whole_files import write_whole
from igrow.trainer.data.cells import is_archive
from igrow.trainer.data.importing.archive import unpack
from igrow.trainer.data.importing.check import Checked, check
from igrow.trainer.data.importing.folder import alike
from igrow.trainer.data.importing.proposal import Proposal, propose
from igrow.trainer.data.importing.question import Answers, Question
from igrow.trainer.data.importing.show import as_yaml, aside, understood
from igrow.trainer.data.reading import prepare_log
from igrow.trainer.data.telemetry_files import MAPPING_FILE, files_in, own_mapping

EXAMPLE = "igrow-trainer import export.csv --site site.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "file",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="export: CSV, text, Excel or Parquet; a folder or a zip archive of such",
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
    """Import; returns 0, or 2 where something is open that only the user knows, whether a mapping was written or not.

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
    with tempfile.TemporaryDirectory(prefix="igrow-import-") as temporary:
        places = [_unpacked(given, Path(temporary), arguments) for given in arguments.file]
        grouped = [_groups(place, site, answers, arguments) for place in places]
        known = {name for groups in grouped for group in groups for name in group.checked.mapping.columns}
        done = [_finish(place, groups, known, site, arguments) for place, groups in zip(places, grouped, strict=True)]
    if not all(done):
        return 2
    if not arguments.dry_run:
        files, place = " ".join(map(str, places)), arguments.site or "site.yaml"
        print(f"\nnext: igrow-trainer calibrate {files} --site {place} --fit-weeks 4 --out bundle")
        print(f"then: igrow-trainer diagnose {files} --site {place} --bundle bundle --out diagnosis")
    return 0


def _unpacked(given: Path, temporary: Path, arguments: argparse.Namespace) -> Path:
    """Return the folder of an archive's tables: beside it, or a temporary one where nothing is to be written."""
    if not is_archive(given):
        return given
    if arguments.dry_run:
        return unpack(given, temporary / given.stem)
    folder = given.with_suffix("")
    if folder.exists() and not arguments.force:
        raise IgrowError(f"{folder} exists already: import that, or --force to unpack {given.name} into it once more")
    unpack(given, folder)
    print(f"unpacked {given} into {folder}")
    return folder


def _pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    pairs = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not value:
            raise IgrowError(f"{option} {text}: QUANTITY=... is needed, such as {option} air_temperature=...")
        pairs[name.strip()] = value.strip()
    return pairs


@dataclass(frozen=True)
class _Group:
    """Files of one layout, and what was understood of them."""

    files: Sequence[Path]
    targets: Sequence[Path]
    proposal: Proposal
    checked: Checked
    open_ones: Sequence[Question]


def _groups(given: Path, site: Site | None, answers: Answers, arguments: argparse.Namespace) -> list[_Group]:
    """Return what is understood of one file, or of the layouts of a folder's files."""
    alikes = alike(files_in(given), answers.sheet)
    shared = given.is_dir() and len(alikes) == 1
    groups = []
    for files in alikes:
        targets = [given / MAPPING_FILE] if shared else [own_mapping(path) for path in files]
        there = next((target for target in targets if target.exists()), None)
        if there is not None and not (arguments.force or arguments.dry_run):
            raise IgrowError(f"{there} exists already: --force replaces it")
        if sys.stderr.isatty():
            print(f"reading {files[0]}", file=sys.stderr)
        proposal, open_ones = _asked(files, site, answers)
        groups.append(_Group(files, targets, proposal, check(proposal, site), open_ones))
    return groups


def _finish(
    given: Path, groups: Sequence[_Group], known: Collection[str], site: Site | None, arguments: argparse.Namespace
) -> bool:
    """Say what was understood of a file or folder and write it down; tells whether nothing is left open.

    `known` are the quantities that this or another file of the call has.
    """
    parts = [group.checked.merged.telemetry for group in groups if group.checked.mapping.columns]
    log = prepare_log(concatenate(parts), site, name=given.name) if parts and any(map(len, parts)) else None
    needed = [question for group in groups for question in _told(group, known)]
    for line in aside(log) if log is not None else ():
        print(f"note: {line}")
    for question in needed:
        choices = f" ({', '.join(question.choices[:8])})" if question.choices else ""
        print(f"open: {question.text}{choices}: answer with {question.option}")
    if arguments.dry_run:
        return not needed
    if any(question.blocks for question in needed):
        print(f"error: {groups[0].targets[0]} is not written while this is open", file=sys.stderr)
        return False
    for group in groups:
        for path, target in zip(group.files, group.targets, strict=False):
            name = given.name if target.name == MAPPING_FILE else path.name
            remarks = [f"How {name} is to be read; written by igrow-trainer import.", *group.checked.mended]
            write_whole(target, as_yaml(group.checked.mapping, remarks).encode())
            print(f"wrote {target}")
    first = groups[0].files[0]
    plot = arguments.plot or first.with_name(f"{first.name.split('.')[0]}.import.svg")
    if log is not None and len(log) > 1:
        log.plot(plot)
        print(f"wrote {plot}")
    if needed:
        print("the mapping leaves out what is open; with the answer, --force replaces it")
    return not needed


def _told(group: _Group, known: Collection[str]) -> list[Question]:
    """Print what was understood of files of one layout; returns what is left open."""
    proposal, checked = group.proposal, group.checked
    print("\n".join(understood(proposal, checked)))
    for label, lines in (
        ("note", (*proposal.notes, *checked.merged.notes)),
        ("set right", checked.mended),
        ("data fault", tuple(map(str, checked.faults))),
    ):
        for line in lines:
            print(f"{label}: {line}")
    # Where the zone is another one now, the sun has answered the question about the clock.
    answered = {"time_zone"} if checked.mapping.time.time_zone != proposal.mapping.time.time_zone else set()
    return [
        one
        for one in group.open_ones
        if one.about not in answered and (one.blocks or one.about.removeprefix("columns:") not in known)
    ]


def _asked(files: Sequence[Path], site: Site | None, answers: Answers) -> tuple[Proposal, tuple[Question, ...]]:
    """Return the proposal with the answers that a user at a terminal gives, and the questions that stay open."""
    path, further = files[0], files[1:]
    proposal = propose(path, site, answers, further)
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
            proposal, answers = propose(path, site, answered, further), answered
        except IgrowError as error:
            print(f"error: {error}")


def _with_answer(answers: Answers, about: str, chosen: str) -> Answers:
    kind, _, quantity = about.partition(":")
    changes: dict[str, Any] = {kind: {**getattr(answers, kind), quantity: chosen} if quantity else chosen}
    return replace(answers, **changes)
