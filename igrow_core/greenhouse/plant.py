"""The plant: one greenhouse on floats or a batch on arrays, carried through time by small steps.

One tick of at most a minute: weather, readings, control, light, effects, gas exchange, climate. Every five minutes:
the crop grows, sensors draw new noise, disturbances new innovations. `PlantState` is all that changes.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from igrow.core.air import co2_fraction, saturation_pressure
from igrow.core.arrays import Array
from igrow.core.errors import IgrowError
from igrow.core.greenhouse import books, canopy, climate, climate_state, observation, tomato, ventilation
from igrow.core.greenhouse.climate_computer import ClimateComputer, at_rest, control
from igrow.core.greenhouse.climate_state import Climate, Conditions
from igrow.core.greenhouse.disturbances import Disturbances
from igrow.core.greenhouse.hidden import EffectBank, HiddenEffect
from igrow.core.greenhouse.light import distribute
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.sensors import Sensors
from igrow.core.greenhouse.state import PlantState, add
from igrow.core.greenhouse.tomato import Crop
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.namespace import clip, namespace
from igrow.core.sun import solar_day

__all__ = ["SCAN", "SLOW", "TICK", "Plant", "PlantState"]

SCAN = 60.0
"""Time between two decisions of the climate computer, s; as on many PLCs, and independent of the climate's step."""
TICK = 60.0
"""Longest time step of the climate, s."""
SLOW = 300.0
"""Time between two steps of the crop, the sensors' noise and the disturbances, s."""


