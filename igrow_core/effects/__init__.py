"""Named effects that a greenhouse model may lack: `EFFECTS` holds the catalogue, one definition each."""

from igrow.core.effects.catalogue import EFFECTS
from igrow.core.effects.definition import DERIVED_DRIVERS, PROCESS_CHANNELS, Effect, EffectMemory, Parameter

__all__ = ["DERIVED_DRIVERS", "EFFECTS", "PROCESS_CHANNELS", "Effect", "EffectMemory", "Parameter"]
