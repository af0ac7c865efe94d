"""What the documentation names is there: pages, files and folders, modules, commands and their options."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from importlib import import_module, util
from pathlib import Path

import pytest

from igrow.edge.cli import COMMANDS as EDGE
from igrow.trainer.cli import COMMANDS as TRAINER

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
TOLD = [page for page in PAGES if page.name not in ("CHANGELOG.md", "decisions.md")]
"""Pages of what is; the others tell of what was, too."""
FOLDERS = "igrow_core|edge|trainer|benchmarks|tests|config|docs|systemd"
PATH = re.compile(rf"`((?:{FOLDERS})/[\w./-]+)`")
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)")
MODULE = re.compile(r"\b(?:python -m )((?:benchmarks|igrow)[\w.]*)|`(igrow\.(?:core|edge|trainer)[\w.]*)`")
COMMAND = re.compile(r"\b(igrow-edge|igrow-trainer) (?!igrow-)([a-z][a-z-]+)([^`\n|]*)")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")


def named(pattern: re.Pattern[str], page: Path) -> Iterator[tuple[int, re.Match[str]]]:
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        for match in pattern.finditer(line):
            yield number, match


def anchors(page: Path) -> set[str]:
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def options(parser: argparse.ArgumentParser) -> set[str]:
    known = {option for action in parser._actions for option in action.option_strings}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            known = known.union(*(options(one) for one in action.choices.values()))
    return known


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    wrong = []
    for number, match in named(LINK, page):
        target = page.parent / match[1] if match[1] else page
        if not target.exists() or (match[2] and target.suffix == ".md" and match[2] not in anchors(target)):
            wrong.append(f"{page.name}:{number}: {match[0]}")
    assert not wrong


@pytest.mark.parametrize("page", TOLD, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_folders_and_modules_that_are_named_are_there(page: Path) -> None:
    wrong = [
        f"{page.name}:{number}: {match[1]}" for number, match in named(PATH, page) if not (ROOT / match[1]).exists()
    ]
    for number, match in named(MODULE, page):
        name = (match[1] or match[2]).rstrip(".")
        if not found(name):
            wrong.append(f"{page.name}:{number}: {name}")
    assert not wrong


def found(name: str) -> bool:
    """Tell whether a dotted name is a module, or something in one."""
    try:
        if util.find_spec(name) is not None:
            return True
    except ModuleNotFoundError:
        pass
    module, _, rest = name.rpartition(".")
    return bool(module) and util.find_spec(module) is not None and hasattr(import_module(module), rest)


@pytest.mark.parametrize("page", TOLD, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_and_options_that_are_named_are_there(page: Path) -> None:
    wrong = []
    for number, match in named(COMMAND, page):
        commands = EDGE if match[1] == "igrow-edge" else TRAINER
        if match[2] not in commands:
            wrong.append(f"{page.name}:{number}: {match[1]} {match[2]}")
            continue
        parser = argparse.ArgumentParser()
        import_module(commands[match[2]][0]).add_arguments(parser)
        unknown = set(OPTION.findall(match[3])) - options(parser)
        wrong += [f"{page.name}:{number}: {match[1]} {match[2]} {option}" for option in sorted(unknown)]
    assert not wrong
