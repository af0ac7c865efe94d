"""What a model lacked from its first day: terms of the physics that its own calibration log asks for."""

from __future__ import annotations

from dataclasses import dataclass

from igrow.core.bundle import EffectRecord, HeldOutError
from igrow.trainer.fit.gaussian import Gaussian


@dataclass(frozen=True)
class Omission:
    """Terms that stand out of a calibration, and that weeks which no fit saw bear out."""

    effects: tuple[EffectRecord, ...]
    """With their sizes and intervals, fitted together beside the parameters; that which stands out most first."""
    posterior: Gaussian
    """Of the parameters beside them, under the prior of the site's description."""
    errors: tuple[HeldOutError, ...]
    """Without and with them, on weeks that neither fit saw."""
