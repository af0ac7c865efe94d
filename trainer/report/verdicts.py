"""What a report says first: the verdict, and before it that the model is one of another greenhouse."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.language import Language
from igrow.trainer.diagnosis.answer.result import Diagnosis
from igrow.trainer.diagnosis.answer.uncalibrated import FIRST, NO_NAME, how_to_calibrate
from igrow.trainer.report.sentences import TEXTS


def verdict(result: Diagnosis, language: Language) -> str:
    """Return the first sentence; it never says that a model fits where its own errors say that it does not."""
    kind = result.verdict
    if result.unsure:
        return language.text(NO_NAME)
    wrong = kind in TEXTS["no_fit"] and result.misfits
    told = TEXTS["elsewhere"] if result.uncalibrated else TEXTS["no_fit"] if wrong else TEXTS["verdicts"]
    return language.text(told[kind])


def first(result: Diagnosis, typed: Sequence[str], language: Language) -> list[str]:
    """Return what stands above the verdict of a model that was never calibrated on the greenhouse.

    Args:
        result: the diagnosis.
        typed: the words of a command that read the log.
        language: of the report.
    """
    if not result.uncalibrated:
        return []
    text, command = how_to_calibrate(result.log.days if result.log is not None else 0.0, typed)
    return [language.text(FIRST), language.text(text, command=command)]
