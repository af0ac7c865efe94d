"""Candidates: genes from 0 to 1 that stand for setpoints per hour, in blocks of local hours, within the limits.

Cao et al. (2022) search four actions for each of 3984 hours, 15,936 numbers. Growers think in periods of the day,
and so does the sun; a plan of two days in eight blocks has 8 genes a setpoint and is searched in seconds. The
blocks begin and end where the electricity tariff changes too. Lamps have a gene for each hour: when a night's dark
hours end is a matter of the sunset, which no block knows.

What a gene stands for passes the limits of setpoints and crop (`igrow.core.agronomy`) hour by hour, so that no
candidate leaves them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core import agronomy
from igrow.core.agronomy import Held, Memory, Moment, Place, SunToCome
from igrow.core.local_time import to_local
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.site import Site
from igrow.core.sun import unix_seconds

Setpoints = NDArray[np.float64]
"""(..., H, S) in the units of the registry, in its order."""

BLOCK_STARTS = (0, 4, 7, 10, 13, 16, 19, 23)
"""Local hours at which a block begins."""
BY_HOUR = ("lamp_on",)
"""Setpoints of which each hour is a block."""
STEPS = {
    "heating_setpoint": 0.5,
    "co2_setpoint": 25.0,
    "lamp_on": 1.0,
    "irrigation_on": 0.05,
    "humidity_setpoint": 1.0,
    "ventilation_setpoint": 0.5,
    "minimum_pipe_setpoint": 5.0,
    "energy_screen_setpoint": 10.0,
}
"""Setpoints are whole multiples of these: finer ones would not show in the greenhouse."""


@dataclass(frozen=True)
class Course:
    """Setpoints that leave no limit, and what they leave to be counted."""

    setpoints: Setpoints
    """(B, H, S)."""
    memory: Memory
    """At the end of the horizon."""
    held: tuple[Held, ...]
    """What the crop's limits changed, by hour."""

    def binding(self) -> tuple[dict[str, tuple[str, ...]], ...]:
        """Return by hour the crop's limits that stood in the way of any candidate, by setpoint."""
        return tuple({name: one.limits(name) for name in one.binding} for one in self.held)


@dataclass(frozen=True)
class Template:
    """How genes become setpoints over a horizon; make it with `for_site`."""

    free: tuple[str, ...]
    """Setpoints that the genes choose; the others follow the recipe."""
    taken: tuple[str, ...]
    """Setpoints that the crop's limits are asked of: every computer's, and others that the site's takes."""
    block: Mapping[str, NDArray[np.int64]]
    """By free setpoint: the block of each hour of the horizon, 0 and up, shape (H,)."""
    low: NDArray[np.float64]
    """Smallest allowed value of each setpoint, shape (S,)."""
    high: NDArray[np.float64]
    """Largest allowed value of each setpoint, shape (S,)."""
    slew: NDArray[np.float64]
    """Most change per hour of each setpoint, infinite without a limit, shape (S,)."""
    place: Place
    """With the crop's limits."""
    moments: tuple[Moment, ...]
    """At which the hours begin."""
    sunlight: NDArray[np.float64]
    """Of the sun above the crop, mol m-2 in each hour, shape (H,)."""

    @property
    def genes(self) -> int:
        """Number of genes: blocks of each free setpoint, one setpoint after the other."""
        return sum(self._count(name) for name in self.free)

    def place_of(self, setpoint: str) -> slice:
        """Return where the genes of a free setpoint stand."""
        first = sum(self._count(name) for name in self.free[: self.free.index(setpoint)])
        return slice(first, first + self._count(setpoint))

    def _count(self, name: str) -> int:
        return int(self.block[name].max()) + 1

    def decode(
        self,
        genes: NDArray[np.float32],
        recipe: Setpoints,
        applied: NDArray[np.float64],
        memory: Memory | None = None,
    ) -> Setpoints:
        """Return the setpoints (B, H, S) of candidates (B, G).

        `recipe` (H, S) gives the setpoints that are not free; `applied` and `memory` as in `follow`.
        """
        return self.limit(self.wanted(genes, recipe), applied, memory)

    def draw(self, rng: np.random.Generator, count: int) -> NDArray[np.float32]:
        """Return random candidates, (count, G).

        Setpoints of hours burn from one hour on for some hours, each day alike: drawn one by one hours never would.
        """
        genes = rng.random((count, self.genes), dtype=np.float32)
        for name in (name for name in self.free if name in BY_HOUR):
            _, first = np.unique(self.block[name], return_index=True)
            clock = np.array([self.moments[hour].clock for hour in first])
            since = (clock - rng.integers(24, size=(count, 1))) % 24.0
            genes[:, self.place_of(name)] = since < rng.integers(25, size=(count, 1))
        return genes

    def wanted(self, genes: NDArray[np.float32], recipe: Setpoints) -> Setpoints:
        """Return what candidates (B, G) ask for, (B, H, S), before any limit."""
        setpoints = np.repeat(recipe[None], len(genes), axis=0)
        for name in self.free:
            column = SETPOINTS.index(name)
            part = genes[:, self.place_of(name)].astype(np.float64)
            values = self.low[column] + part * (self.high[column] - self.low[column])
            setpoints[:, :, column] = (np.round(values / STEPS[name]) * STEPS[name])[:, self.block[name]]
        return setpoints

    def encode(self, setpoints: Setpoints) -> NDArray[np.float32]:
        """Return the genes (G,) nearest to setpoints (H, S): the mean over each block."""
        parts = []
        for name in self.free:
            column = SETPOINTS.index(name)
            block = self.block[name]
            mean = np.bincount(block, setpoints[:, column]) / np.bincount(block)
            span = max(self.high[column] - self.low[column], 1e-9)
            parts.append(np.clip((mean - self.low[column]) / span, 0.0, 1.0))
        return np.concatenate(parts).astype(np.float32)

    def limit(self, setpoints: Setpoints, applied: NDArray[np.float64], memory: Memory | None = None) -> Setpoints:
        """Return setpoints (..., H, S) within all limits; see `follow`."""
        batch = setpoints.reshape(-1, *setpoints.shape[-2:])
        return self.follow(batch, applied, memory).setpoints.reshape(setpoints.shape)

    def follow(self, setpoints: Setpoints, applied: NDArray[np.float64], memory: Memory | None = None) -> Course:
        """Return setpoints (B, H, S) within limits, slew and the crop's limits, as the guard would let them pass.

        `applied` (S,) or (B, S) is what holds before the first hour (NaN where unknown), from which the slew limit
        counts; `memory` is what the crop has had until then. Without one the crop's past is not known.
        """
        limited = np.clip(setpoints, self.low, self.high)
        before = np.where(np.isnan(applied), limited[:, 0], applied)
        heating = SETPOINTS.index("heating_setpoint")
        memory = memory or Memory(heating=np.broadcast_to(applied, before.shape)[:, heating])
        held = []
        for hour, now in enumerate(self.moments):
            step = np.clip(limited[:, hour], before - self.slew, before + self.slew)
            asked = {name: step[:, column] for column, name in enumerate(SETPOINTS) if name in self.taken}
            one = agronomy.hold(self.place, memory, now, asked, 1.0, self._sun_to_come(hour))
            before = step.copy()
            for name, values in one.setpoints.items():
                before[:, SETPOINTS.index(name)] = values
            memory = agronomy.observe(memory, self.place, now, one.setpoints, 1.0, float(self.sunlight[hour]))
            limited[:, hour] = before
            held.append(one)
        return Course(limited, memory, tuple(held))

    def _sun_to_come(self, hour: int) -> SunToCome:
        ahead = slice(hour, hour + 50)
        times = np.array([one.seconds for one in self.moments[ahead]])
        return agronomy.sun_to_come(self.moments[hour], times, self.sunlight[ahead])


