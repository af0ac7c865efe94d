"""Effects that are switched on in the plant, without any model knowing: at a chosen size, form and start.

The contribution comes from the catalogue's own definition on the plant's true drivers, and is then bent, so that the
truth is never quite of the form that a diagnosis fits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from igrow.core.arrays import Array
from igrow.core.effects import EFFECTS, Effect
from igrow.core.errors import IgrowError
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.sun import unix_seconds

REFERENCE_DRIVERS: Mapping[str, float] = {
    "outdoor_temperature": 8.0, "outdoor_humidity": 80.0, "outdoor_co2": 415.0, "global_radiation": 300.0,
    "wind_speed": 4.0, "sky_temperature": -2.0, "wind_direction": 225.0, "rain": 1.0, "air_temperature": 20.0,
    "air_humidity": 80.0, "air_co2": 700.0, "par": 400.0, "leaf_area_index": 2.5, "plant_load": 400.0,
    "net_growth": 1.0, "fruit_fresh_weight": 5.0, "heating_setpoint": 20.0, "co2_setpoint": 800.0, "lamp_on": 1.0,
    "irrigation_on": 1.0, "rail_pipe_temperature": 45.0, "grow_pipe_temperature": 35.0, "vent_lee": 30.0,
    "vent_wind": 10.0, "energy_screen": 90.0, "blackout_screen": 0.0, "lamp_power": 81.0, "co2_dosing": 0.01,
    "irrigation": 0.5, "mean_height": 5.8, "elapsed_days": 30.0, "hour": 12.0, "weekday": 0.0, "sun_elevation": 25.0,
    "sun_azimuth": 180.0, "radiation_inside": 180.0, "vapour_concentration": 0.0138,
    "outdoor_vapour_concentration": 0.0066, "vapour_deficit": 470.0, "ventilation": 0.008, "transpiration": 2.5e-5,
    "assimilation": 8e-7, "rail_pipe_excess": 25.0, "grow_pipe_excess": 15.0,
}  # fmt: skip
"""A middling hour: an exponent or a threshold leaves the contribution of this hour as it is, or measures by it."""

CHANNEL_SCALE: Mapping[str, float] = {
    "heat": 10.0, "vapour": 5e-6, "co2": 3e-7, "air_exchange": 5e-4, "light_loss": 0.1, "assimilation": 2e-7,
    "air_temperature": 0.5, "air_humidity": 3.0, "air_co2": 50.0, "rail_pipe_temperature": 3.0,
    "grow_pipe_temperature": 3.0,
}  # fmt: skip
"""The measure for an effect that contributes nothing in that hour (a lag, a backlash)."""


@dataclass(frozen=True)
class HiddenEffect:
    """One effect in the plant.

    Raises:
        IgrowError: for a name or a shape that no effect has.
    """

    name: str
    """Of the catalogue, or of `uncatalogued`."""
    size: float | None = None
    """Amplitude in the unit of the effect's first parameter; None is its typical value."""
    start: np.datetime64 | None = None
    """When it begins, UTC; None is with the plant's first moment."""
    exponent: float = 1.0
    """The contribution goes with this power of its driver; it is right at `REFERENCE_DRIVERS`."""
    threshold: float | None = None
    """Contributions below this share of the reference contribution vanish, larger ones lose that much."""
    delay_seconds: float = 0.0
    """First-order lag of the contribution, s."""
    shapes: Mapping[str, float] = field(default_factory=dict)
    """Values of the effect's other parameters, where not typical."""

    def __post_init__(self) -> None:
        self.definition.values(**self.shapes)

    @property
    def definition(self) -> Effect:
        """The effect's definition."""
        found = EFFECTS.get(self.name) or UNCATALOGUED.get(self.name)
        if found is None:
            known = ", ".join([*EFFECTS, *UNCATALOGUED])
            raise IgrowError(f"hidden effect: no effect is called {self.name!r}; there are {known}")
        return found


class EffectBank:
    """All hidden effects of a plant, those of one name evaluated together for the whole batch."""

    def __init__(
        self,
        xp: Any,
        effects: Sequence[HiddenEffect] | Sequence[Sequence[HiddenEffect]],
        count: int | None,
        begin: float,
    ) -> None:
        self.xp = xp
        rows: list[list[HiddenEffect]]
        rows = [list(entry) if isinstance(entry, Sequence) else [entry] for entry in effects]
        if all(isinstance(entry, HiddenEffect) for entry in effects):
            rows = [[entry for entry in effects if isinstance(entry, HiddenEffect)]] * (count or 1)
        if count is not None and len(rows) != count:
            raise IgrowError(f"hidden effects: {len(rows)} lists for {count} greenhouses; one list each is needed")
        if count is None and len(rows) != 1:
            raise IgrowError("hidden effects: one greenhouse takes one flat list of effects")
        self._entries = [_Entry(xp, slots, count, begin) for slots in _by_name(rows)]
        self.drivers = frozenset(name for entry in self._entries for name in entry.effect.drivers)

    def __bool__(self) -> bool:
        return bool(self._entries)

    def evaluate(self, drivers: Mapping[str, Array], now: float, seconds: float, memory: list[Any]) -> dict[str, Array]:
        """Return the sum of all contributions by channel, and carry `memory` (one entry each) over `seconds`."""
        total: dict[str, Array] = {}
        if not memory:
            memory.extend([None, None] for _ in self._entries)
        for entry, slot in zip(self._entries, memory, strict=True):
            for channel, value in entry.evaluate(drivers, now, seconds, slot).items():
                total[channel] = total[channel] + value if channel in total else value
        return total


