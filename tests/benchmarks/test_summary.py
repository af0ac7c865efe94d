"""The summary holds what the pages hold, and says so where one holds something else."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.diagnosis.summary import FOLDER, Figure, table

PAGE = """```
right cause first, ENR 1                                             0.74     39  >= .80
right cause first, ENR 0.3                                            nan      0  >= .35
all                                   4    144    0.028   0.010 to 0.062
withheld columns named, where an error rises by a fifth: 10 of 11
```
"""


@pytest.mark.parametrize(
    ("label", "said"),
    [
        ("right cause first, ENR 1", "0.74 of 39"),
        ("right cause first, ENR 0.3", ""),
        ("all", "0.03 of 144"),
        ("withheld columns named, where an error rises by a fifth", "0.91 of 11"),
    ],
)
def test_a_figure_is_that_of_its_line(label: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(PAGE, encoding="utf-8")
    assert Figure("page", label).read(tmp_path) == said


def test_a_page_that_holds_no_such_line_is_named(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(PAGE, encoding="utf-8")
    for figure in (Figure("page", "right cause"), Figure("page", "all", cases=9)):
        with pytest.raises(ValueError, match=r"page\.md: holds no figure of"):
            figure.read(tmp_path)


def test_the_summary_is_of_the_pages_that_are_there() -> None:
    """A page that is printed anew is followed by `python -m benchmarks.results diagnosis-summary`."""
    assert "\n".join(table()) in (FOLDER / "diagnosis-summary.md").read_text(encoding="utf-8")
