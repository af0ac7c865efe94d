"""What the cells of a column are: numbers, nothing, words for on and off, or marks of a fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from igrow.trainer.data import vocabulary
from igrow.trainer.data.mapping import MISSING
from igrow.trainer.data.number_texts import number, unit_behind

MOST_STEPS, LEAST_AT_END = 10.0, 0.05
"""Steps that a vent's motor has at most, and share of the rows in which it is at its end, where it counts them."""


@dataclass(frozen=True)
class ColumnTexts:
    """A column by the kinds of its cells."""

    numeric: float
    """Share of cells that are numbers."""
    missing: float
    """Share of cells that say that there is none."""
    words: Mapping[str, float]
    """Words for on and off -> 1 and 0."""
    marks: tuple[str, ...]
    """Other texts."""
    highest: float
    """Largest number, nan without any."""
    unit: str
    """What stands behind most of the numbers; empty for nothing."""
    steps: bool = False
    """All numbers are whole, few, and often the largest of them: steps of a motor, and no per cent."""


def column_texts(cells: Sequence[str], decimal: str, known: Mapping[str, float] | None = None) -> ColumnTexts:
    """Return what the cells of a column are; `decimal` is the sign before decimals, `known` the words it may have."""
    known = vocabulary.switch_words() if known is None else known
    count = Counter(cells)
    total = max(len(cells), 1)
    values = {text: value for text in count if text not in MISSING and (value := number(text, decimal)) is not None}
    rest = [text for text in count if text not in values and text not in MISSING]
    behind: Counter[str] = Counter()
    for text in values:
        behind[unit_behind(text)] += count[text]
    words = {text: known[vocabulary.folded(text)] for text in rest if vocabulary.folded(text) in known}
    return ColumnTexts(
        sum(count[text] for text in values) / total,
        sum(count[text] for text in count if text in MISSING) / total,
        words,
        tuple(text for text in rest if text not in words),
        max(values.values(), default=float("nan")),
        behind.most_common(1)[0][0] if behind else "",
        _are_steps({values[text]: count[text] for text in values}),
    )


def _are_steps(count: Mapping[float, int]) -> bool:
    """Tell whether numbers, by how often each is there, are steps of a motor: only such a vent rests at its end."""
    top = max(count, default=0.0)
    whole = all(value >= 0.0 and value == int(value) for value in count)
    return whole and 2.0 < top <= MOST_STEPS and count[top] >= LEAST_AT_END * sum(count.values())