def _by_name(rows: list[list[HiddenEffect]]) -> list[list[HiddenEffect | None]]:
    """Return, for each effect name (and each repetition of it), the effect of every greenhouse or None."""
    table: dict[tuple[str, int], list[HiddenEffect | None]] = {}
    for position, row in enumerate(rows):
        seen: dict[str, int] = {}
        for effect in row:
            key = (effect.name, seen.get(effect.name, 0))
            seen[effect.name] = key[1] + 1
            table.setdefault(key, [None] * len(rows))[position] = effect
    return list(table.values())


class _Entry:
    def __init__(self, xp: Any, slots: list[HiddenEffect | None], count: int | None, begin: float) -> None:
        self.xp = xp
        example = next(slot for slot in slots if slot is not None)
        self.effect = example.definition

        def column(value: Any) -> Array:
            values = [value(slot) for slot in slots]
            return float(values[0]) if count is None else np.array(values, dtype=np.float64)

        typical = self.effect.amplitude.typical
        # A greenhouse without the effect has size zero.
        self.size = column(lambda slot: 0.0 if slot is None else typical if slot.size is None else slot.size)
        self.parameters: dict[str, Array] = {
            shape.name: column(lambda slot, shape=shape: (slot or example).shapes.get(shape.name, shape.typical))
            for shape in self.effect.shapes
        }
        self.start = column(
            lambda slot: begin if slot is None or slot.start is None else float(unix_seconds(slot.start))
        )
        self.exponent = column(lambda slot: 1.0 if slot is None else slot.exponent)
        self.threshold = column(lambda slot: 0.0 if slot is None or slot.threshold is None else slot.threshold)
        self.delay = column(lambda slot: 0.0 if slot is None else slot.delay_seconds)
        self.bent = bool(np.any(np.asarray(self.exponent) != 1.0) or np.any(np.asarray(self.threshold) != 0.0))
        self.delayed = bool(np.any(np.asarray(self.delay) > 0.0))
        self.reference = self._reference()

    def _reference(self) -> Array:
        """Return the absolute first contribution in the reference hour."""
        xp = self.xp
        shape = self.size * 0.0
        drivers = {name: shape + value for name, value in REFERENCE_DRIVERS.items()}
        values = self.parameters | {self.effect.amplitude.name: self.size}
        memory = self.effect.memory.start(xp, drivers, values) if self.effect.memory else None
        channel, value = next(iter(self.effect.contribution(xp, drivers, values, memory).items()))
        scale = CHANNEL_SCALE.get(channel, 1.0)
        return xp.where(xp.abs(value) > 0.05 * scale, xp.abs(value), scale + shape)

    def evaluate(self, drivers: Mapping[str, Array], now: float, seconds: float, slot: list[Any]) -> dict[str, Array]:
        xp = self.xp
        started = self.start <= now
        elapsed = xp.maximum(now - self.start, 0.0) / 86_400.0 if "elapsed_days" in self.effect.drivers else 0.0
        own = {**drivers, "elapsed_days": elapsed + 0.0 * self.size}
        values = self.parameters | {self.effect.amplitude.name: self.size * started}
        if self.effect.memory is not None:
            if slot[0] is None:
                slot[0] = self.effect.memory.start(xp, own, values)
            else:
                slot[0] = self.effect.memory.advance(xp, slot[0], own, values, seconds)
        result = dict(self.effect.contribution(xp, own, values, slot[0]))
        if self.bent:
            main = next(iter(result.values()))
            relative = xp.abs(main) / self.reference
            kept = xp.maximum(relative - self.threshold, 0.0) / xp.maximum(relative, 1e-9)
            bend = xp.minimum(xp.maximum(relative, 1e-3) ** (self.exponent - 1.0), 4.0)
            result = {channel: value * kept * bend for channel, value in result.items()}
        if self.delayed:
            follow = 1.0 - xp.exp(-seconds / xp.maximum(self.delay, 1e-3))
            before = slot[1] or {channel: 0.0 * value for channel, value in result.items()}
            result = {
                channel: before[channel] + follow * (value - before[channel]) for channel, value in result.items()
            }
            slot[1] = result
        return result
