"""What is said first of a diagnosis by a model that was never calibrated on the greenhouse, and how that is mended.

Such a model tells how one greenhouse differs from another; nothing need have broken in either.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from igrow.core.language import N_
from igrow.trainer.data.log import LEAST_DAYS

FIRST = N_(
    "This bundle was never calibrated on this greenhouse: what follows is how the greenhouse differs from the "
    "bundle's, and no fault that was found."
)
NO_NAME = N_("The model does not fit this greenhouse even when recalibrated: no name here is certain.")
CALIBRATE = N_("Calibrate it first, on weeks in which all was well: {command}")
LATER = N_(
    "Calibrate it first, as soon as there are five weeks of log of which the first four are known to be good: {command}"
)
MOST_WEEKS, LEAST_WEEKS = 4, 3
"""Weeks that a calibration is given of a log; from the latter on it teaches what is missing even then."""


def how_to_calibrate(days: float, typed: Sequence[str] = ()) -> tuple[str, str]:
    """Return the text that says to calibrate, and the command to type, which leaves a week of the log to diagnose.

    Args:
        days: of the log.
        typed: by which words of a command the log was read; empty where no command read it.
    """
    weeks = min(MOST_WEEKS, int((days - LEAST_DAYS) // 7))
    text, fitted = (CALIBRATE, weeks) if weeks >= LEAST_WEEKS else (LATER, MOST_WEEKS)
    given = shlex.join(typed) or "LOG --site site.yaml"
    return text, f"igrow-trainer calibrate {given} --fit-weeks {fitted} --out bundle"
