"""The plant: one greenhouse on floats or a batch on arrays, carried through time by small steps.

One tick of at most a minute: weather, readings, control, light, effects, gas exchange, climate. Every five minutes:
the crop grows, sensors draw new noise, disturbances new innovations. `PlantState` is all that changes.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from igrow_core.air import (
    LATENT_HEAT,
    co2_fraction,
    relative_humidity,
    saturation_pressure,
    vapour_pressure_deficit,
)
from igrow_core.greenhouse import canopy, climate, tomato, ventilation
from igrow_core.greenhouse.climate import Climate, Conditions, Ledger
from igrow_core.greenhouse.climate_computer import ClimateComputer, Control, Readings, at_rest, control
from igrow_core.greenhouse.disturbances import Disturbances
from igrow_core.greenhouse.hidden import EffectBank, HiddenEffect
from igrow_core.greenhouse.light import Light, distribute
from igrow_core.greenhouse.namespace import Array, clip, namespace
from igrow_core.greenhouse.parameters import GreenhouseParameters
from igrow_core.greenhouse.sensors import Sensors
from igrow_core.greenhouse.tomato import Crop
from igrow_core.greenhouse.weather_table import WeatherRow, WeatherTable
from igrow_core.sun import position

SCAN = 60.0
"""Time between two decisions of the climate computer, s; as on many PLCs, and independent of the climate's step."""
TICK = 60.0
"""Longest time step of the climate, s."""
SLOW = 300.0
"""Time between two steps of the crop, the sensors' noise and the disturbances, s."""

ACCUMULATED = ("vent_lee", "vent_wind", "energy_screen", "blackout_screen", "lamp_power", "co2_dosing", "irrigation")
"""Actuators that a log shows as the mean since the row before."""


