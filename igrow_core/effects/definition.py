"""What an effect is: one small definition that diagnosis, simulator, export and report all read.

A *process* effect adds fluxes to the balances of the greenhouse air; a *sensor* effect adds an error to a
measurement and leaves the plant alone. An effect is linear in its first parameter, the amplitude, and silent
at amplitude zero; the other parameters give it its shape. One with a memory (a lag, a hysteresis) carries one
state of its own, advanced with the simulator's.

The contribution of an effect is a mapping from channel to array:

========================  ===============  ==================================================================
channel                   unit             enters
========================  ===============  ==================================================================
``heat``                  W m-2            the heat balance of the air
``vapour``                kg m-2 s-1       the vapour balance of the air
``co2``                   kg m-2 s-1       the CO2 balance of the air
``air_exchange``          m s-1            heat, vapour and CO2: outdoor air exchanged per floor area
``light_loss``            1                fraction of the transmitted light that is lost (heat, growth, CO2)
``assimilation``          kg m-2 s-1       CO2 that the crop takes up beyond the model's (CO2, growth)
name of a quantity        its unit         the measurement of that quantity (sensor effects only)
========================  ===============  ==================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from igrow.core.arrays import Array
from igrow.core.errors import IgrowError

Drivers = Mapping[str, Array]
"""Quantities and derived drivers by name, all of one shape."""
Values = Mapping[str, Array]
"""Parameter values by name."""
Balance = Literal["heat", "vapour", "co2", "light", "growth"]

PROCESS_CHANNELS = ("heat", "vapour", "co2", "air_exchange", "light_loss", "assimilation")

DERIVED_DRIVERS: Mapping[str, str] = {
    "mean_height": "m, air volume per floor area",
    "elapsed_days": "d, time since the effect began",
    "hour": "h, local solar time, 0 to 24",
    "sun_elevation": "deg above the horizon",
    "sun_azimuth": "deg clockwise from north",
    "radiation_inside": "W m-2, short-wave radiation that passes cover and screens",
    "vapour_concentration": "kg m-3, in the greenhouse air",
    "outdoor_vapour_concentration": "kg m-3",
    "vapour_deficit": "Pa, in the greenhouse air",
    "ventilation": "m s-1, air exchange through the vents, without leakage",
    "transpiration": "kg m-2 s-1, of the crop",
    "assimilation": "kg m-2 s-1, gross CO2 uptake of the crop",
    "rail_pipe_excess": "K, rail pipe above air, 0 when the circuit is off",
    "grow_pipe_excess": "K, grow pipe above air, 0 when the circuit is off",
}
"""What the plant and the simulator compute for the effects beside the registry's quantities."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    unit: str
    typical: float
    """Amplitude: the size of a clearly visible case. Shape: its usual value, where fitting starts."""
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class EffectMemory:
    """The one state of an effect that remembers.

    `start(xp, drivers, parameters)` gives its value at rest under the drivers; `advance(xp, memory, drivers,
    parameters, seconds)` its value `seconds` later, the drivers held.
    """

    start: Callable[[Any, Drivers, Values], Array]
    advance: Callable[[Any, Array, Drivers, Values, float], Array]
    within_step: bool = False
    """Its drivers are actuators, whose means over the step are given: it acts as it is in the step's middle. A memory
    of states, which are given at the step's beginning, acts as it is then."""


@dataclass(frozen=True)
class Effect:
    """One named effect; see the module's docstring for what it may contribute."""

    name: str
    kind: Literal["process", "sensor"]
    balances: tuple[Balance, ...]
    """The balances a process effect enters; empty for a sensor effect."""
    drivers: tuple[str, ...]
    """Quantities and derived drivers that the formula reads."""
    parameters: tuple[Parameter, ...]
    contribution: Callable[[Any, Drivers, Values, Array], Mapping[str, Array]]
    """`contribution(xp, drivers, parameters, memory)`; `memory` is None for an effect without one."""
    signature: str
    """How its trace differs from that of others."""
    separating_test: str
    """The cheapest safe test that would tell it from those it is confounded with."""
    title: str
    """What it is, for the grower: a noun phrase."""
    sentence: str
    """For the grower; `{value}` and `{unit}` stand for the amplitude."""
    source: str
    opposite: str = ""
    """The same of a negative amplitude, with its size; empty where there is none."""
    memory: EffectMemory | None = None
    measured: tuple[str, ...] = ()
    """The quantities whose measurement a sensor effect falsifies."""
    resembles: tuple[str, ...] = ()
    """Parameters of the hybrid simulator whose change would look much the same."""

    @property
    def amplitude(self) -> Parameter:
        """The parameter in which the effect is linear."""
        return self.parameters[0]

    @property
    def shapes(self) -> tuple[Parameter, ...]:
        """The parameters that give the effect its form."""
        return self.parameters[1:]

    def told(self, amplitude: float) -> tuple[str, float]:
        """Return the sentence for an amplitude, and the size that stands in it."""
        return (self.opposite, -amplitude) if amplitude < 0.0 and self.opposite else (self.sentence, amplitude)

    def values(self, **given: Array) -> dict[str, Array]:
        """Return all parameter values: those given, else the typical ones.

        Raises:
            IgrowError: for a name that is not a parameter of this effect.
        """
        known = {parameter.name for parameter in self.parameters}
        for name in given:
            if name not in known:
                raise IgrowError(f"effect {self.name}: no parameter {name!r}; it has {', '.join(sorted(known))}")
        return {parameter.name: parameter.typical for parameter in self.parameters} | given


def lagged(
    driver: Callable[[Any, Drivers], Array], time_constant: str, unit_seconds: float, *, within_step: bool = False
) -> EffectMemory:
    """Return the memory of a first-order lag.

    Args:
        driver: what is lagged, a function of (xp, drivers).
        time_constant: name of the parameter with the time constant.
        unit_seconds: seconds in one unit of that parameter.
        within_step: see `EffectMemory`.
    """

    def start(xp: Any, drivers: Drivers, _parameters: Values) -> Array:
        return driver(xp, drivers)

    def advance(xp: Any, memory: Array, drivers: Drivers, parameters: Values, seconds: float) -> Array:
        decay = decay_factor(xp, parameters[time_constant], seconds / unit_seconds)
        return driver(xp, drivers) + (memory - driver(xp, drivers)) * decay

    return EffectMemory(start, advance, within_step)


def decay_factor(xp: Any, time_constant: Array, elapsed: float) -> Array:
    """Return exp(-elapsed / time_constant), for a float or an array of time constants."""
    if isinstance(time_constant, float | int):
        return 2.718281828459045 ** (-elapsed / time_constant)
    return xp.exp(-elapsed / time_constant)
