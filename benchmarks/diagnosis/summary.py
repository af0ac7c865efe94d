"""The diagnosis at a glance: the figures of its pages of results side by side, beside what they were to be.

Nothing is measured here. Each figure is read from the page that its own command has written.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.provenance import ROOT

FOLDER = ROOT / "docs" / "results"
COLUMNS = {
    "same": "a virtual greenhouse some weeks after its calibration, as far off as greenhouses drift",
    "in turn": "one such greenhouse, every cause of the catalogue in it in turn, begun a week after the calibration",
    "structure": "the same of greenhouses of another structure than the model's",
    "built-in": "by the built-in bundle: of the greenhouse only the site's file is known",
    "real": "faults put into five real logs, and columns withheld from them",
}
WIDTH = 15


@dataclass(frozen=True)
class Figure:
    """A figure of a page, and the number of cases that it is of."""

    page: str
    label: str
    """With which its line begins; behind it are numbers."""
    value: int = 0
    """Place of the figure among them; a count, which is divided by the cases, where it is a whole number."""
    cases: int = 1
    """Place of the number of cases."""

    def read(self, folder: Path) -> str:
        """Return figure and cases as they are printed in the summary.

        Raises:
            ValueError: the page has no such line; it is of a command that prints other lines by now.
        """
        path = folder / f"{self.page}.md"
        line = rf"^{re.escape(self.label)}(?:: | {{2,}})(\S.*)$"
        found = re.search(line, path.read_text(encoding="utf-8"), re.MULTILINE)
        numbers = [] if found is None else re.findall(r"(?<!\S)(?:nan|\d+(?:\.\d+)?)(?!\S)", found[1])
        if len(numbers) <= max(self.value, self.cases):
            raise ValueError(f"{path}: holds no figure of '{self.label}'")
        value, cases = numbers[self.value], int(numbers[self.cases])
        if not cases:
            return ""
        return f"{value if '.' in value else format(int(value) / cases, '.2f')} of {cases}"


@dataclass(frozen=True)
class Question:
    """A line of the summary."""

    asked: str
    wanted: str
    """The bound that the figures of the same greenhouse are to keep; a dash for none."""
    answers: Mapping[str, Figure]
    """By column."""


def _of_all(asked: str, wanted: str, label: str, **others: Figure) -> Question:
    """Return a question that three kinds of greenhouses answer by the same label."""
    pages = {"same": "diagnosis-same", "structure": "diagnosis-foreign"}
    return Question(asked, wanted, {**{column: Figure(page, label) for column, page in pages.items()}, **others})


def _in_turn(label: str) -> Figure:
    return Figure("diagnosis-catalogue", label)


def _built_in(label: str) -> Figure:
    return Figure("diagnosis-transferred", label)


def _faults(label: str) -> Figure:
    return Figure("diagnosis-real-faults", label)


QUESTIONS = (
    Question(
        "told something, nothing missing",
        "<= .02",
        {
            "same": Figure("diagnosis-false-claims", "all", value=2),
            "structure": Figure("diagnosis-false-claims-foreign", "all", value=2),
            "built-in": _built_in("false claims on nothing"),
        },
    ),
    _of_all("named first, thrice the noise", "-", "right cause first, ENR 3"),
    _of_all(
        "named first, as large as the noise", ">= .80", "right cause first, ENR 1",
        **{"built-in": _built_in("right cause first, ENR 1")},
    ),
    _of_all(
        "named first, a third of the noise", ">= .35", "right cause first, ENR 0.3",
        **{"built-in": _built_in("right cause first, ENR 0.3")},
    ),
    _of_all(
        "named first, where recalibration errs more", "-", "right first, where recalibration errs a tenth more",
        **{
            "in turn": _in_turn("the same, where recalibration errs a tenth more"),
            "real": _faults("right first, where an error rises by a fifth"),
        },
    ),
    _of_all(
        "right, where a name is given", ">= .95", "right cause first, where a name was given",
        **{
            "in turn": _in_turn("right, where a name is given"),
            "built-in": _built_in("right cause first, where something was claimed"),
            "real": _faults("right, where a name is given"),
        },
    ),
    _of_all("both of a pair", ">= .45", "both of a pair", **{"built-in": _built_in("both of a pair")}),
    _of_all(
        "size, median relative error", "<= .10", "size, median relative error",
        **{
            "in turn": _in_turn("size, median relative error"),
            "built-in": _built_in("size, median relative error"),
            "real": _faults("size, median relative error"),
        },
    ),
    _of_all(
        "90 % intervals that cover", ".85 to .95", "90 % intervals that cover",
        **{"built-in": _built_in("90 % intervals that cover"), "real": _faults("90 % intervals that cover")},
    ),
    _of_all(
        "beginning within 2 days", ">= .90", "beginning within 2 days, where found",
        **{
            "in turn": _in_turn("beginning within 2 days, where found"),
            "built-in": _built_in("onset within 2 days, where the cause was found"),
            "real": _faults("beginning within 2 days"),
        },
    ),
    _of_all(
        "not in the catalogue: a wrong name", "<= .05", "outside the catalogue: wrong name",
        **{
            "built-in": _built_in("outside: confident wrong name"),
            "real": _faults("no cause of the catalogue: a name all the same"),
        },
    ),
    _of_all(
        "not in the catalogue: silence", "<= .30", "outside the catalogue: silence",
        **{
            "built-in": _built_in("outside: silence"),
            "real": _faults("no cause of the catalogue: silence"),
        },
    ),
    _of_all(
        "recoverable error recovered", ">= .85", "recoverable error recovered",
        **{
            "in turn": _in_turn("recoverable error recovered"),
            "built-in": _built_in("share of the recoverable error recovered"),
        },
    ),
    Question(
        "a withheld column traced, where it matters",
        "all",
        {"real": Figure("diagnosis-real-withheld", "withheld columns named, where an error rises by a fifth")},
    ),
    Question(
        "an omitted term named, where it matters",
        "-",
        {
            "same": Figure("diagnosis-omission", "all", value=3, cases=4),
            "real": Figure("diagnosis-omission-real", "all", value=3, cases=4),
        },
    ),
    Question(
        "an omitted term named, of all",
        ">= .70",
        {
            "same": Figure("diagnosis-omission", "all", cases=2),
            "real": Figure("diagnosis-omission-real", "all", cases=2),
        },
    ),
)  # fmt: skip


def table(folder: Path = FOLDER) -> list[str]:
    """Return the lines of the summary.

    Raises:
        ValueError: a page holds no such figure.
        OSError: a page is not there.
    """
    wide = max(len(one.asked) for one in QUESTIONS)
    heads = "".join(f"{name:>{WIDTH}}" for name in COLUMNS)
    lines = [f"{'':{wide}}  {'wanted':>10}{heads}"]
    for one in QUESTIONS:
        cells = [one.answers[name].read(folder) if name in one.answers else "" for name in COLUMNS]
        lines.append(f"{one.asked:{wide}}  {one.wanted:>10}{''.join(f'{cell:>{WIDTH}}' for cell in cells)}".rstrip())
    return lines


def pages() -> dict[str, list[str]]:
    """Return the pages that each column is read from, in the order of its questions."""
    return {
        name: list(dict.fromkeys(one.answers[name].page for one in QUESTIONS if name in one.answers))
        for name in COLUMNS
    }


def show() -> int:
    """Print the summary."""
    print("\n".join(table()))
    print("\nthe noise: the error that stays though nothing is missing; beside each figure the number of cases\n")
    for name, about in COLUMNS.items():
        print(f"{name:10} {about}\n{'':10} ({', '.join(pages()[name])})")
    return 0