@dataclass
class PlantState:
    """All that changes while the plant runs; floats or arrays (N,). It can be copied and pickled."""

    seconds: float
    """Time, since 1970 UTC."""
    climate: Climate
    crop: Crop
    control: Control
    slab: Array
    """Water in the substrate, L m-2."""
    transpiration: Array
    """Of the last tick, kg m-2 s-1, as is the next."""
    assimilation: Array
    """Gross uptake of CO2."""
    respiration: Array
    """Of the crop, kg CH2O m-2 s-1, as of the last slow step."""
    light: Light | None
    assimilated: Array
    """Carbohydrate fixed since the last slow step, kg m-2."""
    warmth: Array
    """Canopy temperature times seconds since the last slow step."""
    crop_seconds: float
    crop_rates: tomato.Rates
    deleafed_day: int
    scan: int
    """Number of the climate computer's last decision."""
    disturbance: list[Array]
    """Heat W m-2, vapour and CO2 kg m-2 s-1 into the air."""
    noise: dict[str, Array]
    sensor_errors: dict[str, Array]
    memory: list[Any]
    """Of the hidden effects."""
    generator: np.random.Generator
    totals: dict[str, Array] = field(default_factory=dict)
    """Everything that crossed the boundary since the start: J m-2 and kg m-2."""
    log: dict[str, Array] = field(default_factory=dict)
    """Actuators times seconds since `mean_actuators` was last reset."""
    log_seconds: float = 0.0


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
        crop: str = "mature",
        seed: int = 0,
        tick: float = TICK,
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
        self.effects = EffectBank(self.xp, effects, count, start) if effects else None
        self._innovated = any((self.disturbances.heat, self.disturbances.vapour, self.disturbances.co2))
        like: Array = 1.0 if count is None else np.ones(count)
        now = weather.at(start)
        grown = (tomato.mature_crop if crop == "mature" else tomato.young_crop)(parameters, like)
        rest = climate.initial(self.xp, 19.0 * like, 75.0 * like, 550.0 * like, now.outdoor_temperature * like)
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
            scan = (self.state.seconds // SCAN + 1.0) * SCAN
            self._tick(min(self.tick, end - self.state.seconds, scan - self.state.seconds), setpoints)
            if boundary - self.state.seconds < 1e-6:
                self._slow_step()

    def _tick(self, seconds: float, setpoints: Mapping[str, Array]) -> None:
        xp, p, s = self.xp, self.parameters, self.state
        weather = self.weather.at(s.seconds + 0.5 * seconds)
        area = self._area
        scan = int(s.seconds // SCAN)
        if scan != s.scan:
            s.scan = scan
            s.control = control(xp, self.computer, p, s.control, setpoints, self._readings(self.weather.at(s.seconds)), SCAN)
        c = s.control
        air = s.climate.air
        ppm = co2_fraction(air, s.climate.co2)
        vent = ventilation.through_vents(
            xp, p, c.vent_lee, c.vent_wind, weather.wind_speed, s.climate.top - weather.outdoor_temperature
        )
        leak = 0.5 * ventilation.leakage(xp, p, weather.wind_speed)
        lamp_power = p.lamp_capacity * c.lamp

        added: dict[str, Array] = {}
        if self.effects:
            drivers = self._drivers(weather, vent, ppm, setpoints)
            added = self.effects.evaluate(drivers, s.seconds, seconds, s.memory)
            s.sensor_errors = {name: value for name, value in added.items() if name in _SENSOR_CHANNELS}
        zero = 0.0
        light_loss = clip(xp, added["light_loss"], 0.0, 0.95) if "light_loss" in added else zero
        light = distribute(
            xp, p, weather.global_radiation, lamp_power, area, c.energy_screen, c.blackout_screen, light_loss
        )

        # Gas exchange of the crop
        leaf_vapour = saturation_pressure(xp, s.climate.canopy) - 461.5 * s.climate.vapour * (air + 273.15)
        stress = clip(xp, s.slab / (0.5 * p.slab_capacity), 0.0, 1.0)
        radiation = light.par * (1.0 / 2.1)
        stomata = canopy.stomatal_resistance(xp, p, radiation, ppm, xp.maximum(leaf_vapour, 0.0), stress)
        conductance = canopy.vapour_conductance(p, area, stomata)
        fixed = canopy.photosynthesis(xp, p, light.par_absorbed, ppm, s.climate.canopy, area)
        fixed = fixed * tomato.assimilation_share(xp, s.crop) * (0.3 + 0.7 * stress)
        uptake = 0.04401 * fixed + added.get("assimilation", zero)
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
        s.climate, ledger = climate.advance(xp, p, s.climate, conditions, seconds)
        s.light = light
        s.transpiration = ledger.transpiration / seconds
        s.assimilation = uptake
        s.assimilated = s.assimilated + uptake * (seconds / tomato.CO2_PER_CARBOHYDRATE)
        s.warmth = s.warmth + s.climate.canopy * seconds
        s.crop_seconds += seconds

        water = s.slab + c.irrigation * (seconds / 3600.0) - ledger.transpiration
        drain = xp.maximum(water - p.slab_capacity, 0.0)
        s.slab = water - drain
        s.seconds += seconds
        self._account(seconds, ledger, light, lamp_power, heat, vapour, co2, dosing, respired, uptake, drain)

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
        _add(s.totals, "leaf_heat_in", p.canopy_capacity * (area - self._area) * s.climate.canopy)
        self._area = area
        self._renew_noise()

    def _renew_noise(self) -> None:
        s = self.state
        s.noise = self.sensors.draw(s.generator, self.count)
        if self._innovated:
            persistence = self.disturbances.persistence
            fresh = self.disturbances.innovate(s.generator, self.count)
            s.disturbance = [persistence * old + new for old, new in zip(s.disturbance, fresh, strict=True)]

    # -- what others see ----------------------------------------------------------------------------------------

    def _readings(self, weather: WeatherRow) -> Readings:
        """Return what the PLC's sensors show: the true values with noise and sensor faults."""
        s = self.state
        noise, errors, air = s.noise, s.sensor_errors, s.climate.air

        def shown(name: str, value: Array) -> Array:
            return value + noise.get(name, 0.0) + errors.get(name, 0.0)

        return Readings(
            air_temperature=shown("air_temperature", air),
            air_humidity=shown("air_humidity", relative_humidity(self.xp, air, s.climate.vapour)),
            air_co2=shown("air_co2", co2_fraction(air, s.climate.co2)),
            rail_temperature=shown("rail_pipe_temperature", s.climate.rail),
            grow_temperature=shown("grow_pipe_temperature", s.climate.grow),
            outdoor_temperature=weather.outdoor_temperature,
            global_radiation=weather.global_radiation,
            wind_speed=weather.wind_speed,
        )

    def truth(self, setpoints: Mapping[str, Array]) -> dict[str, Array]:
        """Return every quantity of the registry as it is: states now, actuators as means since the last reset."""
        s, xp = self.state, self.xp
        weather = self.weather.at(min(s.seconds, self.weather.end))
        air = s.climate.air
        # atan2 by numpy: a row a step is no cost that matters.
        direction = np.degrees(np.arctan2(weather.wind_east, weather.wind_north)) % 360.0
        values: dict[str, Array] = {
            "outdoor_temperature": weather.outdoor_temperature,
            "outdoor_humidity": weather.outdoor_humidity,
            "outdoor_co2": weather.outdoor_co2,
            "global_radiation": weather.global_radiation,
            "wind_speed": weather.wind_speed,
            "sky_temperature": weather.sky_temperature,
            "wind_direction": float(direction) if self.count is None else direction,
            "rain": weather.rain,
            "air_temperature": air,
            "air_humidity": relative_humidity(xp, air, s.climate.vapour),
            "air_co2": co2_fraction(air, s.climate.co2),
            "par": s.light.par if s.light is not None else 0.0 * air,
            "leaf_area_index": self._area,
            "plant_load": tomato.total(s.crop.fruits),
            "net_growth": s.crop.net_growth,
            "fruit_fresh_weight": s.crop.harvested / self.parameters.fruit_dry_matter,
            **{name: setpoints[name] for name in _SETPOINT_NAMES if name in setpoints},
            "rail_pipe_temperature": s.climate.rail,
            "grow_pipe_temperature": s.climate.grow,
        }
        for name, value in zip(ACCUMULATED, self._actuators(), strict=True):
            values[name] = s.log[name] / s.log_seconds if s.log_seconds > 0.0 else value
        return values

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

    def _actuators(self) -> tuple[Array, ...]:
        c = self.state.control
        return (
            100.0 * c.vent_lee,
            100.0 * c.vent_wind,
            100.0 * c.energy_screen,
            100.0 * c.blackout_screen,
            self.parameters.lamp_capacity * c.lamp,
            c.co2_dosing,
            c.irrigation,
        )

    def _drivers(
        self, weather: WeatherRow, vent: Array, ppm: Array, setpoints: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Return the true drivers of the hidden effects; scalars are spread over the batch."""
        s, xp, p = self.state, self.xp, self.parameters
        like = 0.0 * s.climate.air
        drivers: dict[str, Array] = {name: like + value for name, value in setpoints.items()}
        drivers.update(zip(ACCUMULATED, self._actuators(), strict=True))
        air, seen = s.climate.air, self.effects.drivers if self.effects else frozenset()
        inside = s.light.inside if s.light is not None else like
        drivers.update(
            outdoor_temperature=like + weather.outdoor_temperature,
            outdoor_humidity=like + weather.outdoor_humidity,
            outdoor_co2=like + weather.outdoor_co2,
            global_radiation=like + weather.global_radiation,
            wind_speed=like + weather.wind_speed,
            sky_temperature=like + weather.sky_temperature,
            rain=like + weather.rain,
            air_temperature=air,
            air_humidity=relative_humidity(xp, air, s.climate.vapour),
            air_co2=ppm,
            par=s.light.par if s.light is not None else like,
            leaf_area_index=self._area,
            rail_pipe_temperature=s.climate.rail,
            grow_pipe_temperature=s.climate.grow,
            mean_height=like + p.air_height + p.top_height,
            radiation_inside=inside + like,
            vapour_concentration=s.climate.vapour,
            outdoor_vapour_concentration=like + weather.vapour,
            vapour_deficit=vapour_pressure_deficit(xp, air, s.climate.vapour),
            ventilation=vent,
            transpiration=s.transpiration,
            assimilation=s.assimilation,
            rail_pipe_excess=xp.maximum(s.climate.rail - air, 0.0),
            grow_pipe_excess=xp.maximum(s.climate.grow - air, 0.0),
        )
        if "wind_direction" in seen:
            direction = np.degrees(np.arctan2(weather.wind_east, weather.wind_north)) % 360.0
            drivers["wind_direction"] = float(direction) if self.count is None else like + direction
        if seen & _SUN_DRIVERS:
            elevation, azimuth, hour = position(xp, s.seconds, p.latitude, p.longitude)
            weekday = float((int(s.seconds + 240.0 * p.longitude) // 86_400 + 3) % 7)
            drivers.update(
                sun_elevation=like + float(elevation),
                sun_azimuth=like + float(azimuth),
                hour=like + float(hour),
                weekday=like + weekday,
            )
        return drivers

    # -- bookkeeping --------------------------------------------------------------------------------------------

    def _account(
        self, seconds: float, ledger: Ledger, light: Light, lamp_power: Array, heat: Array, vapour: Array, co2: Array,
        dosing: Array, respired: Array, uptake: Array, drain: Array,
    ) -> None:  # fmt: skip
        s, totals = self.state, self.state.totals
        c = s.control
        boiler = c.rail_heat + c.grow_heat
        for name, amount in (
            ("sun_in", light.sun_absorbed * seconds),
            ("lamp_in", (lamp_power - light.lamp_out) * seconds),
            ("boiler_in", boiler * seconds),
            ("unmodelled_heat_in", heat * seconds),
            ("unmodelled_vapour_in", vapour * seconds),
            ("unmodelled_co2_in", co2 * seconds),
            ("to_sky", ledger.to_sky),
            ("to_outside", ledger.to_outside),
            ("air_heat_out", ledger.air_heat_out),
            ("to_deep_soil", ledger.to_deep_soil),
            ("vapour_out", ledger.vapour_out),
            ("condensation", ledger.condensation),
            ("transpiration", ledger.transpiration),
            ("floor_evaporation", ledger.floor_evaporation),
            ("co2_out", ledger.co2_out),
            ("co2_dosed", dosing * seconds),
            ("co2_respired", respired * seconds),
            ("co2_taken_up", uptake * seconds),
            ("electricity", lamp_power * seconds),
            ("irrigation", c.irrigation * (seconds / 3600.0)),
            ("drain", drain),
            ("pipe_heat", ledger.rail_loss + ledger.grow_loss),
        ):
            _add(totals, name, amount)
        for name, value in zip(ACCUMULATED, self._actuators(), strict=True):
            _add(s.log, name, value * seconds)
        s.log_seconds += seconds

    def stored(self) -> dict[str, Array]:
        """Return what the plant holds: energy J m-2; water, CO2 and carbohydrate kg m-2 (crop with its harvest)."""
        s, p = self.state, self.parameters
        return {
            "energy": climate.stored_energy(p, s.climate, self._area),
            "vapour": climate.stored_vapour(p, s.climate),
            "slab": s.slab,
            "co2": climate.stored_co2(p, s.climate),
            "carbohydrate": tomato.stored_carbohydrate(s.crop) + s.assimilated,
        }

    def residuals(self, before: Mapping[str, Array]) -> dict[str, Array]:
        """Return what the balances of energy, vapour, slab water, CO2 and carbohydrate miss since the start.

        `before` is `stored()` at the start; the books begin with the plant. Energy counts the latent heat of the
        vapour that effects and disturbances bring.
        """
        t, now = self.state.totals, self.stored()
        energy_in = (
            t["sun_in"] + t["lamp_in"] + t["boiler_in"] + t["unmodelled_heat_in"] + t.get("leaf_heat_in", 0.0)
            + LATENT_HEAT * t["unmodelled_vapour_in"]
        )  # fmt: skip
        energy_out = (
            t["to_sky"] + t["to_outside"] + t["air_heat_out"] + t["to_deep_soil"] + LATENT_HEAT * t["vapour_out"]
        )
        vapour = (
            t["transpiration"]
            + t["floor_evaporation"]
            + t["unmodelled_vapour_in"]
            - t["condensation"]
            - t["vapour_out"]
        )
        co2 = t["co2_dosed"] + t["co2_respired"] + t["unmodelled_co2_in"] - t["co2_taken_up"] - t["co2_out"]
        carbohydrate = (t["co2_taken_up"] - t["co2_respired"]) / tomato.CO2_PER_CARBOHYDRATE
        pending = self.state.respiration * self.state.crop_seconds
        return {
            "energy": now["energy"] - before["energy"] - energy_in + energy_out,
            # Condensate carries no heat in this account: its latent heat stays with the cover it warmed.
            "vapour": now["vapour"] - before["vapour"] - vapour,
            "slab": now["slab"] - before["slab"] - t["irrigation"] + t["drain"] + t["transpiration"],
            "co2": now["co2"] - before["co2"] - co2,
            "carbohydrate": now["carbohydrate"] - pending - before["carbohydrate"] - carbohydrate,
        }

    # -- saving -------------------------------------------------------------------------------------------------

    def saved(self) -> PlantState:
        """Return a copy of the state."""
        return copy.deepcopy(self.state)

    def restore(self, state: PlantState) -> None:
        """Take up a saved state; the plant goes on exactly as it would have."""
        self.state = copy.deepcopy(state)
        self._area = tomato.leaf_area_index(self.parameters, self.state.crop)


_SETPOINT_NAMES = ("heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on")
_SUN_DRIVERS = frozenset({"sun_elevation", "sun_azimuth", "hour", "weekday"})
_SENSOR_CHANNELS = frozenset(
    {"air_temperature", "air_humidity", "air_co2", "rail_pipe_temperature", "grow_pipe_temperature", "par"}
)


def _add(totals: dict[str, Array], name: str, amount: Array) -> None:
    totals[name] = totals[name] + amount if name in totals else amount


def _picking_day(seconds: float, longitude: float) -> int:
    """Return the number of the local solar day that begins at nine in the morning."""
    return int((seconds + 240.0 * longitude - 9 * 3600.0) // 86_400.0)
