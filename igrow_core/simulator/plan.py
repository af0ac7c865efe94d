"""A bundle's simulator for the planner: setpoints in, climate, resources, growth and harvest out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from igrow.core import sun
from igrow.core.arrays import Floats, Times
from igrow.core.bundle import Bundle, BundleError, open_session
from igrow.core.errors import IgrowError
from igrow.core.quantities import GROWTH, SETPOINTS, WEATHER
from igrow.core.simulator.growth import GrowthBalance
from igrow.core.simulator.hindcast import SimulatorSettings
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.outcome import Initial, Outcome
from igrow.core.site import Greenhouse

STEPS_PER_HOUR = 2
"""Steps of the climate and the actuation stage in an hour."""
CLOCK = ("sun_elevation", "sun_azimuth", "hour")
"""What the graph's input `clock` holds at the middle of each hour."""
EQUIPMENT = ("vent_lee", "vent_wind", "energy_screen", "blackout_screen", "rail_pipe_excess", "co2_dosing")
"""Where the equipment stands when the plan begins: %, K and kg m-2 h-1."""
CLIMATE_OUT = (*PREDICTED, "par")
"""What the graph's output `climate` holds at the end of each hour (par: its mean)."""
RESOURCES = ("heat", "electricity", "co2")
"""MJ m-2, kWh m-2 and kg m-2 used in each hour."""

_NARROW = 64
"""Candidates times members of which a row fills the least piece of memory that onnxruntime lays out, 256 bytes."""

_ABSENT_WEATHER = {"wind_direction": 225.0, "rain": 0.0}
"""Stand-ins for weather that no forecast holds."""
_USUAL = {
    "air_temperature": 20.0,
    "air_humidity": 75.0,
    "air_co2": 500.0,
    "leaf_area_index": 3.0,
    "plant_load": 100.0,
    "net_growth": 0.0,
    "fruit_fresh_weight": 0.0,
}
"""Stand-ins for an initial value that is not known."""