def chosen_setpoints(site: Site, known: Collection[str]) -> tuple[str, ...]:
    """Return the setpoints that plans of a site choose, of those that a simulator answers to (`known`)."""
    named = (name for name in SETPOINTS if name in site.setpoints and name in site.planning.optimise)
    return tuple(name for name in named if name in known)


def for_site(
    site: Site,
    start: np.datetime64,
    hours: int,
    *,
    radiation: NDArray[np.float64] | None = None,
    known: Collection[str] = USUAL_SETPOINTS,
) -> Template:
    """Return the template of a horizon of `hours` from `start` (UTC), in blocks or hours of the site's local day.

    Each local day has genes of its own but the last, which is like the one before it. A last day of its own, whose
    night is never seen to end, burns its lamps until the horizon does and lets the greenhouse cool down towards it:
    a gain that is not there, for which the days before are spoiled. `radiation` (H,) is the global radiation to be
    expected, W m-2; without it the sun counts nothing in the crop's light. `known` are the setpoints that the simulator
    answers to: genes of another one would move the plant for nothing.
    """
    time = start.astype("datetime64[s]") + np.arange(hours) * np.timedelta64(3600, "s")
    local = to_local(time, site.time_zone)
    day = local.astype("datetime64[D]").astype(np.int64)
    pattern = np.minimum(day - day[0], max(day[-1] - day[0] - 1, 0))
    hour = local.astype("datetime64[h]").astype(np.int64) % 24
    # Hours before the first block's start belong to the last block, which then runs over midnight.
    period = (np.searchsorted(np.array(BLOCK_STARTS), hour, side="right") - 1) % len(BLOCK_STARTS)
    free = chosen_setpoints(site, known)
    _, by_period = np.unique(pattern * len(BLOCK_STARTS) + period, return_inverse=True)
    _, by_hour = np.unique(pattern * 24 + hour, return_inverse=True)
    limits = [site.limits[name] for name in SETPOINTS]
    place = Place.of(site)
    return Template(
        free=free,
        taken=tuple(name for name in SETPOINTS if name in USUAL_SETPOINTS or name in site.setpoints),
        block={name: (by_hour if name in BY_HOUR else by_period).astype(np.int64) for name in free},
        low=np.array([limit.low for limit in limits]),
        high=np.array([limit.high for limit in limits]),
        slew=np.array([np.inf if limit.slew is None else limit.slew for limit in limits]),
        place=place,
        moments=tuple(agronomy.moment(place, seconds) for seconds in unix_seconds(time).tolist()),
        sunlight=np.zeros(hours) if radiation is None else place.sunlight(1.0) * np.maximum(radiation, 0.0),
    )
