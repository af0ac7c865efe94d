"""What a model lacked from its first day: a term of the physics that its own calibration log asks for."""

from __future__ import annotations

from dataclasses import dataclass

from igrow.core.bundle import EffectRecord, HeldOutError
from igrow.trainer.fit.gaussian import Gaussian


@dataclass(frozen=True)
class Omission:
    """A term that stands out of a calibration, and that weeks which no fit saw bear out."""

    effect: EffectRecord
    """With its size and interval, fitted beside the parameters."""
    posterior: Gaussian
    """Of the parameters beside it, under the prior of the site's description."""
    score: float
    """How far its gain lies above what calibrations that lack nothing show, in standard deviations."""
    errors: tuple[HeldOutError, ...]
    """Without and with it, on weeks that neither fit saw."""
