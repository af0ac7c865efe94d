"""The hybrid simulator of one site as the trainer holds it: fitted, corrected, ready for export."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from igrow.core.bundle import EffectRecord, HeldOutError, Span
from igrow.core.simulator.crop import CropStages
from igrow.core.site import Site
from igrow.trainer.calibration.posterior import Posterior

MISFIT_KEY, CALIBRATED_ON_KEY = "known_misfit", "calibrated_on"
"""Where the `simulator` of a bundle's manifest holds what the trainer knows beside the parameters."""


@dataclass(frozen=True)
class HybridModel:
    """Everything that a bundle of the hybrid variant is made from."""

    site: Site
    posterior: Posterior
    """Of the physical parameters."""
    calibrated_on: str
    """Name of the site on whose log they were fitted."""
    actuation: Mapping[str, float]
    """Rules of the actuation stage by name."""
    holding: Mapping[str, float]
    """How the PLC holds heat and CO2, by name."""
    crop: CropStages
    effects: tuple[EffectRecord, ...] = ()
    training_span: Span | None = None
    training_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    errors: tuple[HeldOutError, ...] = ()
    known_misfit: Mapping[str, float] = field(default_factory=dict)
    """What the calibration could not explain on its own log, which is no finding later (`igrow.trainer.diagnosis`)."""

    @property
    def active_effects(self) -> dict[str, dict[str, float]]:
        """Parameter values of the effects by name, as `igrow.core.simulator.hybrid` takes them."""
        return {
            effect.name: {name: estimate.value for name, estimate in effect.parameters.items()}
            for effect in self.effects
        }

    def corrected(self, posterior: Posterior, effects: tuple[EffectRecord, ...]) -> HybridModel:
        """Return the model with another posterior and other effects, its errors no longer known."""
        return replace(self, posterior=posterior, effects=effects, errors=())

    def trained(
        self, span: Span, known: Mapping[str, tuple[float, float]], errors: tuple[HeldOutError, ...]
    ) -> HybridModel:
        """Return the model with the span and the range of the data it was fitted on, and its errors."""
        return replace(self, training_span=span, training_range=dict(known), errors=errors)

    def controlled(self, actuation: Mapping[str, float], holding: Mapping[str, float]) -> HybridModel:
        """Return the model with other rules of the PLC."""
        return replace(self, actuation=dict(actuation), holding=dict(holding))


MARGIN = 0.1
"""Share of its width by which a range reaches beyond the data: so far a physical model may be believed."""


def known_range(columns: Mapping[str, NDArray[np.float64]]) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each column that has any, with a margin on either side."""
    found = {}
    for name, values in columns.items():
        finite = values[np.isfinite(values)]
        if len(finite):
            low, high = float(finite.min()), float(finite.max())
            found[name] = (low - MARGIN * (high - low), high + MARGIN * (high - low))
    return found
