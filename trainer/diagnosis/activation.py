"""Found terms as active effects of the simulator, with their beginnings as functions of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.effects.definition import Array
from igrow.core.simulator.hybrid.record import Record


@dataclass(frozen=True)
class ActiveTerm:
    """One effect at fitted values, from a time on."""

    effect: str
    amplitude: float
    shape: Mapping[str, float]
    onset: np.datetime64 | None = None
    """UTC; None is from before the log."""


def activate(record: Record, terms: Sequence[ActiveTerm]) -> dict[str, dict[str, Array]]:
    """Return the active effects of a record; an effect with a beginning has an amplitude that is (n,)."""
    active: dict[str, dict[str, Array]] = {}
    for term in terms:
        definition = EFFECTS[term.effect]
        amplitude: Array = term.amplitude
        if term.onset is not None:
            age = (record.time - term.onset).astype("timedelta64[s]").astype(np.float64) / 86_400.0
            share = (age >= 0.0).astype(np.float64)
            if "elapsed_days" in definition.drivers:
                # The record counts from its first row; the effect counts from its own beginning.
                share = np.maximum(age, 0.0) / np.maximum(np.asarray(record.inputs["elapsed_days"]), 1e-9)
            amplitude = term.amplitude * share
        active[term.effect] = {definition.amplitude.name: amplitude, **term.shape}
    return active
