"""A fault of the data: what is wrong with a log as a whole, and how to mend it; never the cause of a misfit."""

from __future__ import annotations

from dataclasses import dataclass

from igrow.trainer.data.mapping import Amount


@dataclass(frozen=True)
class Remedy:
    """A change of one column's mapping: a value becomes value * scale + offset."""

    scale: float = 1.0
    offset: float = 0.0
    amount: Amount = "rate"


@dataclass(frozen=True)
class DataFault:
    """One reason why no model may be fitted to a log as it stands."""

    kind: str
    """One word for machines, such as ``fahrenheit``; also what `accept` takes."""
    quantity: str
    """Name of the column; empty where the fault is of the whole table."""
    sentence: str
    """What was seen, with figures."""
    mend: str
    """What to do about it."""
    remedy: Remedy | None = None
    """The same for a program, where it is certain."""

    def __str__(self) -> str:
        return f"{self.sentence}: {self.mend}" if self.mend else self.sentence
