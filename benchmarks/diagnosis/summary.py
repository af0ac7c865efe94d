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
    "neighbour's": "by the model of another greenhouse, 8 % off in every parameter",
    "built-in": "by the built-in bundle: of the greenhouse only the site's file is known",
    "real": "faults put into five real logs, and columns withheld from them",
}
PAGES = {
    "same": "diagnosis-same",
    "in turn": "diagnosis-catalogue",
    "structure": "diagnosis-foreign",
    "neighbour's": "diagnosis-transferred",
    "built-in": "diagnosis-transferred",
    "real": "diagnosis-real-faults",
}
"""On which each column's figures stand, but those that name another."""
SECOND = "built-in"
"""The column that stands on its page behind another's."""
WIDTH = 14


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
    answers: Mapping[str, str | Figure]
    """By column: the label of a line on its page, or a figure of another page."""

    def figure(self, column: str) -> Figure | None:
        """Return the figure that answers it in a column, None where none does."""
        answer = self.answers.get(column)
        if not isinstance(answer, str):
            return answer
        first = 2 if column == SECOND else 0
        return Figure(PAGES[column], answer, first, first + 1)


def _virtual(label: str) -> dict[str, str | Figure]:
    """Return answers of virtual greenhouses, whose pages have the same lines."""
    return dict.fromkeys(("same", "structure", "neighbour's", "built-in"), label)


QUESTIONS = (
    Question(
        "told something, nothing missing",
        "<= .02",
        _virtual("false claims, nothing missing")
        | {
            "same": Figure("diagnosis-false-claims", "all", value=2),
            "structure": Figure("diagnosis-false-claims-foreign", "all", value=2),
        },
    ),
    Question("named first, thrice the noise", "-", _virtual("right cause first, ENR 3")),
    Question("named first, as large as the noise", ">= .80", _virtual("right cause first, ENR 1")),
    Question("named first, a third of the noise", ">= .35", _virtual("right cause first, ENR 0.3")),
    Question(
        "named first, where recalibration errs more",
        "-",
        _virtual("right first, where recalibration errs a tenth more")
        | {
            "in turn": "the same, where recalibration errs a tenth more",
            "real": "right first, where an error rises by a fifth",
        },
    ),
    Question(
        "right, where a name is given",
        ">= .95",
        _virtual("right cause first, where a name was given")
        | dict.fromkeys(("in turn", "real"), "right, where a name is given"),
    ),
    Question("both of a pair", ">= .45", _virtual("both of a pair")),
    Question("size, median relative error", "<= .10", dict.fromkeys(PAGES, "size, median relative error")),
    Question(
        "90 % intervals that cover",
        ".85 to .95",
        dict.fromkeys((one for one in PAGES if one != "in turn"), "90 % intervals that cover"),
    ),
    Question(
        "beginning within 2 days",
        ">= .90",
        _virtual("beginning within 2 days, where found")
        | {"in turn": "beginning within 2 days, where found", "real": "beginning within 2 days"},
    ),
    Question(
        "not in the catalogue: a wrong name",
        "<= .05",
        _virtual("outside the catalogue: wrong name") | {"real": "no cause of the catalogue: a name all the same"},
    ),
    Question(
        "not in the catalogue: silence",
        "<= .30",
        _virtual("outside the catalogue: silence") | {"real": "no cause of the catalogue: silence"},
    ),
    Question(
        "recoverable error recovered",
        ">= .85",
        _virtual("recoverable error recovered") | {"in turn": "recoverable error recovered"},
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
)


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
        figures = [one.figure(name) for name in COLUMNS]
        cells = ["" if figure is None else figure.read(folder) for figure in figures]
        lines.append(f"{one.asked:{wide}}  {one.wanted:>10}{''.join(f'{cell:>{WIDTH}}' for cell in cells)}".rstrip())
    return lines


def pages(column: str) -> list[str]:
    """Return the pages that a column is read from, in the order of the questions."""
    figures = (one.figure(column) for one in QUESTIONS)
    return list(dict.fromkeys(figure.page for figure in figures if figure is not None))


def show() -> int:
    """Print the summary."""
    print("\n".join(table()))
    print("\nthe noise: the error that stays though nothing is missing; beside each figure the number of cases\n")
    wide = max(map(len, COLUMNS))
    for name, about in COLUMNS.items():
        print(f"{name:{wide}} {about}\n{'':{wide}} ({', '.join(pages(name))})")
    return 0
