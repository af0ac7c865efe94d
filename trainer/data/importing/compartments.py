"""Which compartment of an export is to be read: side by side, or under each other."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.errors import IgrowError
from igrow.trainer.data import vocabulary
from igrow.trainer.data.export_table import ExportTable
from igrow.trainer.data.importing import columns as names
from igrow.trainer.data.importing.question import Answers, Question
from igrow.trainer.data.importing.time_format import TimeForm
from igrow.trainer.data.mapping import LongTable

_MOST_COMPARTMENTS = 60
_UNDER_EACH_OTHER = 1.9
"""Rows of each time from which on several compartments stand under each other."""
_TOLD_APART = 0.98
"""Share of rows that must differ once a column of labels is looked at."""


def rows_of_one(
    table: ExportTable, time: TimeForm, long: LongTable | None, answers: Answers, questions: list[Question]
) -> dict[str, str]:
    """Return the rows to read of a file that holds several compartments under each other.

    A column tells them that is called so, or without which rows of one time could not be told apart.
    """
    keys = [time.column, *filter(None, (time.time_of_day, long.name if long is not None else None))]
    stamps = list(zip(*(table[name] for name in keys), strict=True))
    repeated = len(stamps) / max(len(set(stamps)), 1)
    if repeated < _UNDER_EACH_OTHER:
        return {}
    others = [name for name in table.columns if name not in (*keys, long.value if long is not None else "")]
    called = [name for name in others if vocabulary.is_compartment(name)]
    for name in (*called, *(name for name in others if _tells_apart(table[name], stamps, repeated))):
        labels = sorted(set(table[name]) - {""})
        if 2 <= len(labels) <= _MOST_COMPARTMENTS:
            if answers.compartment in labels:
                return {name: str(answers.compartment)}
            _ask(labels, questions)
            return {name: labels[0]}
    return {}


def _tells_apart(labels: Sequence[str], stamps: Sequence[tuple[str, ...]], repeated: float) -> bool:
    """Tell whether each of a few labels stands on one row of each time."""
    few = len(set(labels)) <= 1.5 * repeated
    return few and len(set(zip(labels, stamps, strict=True))) > _TOLD_APART * len(stamps)


def chosen_compartment(matches: Sequence[names.Match], answers: Answers, questions: list[Question]) -> str:
    """Return the compartment to read of those that stand side by side; empty where there is one alone.

    Raises:
        IgrowError: none is called as the user says.
    """
    known = names.compartments(matches)
    if answers.compartment is not None and known:
        wanted = vocabulary.folded(answers.compartment)
        chosen = next((one for one in known if one == wanted or one.split()[-1] == wanted), None)
        if chosen is None:
            raise IgrowError(f"no compartment is called {answers.compartment!r}; there are {', '.join(known)}")
        return chosen
    if len(known) > 1:
        _ask(known, questions)
    return known[0] if known else ""


def _ask(labels: Sequence[str], questions: list[Question]) -> None:
    option = f"--compartment {labels[0]!r}"
    questions.append(Question("compartment", "which compartment is the log of?", tuple(labels), option, blocks=True))