class BundleSimulator:
    """Runs simulator.onnx of a bundle; implements `igrow.core.simulator.outcome.Simulator`."""

    def __init__(self, bundle: Bundle, greenhouse: Greenhouse, *, members: int | None = None) -> None:
        """Open the graph.

        Args:
            bundle: with a `simulator` of the hybrid variant.
            greenhouse: what the pipes give off, by the site's description; see `_heat_paid`.
            members: how many of the posterior's draws to run (None: all that the bundle carries; 1: the mean alone).

        Raises:
            BundleError: the graph or the manifest cannot be used.
        """
        self.settings = SimulatorSettings.of(bundle)
        self.growth = GrowthBalance.of(bundle.manifest.simulator)
        """What growth is computed with; None where it is a network's affair."""
        self._graph = bundle.graph("simulator")
        self._session = open_session(self._graph)
        self._width = _NARROW
        try:
            tensors = {one.name: one.quantities for one in bundle.manifest.graphs["simulator"].inputs}
            self._beginning = tensors["climate"]
            # A graph of before several days were run at once has one clock for all.
            self._starts_of_each = {one.name: one.shape for one in self._session.get_inputs()}["clock"][-1] != 1
            self._weather = tensors["weather"]
            self.setpoints = tensors["setpoints"]
            """That the graph takes; a bundle of before one was known goes on without it."""
            self._asked = [SETPOINTS.index(name) for name in self.setpoints]
            names = tensors["parameters"]
            mean = np.array([self.settings.parameters[name] for name in names])
            draws = [[draw[name] for name in names if name in draw] for draw in bundle.manifest.simulator["members"]]
            varied = [name for name in names if draws and name in bundle.manifest.simulator["members"][0]]
        except (KeyError, TypeError, ValueError) as error:
            raise BundleError(f"{bundle.folder}: manifest.json: {error} is missing or not usable") from None
        self._parameters = np.tile(mean, (1 + len(draws), 1))
        columns = [names.index(name) for name in varied]
        for row, draw in enumerate(draws, start=1):
            self._parameters[row, columns] = draw
        self._parameters = self._parameters[: members or len(self._parameters)]
        self._heat_paid = _heat_paid(greenhouse, dict(zip(names, self._parameters.T, strict=True)))

    def simulate(self, initial: Initial, weather: Floats, setpoints: Floats, start: np.datetime64 | Times) -> Outcome:
        """Return what candidates do; see `igrow.core.simulator.outcome.Simulator`.

        Raises:
            IgrowError: the horizon is not a number of whole days.
        """
        if np.ndim(start) and not self._starts_of_each:
            return self._start_by_start(initial, weather, setpoints, np.asarray(start))
        candidates, hours, _ = setpoints.shape
        if hours == 0 or hours % 24:
            raise IgrowError(f"a plan needs whole days, not {hours} hours")
        members = len(self._parameters)
        time = np.arange(hours)[:, None] * np.timedelta64(3600, "s") + np.atleast_1d(start).astype("datetime64[s]")
        given = {name: _known(initial, name, _USUAL[name]) for name in _USUAL}
        given["mean_air_temperature"] = _known(initial, "mean_air_temperature", given["air_temperature"])
        excess = np.maximum(np.asarray(initial.get("rail_pipe_temperature", 0.0)) - given["air_temperature"], 0.0)
        standing = dict(initial) | {"rail_pipe_excess": excess}

        def spread(values: list[float | Floats]) -> Floats:
            of_each = [np.broadcast_to(np.nan_to_num(np.asarray(value)), candidates) for value in values]
            return np.tile(np.stack(of_each), (1, members))

        own = weather.ndim == 3 or np.ndim(start) == 1

        def course(values: Floats, each: bool) -> Floats:
            if not each:
                return values
            return np.tile(np.broadcast_to(values, (*values.shape[:-1], candidates)), members)

        feed = {
            "climate": spread([given[name] for name in self._beginning]),
            "growth": spread([given[name] for name in GROWTH]),
            "harvest": spread([given["fruit_fresh_weight"]]),
            "equipment": spread([standing.get(name, 0.0) for name in EQUIPMENT]),
            "weather": course(self._columns(weather), own),
            "clock": course(self._clock(time), own and self._starts_of_each),
            "day": course(self.settings.day(time), own and self._starts_of_each),
            "setpoints": np.tile(np.moveaxis(setpoints[..., self._asked], 0, -1), (1, 1, members)),
            "parameters": np.repeat(self._parameters.T, candidates, axis=1),
        }
        names = ["climate_out", "resources", "growth_out", "harvest_out", "outside"]
        if members * candidates > self._width:
            # The first run of a session lays out the memory of all its runs: a wider one would ask for it node by node,
            # which takes a fifth longer.
            self._session, self._width = open_session(self._graph), members * candidates
        results = self._session.run(
            names, {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in feed.items()}
        )
        out = {name: np.moveaxis(array, 0, -1).astype(np.float64) for name, array in zip(names, results, strict=True)}

        def member(array: Floats) -> Floats:
            return array.reshape(members, candidates, hours)

        net_growth = out["growth_out"][GROWTH.index("net_growth")]
        before = spread([given["net_growth"]])[0][:, None]
        picked = np.diff(out["harvest_out"][0], axis=-1, prepend=spread([given["fruit_fresh_weight"]])[0][:, None])
        return Outcome(
            air_temperature=member(out["climate_out"][0]),
            air_humidity=member(out["climate_out"][1]),
            air_co2=member(out["climate_out"][2]),
            heat=member(out["resources"][0]) * self._heat_paid[:, None, None],
            electricity=member(out["resources"][1]),
            co2=member(out["resources"][2]),
            net_growth=member(np.diff(net_growth, axis=-1, prepend=before)),
            fruit_fresh_weight=member(np.repeat(picked / 24.0, 24, axis=-1)),
            leaf_area_index=member(out["growth_out"][GROWTH.index("leaf_area_index")]),
            outside=member(out["outside"]),
        )

    def _columns(self, weather: Floats) -> Floats:
        """Return the graph's weather (hours, columns, w) from the planner's six columns."""
        of_hours = np.moveaxis(weather, 0, -1) if weather.ndim == 3 else weather[:, :, None]
        columns = []
        for name in self._weather:
            if WEATHER.index(name) < of_hours.shape[1]:
                columns.append(of_hours[:, WEATHER.index(name)])
            else:
                columns.append(np.full((len(of_hours), of_hours.shape[2]), _ABSENT_WEATHER[name]))
        return np.stack(columns, axis=1)

    def _start_by_start(self, initial: Initial, weather: Floats, setpoints: Floats, start: Times) -> Outcome:
        """Return what a graph of before `clock` had a width says of candidates that start at different times."""
        parts: dict[str, Floats] = {}
        for one in np.unique(start):
            rows = start == one
            mine = {name: np.asarray(value)[rows] if np.ndim(value) else value for name, value in initial.items()}
            outcome = self.simulate(mine, weather[rows] if weather.ndim == 3 else weather, setpoints[rows], one)
            for part in fields(Outcome):
                found = getattr(outcome, part.name)
                parts.setdefault(part.name, np.empty((len(found), *setpoints.shape[:2])))[:, rows] = found
        return Outcome(**parts)

    def _clock(self, time: Times) -> Floats:
        """Return the graph's clock (hours, columns, w) of the hours' beginnings (hours, w)."""
        middle = sun.unix_seconds(time) + 1800.0
        return np.stack(sun.position(np, middle, self.settings.latitude, self.settings.longitude), axis=1)


def _heat_paid(greenhouse: Greenhouse, parameters: Mapping[str, Floats]) -> Floats:
    """Return how much heat the pipes give off for each heat that the climate stage's air receives, (members,).

    The fitted transfer of the pipes is what reaches the air; what they radiate to floor and cover is paid too. The
    site's coefficients tell all that leaves a pipe, the fitted ones what of it the air's balance needs.
    """
    share = parameters["holding:grow_share"]
    received = parameters["parameter:rail_pipe_heat_transfer"] + share * parameters["parameter:grow_pipe_heat_transfer"]
    given = greenhouse.rail_pipe_heat_transfer + share * greenhouse.grow_pipe_heat_transfer
    return np.where((given > 0.0) & (received > 0.0), given / np.maximum(received, 1e-9), 1.0)


def _known(initial: Initial, name: str, usual: float | Floats) -> Floats:
    value = np.asarray(initial.get(name, np.nan), dtype=np.float64)
    return np.where(np.isfinite(value), value, usual)