class Plant:
    """A greenhouse, or a batch of `count`, under given weather."""

    def __init__(
        self,
        parameters: GreenhouseParameters,
        weather: WeatherTable,
        start: float,
        *,
        count: int | None = None,
        effects: Sequence[HiddenEffect] | Sequence[Sequence[HiddenEffect]] = (),
        disturbances: Disturbances | None = None,
        sensors: Sensors | None = None,
        computer: ClimateComputer | None = None,
        crop: str | Crop = "mature",
        seed: int = 0,
        tick: float = TICK,
        scan: float = SCAN,
        initial: Climate | None = None,
    ) -> None:
        self.xp: Any = namespace(count)
        self.count = count
        self.parameters = parameters
        self.weather = weather
        self.disturbances = disturbances or Disturbances()
        self.sensors = sensors or Sensors()
        self.computer = computer or ClimateComputer()
        self.tick = tick
        self.scan = scan
        self.effects = EffectBank(self.xp, effects, count, start) if effects else None
        self._innovated = bool(np.any([self.disturbances.heat, self.disturbances.vapour, self.disturbances.co2]))
        like: Array = 1.0 if count is None else np.ones(count)
        now = weather.at(start)
        grown = _planted(parameters, crop, like)
        rest = climate_state.initial(self.xp, 19.0 * like, 75.0 * like, 550.0 * like, now.outdoor_temperature * like)
        crop_rates = tomato.rates(self.xp, parameters, grown, 19.0 * like)
        self.state = PlantState(
            seconds=start,
            climate=initial or rest,
            crop=grown,
            control=at_rest(like),
            slab=0.9 * parameters.slab_capacity * like,
            transpiration=0.0 * like,
            assimilation=0.0 * like,
            respiration=crop_rates.respiration,
            light=None,
            assimilated=0.0 * like,
            warmth=0.0 * like,
            crop_seconds=0.0,
            crop_rates=crop_rates,
            deleafed_day=_picking_day(start, parameters.longitude),
            scan=-1,
            disturbance=[0.0 * like] * 3,
            noise={},
            sensor_errors={},
            memory=[],
            trend=[0.0 * like] * 5,
            generator=np.random.default_rng(seed),
        )
        self._area = tomato.leaf_area_index(parameters, grown)
        self._renew_noise()

    # -- time ---------------------------------------------------------------------------------------------------

    def advance(self, seconds: float, setpoints: Mapping[str, Array]) -> None:
        """Carry the plant over `seconds` under the setpoints (the PLC's safe ones where one is missing)."""
        end = self.state.seconds + seconds
        while self.state.seconds < end - 1e-6:
            boundary = (self.state.seconds // SLOW + 1.0) * SLOW
            scan = (self.state.seconds // self.scan + 1.0) * self.scan
            self._tick(min(self.tick, end - self.state.seconds, scan - self.state.seconds), setpoints)
            if boundary - self.state.seconds < 1e-6:
                self._slow_step()

    def _tick(self, seconds: float, setpoints: Mapping[str, Array]) -> None:
        xp, p, s = self.xp, self.parameters, self.state
        weather = self.weather.at(s.seconds + 0.5 * seconds)
        area = self._area
        scan = int(s.seconds // self.scan)
        if scan != s.scan:
            s.scan = scan
            s.control = control(
                xp,
                self.computer,
                p,
                s.control,
                setpoints,
                observation.readings(xp, s, self.weather.at(s.seconds)),
                SCAN,
            )
        c = s.control
        # What is held during a tick is taken at its middle, where the last tick's trend leads: second order again.
        air, top, leaf, vapour_content, co2_content = (
            value + 0.5 * seconds * slope for value, slope in zip(_guided(s.climate), s.trend, strict=True)
        )
        ppm = co2_fraction(air, co2_content)
        vent = ventilation.through_vents(
            xp, p, c.vent_lee, c.vent_wind, weather.wind_speed, top - weather.outdoor_temperature
        )
        leak = 0.5 * ventilation.leakage(xp, p, weather.wind_speed)
        lamp_power = p.lamp_capacity * c.lamp

        added: dict[str, Array] = {}
        if self.effects:
            drivers = observation.drivers(xp, p, s, weather, setpoints, vent, self.effects.drivers)
            added = self.effects.evaluate(drivers, s.seconds, seconds, s.memory)
            s.sensor_errors = {name: value for name, value in added.items() if name in observation.SENSOR_CHANNELS}
        zero = 0.0
        light_loss = clip(xp, added["light_loss"], 0.0, 0.95) if "light_loss" in added else zero
        light = distribute(
            xp, p, weather.global_radiation, lamp_power, area, c.energy_screen, c.blackout_screen, light_loss
        )

        # Gas exchange of the crop
        leaf_vapour = saturation_pressure(xp, leaf) - 461.5 * vapour_content * (air + 273.15)
        stress = clip(xp, s.slab / (0.5 * p.slab_capacity), 0.0, 1.0)
        radiation = light.par * (1.0 / 2.1)
        stomata = canopy.stomatal_resistance(xp, p, radiation, ppm, xp.maximum(leaf_vapour, 0.0), stress)
        conductance = canopy.vapour_conductance(p, area, stomata)
        fixed = canopy.photosynthesis(xp, p, light.par_absorbed, ppm, leaf, area)
        fixed = fixed * tomato.assimilation_share(xp, s.crop) * (0.3 + 0.7 * stress)
        unaffected = 0.04401 * fixed
        # A crop assimilates nothing at the least, whatever is hidden in it.
        uptake = xp.maximum(unaffected + added.get("assimilation", zero), zero)
        respired = tomato.CO2_PER_CARBOHYDRATE * s.respiration

        heat, vapour, co2 = s.disturbance
        heat = heat + added.get("heat", zero)
        vapour = vapour + added.get("vapour", zero)
        co2 = co2 + added.get("co2", zero)
        # An effect may take from the exchange, but not more than there is.
        exchange = xp.maximum(leak + added["air_exchange"], -vent) if "air_exchange" in added else leak
        through_air = xp.maximum(exchange, zero)
        through_top = leak + vent + xp.minimum(exchange, zero)
        dosing = c.co2_dosing / 3600.0
        conditions = Conditions(
            outdoor_temperature=weather.outdoor_temperature,
            outdoor_vapour=weather.vapour,
            outdoor_co2=weather.co2,
            wind_speed=weather.wind_speed,
            sky_temperature=weather.sky_temperature,
            energy_closure=c.energy_screen,
            blackout_closure=c.blackout_screen,
            vent_exchange=through_top,
            air_exchange=through_air,
            leaf_area_index=area,
            canopy_conductance=conductance,
            sun_canopy=light.canopy,
            sun_floor=light.floor,
            sun_cover=light.cover,
            sun_screen=light.screen,
            lamp_long_wave=light.lamp_long_wave,
            heat=heat + light.lamp_air + light.air,
            vapour=vapour,
            co2=co2 + dosing + respired - uptake,
            rail_heat=c.rail_heat,
            grow_heat=c.grow_heat,
        )
        before = _guided(s.climate)
        s.climate, ledger = climate.advance(xp, p, s.climate, conditions, seconds)
        s.trend = [(after - old) / seconds for after, old in zip(_guided(s.climate), before, strict=True)]
        s.light = light
        s.transpiration = ledger.transpiration / seconds
        s.assimilation = unaffected
        s.assimilated = s.assimilated + uptake * (seconds / tomato.CO2_PER_CARBOHYDRATE)
        s.warmth = s.warmth + s.climate.canopy * seconds
        s.crop_seconds += seconds

        water = s.slab + c.irrigation * (seconds / 3600.0) - ledger.transpiration
        drain = xp.maximum(water - p.slab_capacity, 0.0)
        s.slab = water - drain
        s.seconds += seconds
        inflow = books.Inflow(lamp_power, heat, vapour, co2, dosing, respired, uptake, drain)
        books.account(p, s, seconds, ledger, light, inflow)

    def _slow_step(self) -> None:
        xp, p, s = self.xp, self.parameters, self.state
        warmth = s.warmth / s.crop_seconds
        s.crop = tomato.grow(xp, p, s.crop, s.crop_rates, s.assimilated, warmth, s.crop_seconds)
        day = _picking_day(s.seconds, p.longitude)
        if day != s.deleafed_day:
            s.deleafed_day = day
            if day % max(int(p.deleafing_interval), 1) == 0:
                s.crop = tomato.deleaf(xp, p, s.crop)
        s.crop_rates = tomato.rates(xp, p, s.crop, warmth)
        s.respiration = s.crop_rates.respiration
        s.assimilated, s.warmth, s.crop_seconds = 0.0 * s.assimilated, 0.0 * s.warmth, 0.0
        area = tomato.leaf_area_index(p, s.crop)
        # New leaves bring the heat they hold, picked ones take it away.
        add(s.totals, "leaf_heat_in", p.canopy_capacity * (area - self._area) * s.climate.canopy)
        self._area = area
        self._renew_noise()

    def _renew_noise(self) -> None:
        s = self.state
        s.noise = self.sensors.draw(s.generator, self.count)
        if self._innovated:
            persistence = self.disturbances.persistence(self.count)
            fresh = self.disturbances.innovate(s.generator, self.count)
            s.disturbance = [persistence * old + new for old, new in zip(s.disturbance, fresh, strict=True)]

    # -- what others see ----------------------------------------------------------------------------------------

    def truth(self, setpoints: Mapping[str, Array]) -> dict[str, Array]:
        """Return every quantity of the registry as it is: states now, actuators as means since the last reset."""
        weather = self.weather.at(min(self.state.seconds, self.weather.end))
        return observation.truth(self.xp, self.parameters, self.state, weather, setpoints)

    def measured(self, truth: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the sensors show of `truth`: with faults, noise and resolution."""
        s = self.state
        return {
            name: self.sensors.reading(name, value + s.sensor_errors.get(name, 0.0), s.noise)
            for name, value in truth.items()
        }

    def reset_means(self) -> None:
        """Begin a new mean of the actuators."""
        self.state.log, self.state.log_seconds = {}, 0.0

    def stored(self) -> dict[str, Array]:
        """Return what the plant holds (see `books.stored`)."""
        return books.stored(self.parameters, self.state)

    def residuals(self, before: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the balances miss since the start, where `stored()` was `before` (see `books.residuals`)."""
        return books.residuals(self.parameters, self.state, before)

    # -- saving -------------------------------------------------------------------------------------------------

    def saved(self) -> PlantState:
        """Return a copy of the state."""
        return copy.deepcopy(self.state)

    def restore(self, state: PlantState) -> None:
        """Take up a saved state; the plant goes on exactly as it would have."""
        self.state = copy.deepcopy(state)
        self._area = tomato.leaf_area_index(self.parameters, self.state.crop)


def _planted(parameters: GreenhouseParameters, crop: str | Crop, like: Array) -> Crop:
    if isinstance(crop, Crop):
        return crop
    kinds = {"mature": tomato.mature_crop, "young": tomato.young_crop}
    if crop not in kinds:
        raise IgrowError(f"plant: the crop is {crop!r}; it must be one of {', '.join(kinds)}")
    return kinds[crop](parameters, like)


def _guided(state: Climate) -> tuple[Array, ...]:
    """Return the states on which stomata, photosynthesis and vents depend."""
    return state.air, state.top, state.canopy, state.vapour, state.co2


def _picking_day(seconds: float, longitude: float) -> int:
    """Return the number of the local solar day that begins at nine in the morning."""
    return int(solar_day(np.datetime64(int(seconds), "s") - np.timedelta64(9, "h"), longitude))
