"""The climate: balances of heat, vapour and CO2, and the integrator that keeps them closed.

Structure and coefficients after Vanthoor (2011, electronic appendix, sections 3 to 8) and De Zwart (1996); the cover is
one body, as a single glass pane has next to no resistance; lamps have no mass.

One step linearises the fluxes at its start and solves for the end (linearly implicit Euler, which no conductance
can make unstable), once whole and once in two halves; twice the second less the first is of second order and
keeps every balance, since balances are linear in the states (Hairer and Wanner 1996, Solving Ordinary Differential
Equations II, section IV.9). The fluxes over the boundary are integrated with the same rule.
"""

from __future__ import annotations

from typing import Any

from igrow.core.air import LATENT_HEAT, STEFAN_BOLTZMANN, saturation_concentration
from igrow.core.arrays import Array
from igrow.core.greenhouse.climate_state import AIR_HEAT, SOIL_LAYERS, Climate, Conditions, Ledger, capacities
from igrow.core.greenhouse.linear import ZERO, solve
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.ventilation import past_screens

MASS_PER_HEAT = 0.89 ** (-2.0 / 3.0) / AIR_HEAT
"""Mass transfer velocity (m s-1) for a convection of 1 W m-2 K-1: Lewis relation, Le = 0.89 (Monteith 2013)."""


def _long_wave(factor: Array, one: Array, other: Array) -> Array:
    """Return the conductance W m-2 K-1 of the exchange factor * sigma * (T1^4 - T2^4); temperatures in kelvin."""
    return (STEFAN_BOLTZMANN * factor) * (one + other) * (one * one + other * other)


def _power_033(xp: Any, difference: Array) -> Array:
    """Return |difference|^0.33, smooth at zero."""
    return xp.exp(0.165 * xp.log(difference * difference + 1e-4))


class Linearised:
    """The fluxes at one state and how they change with the first eight states, to be solved for any step."""

    def __init__(self, xp: Any, p: GreenhouseParameters, state: Climate, c: Conditions) -> None:
        self.p, self.state, self.c = p, state, c
        air, top, canopy, cover, screen, floor, vapour, top_vapour = state[:8]
        area = c.leaf_area_index
        mixing_flow = past_screens(xp, p, c.energy_closure, c.blackout_closure, air - top)
        closed = 1.0 - (1.0 - c.energy_closure) * (1.0 - c.blackout_closure)

        # Convection, W m-2 K-1
        canopy_air = 2.0 * p.leaf_convection * area + 0.5
        air_screen = 1.7 * closed * _power_033(xp, air - screen) + 0.05
        screen_top = 1.7 * closed * _power_033(xp, screen - top) + 0.05
        top_cover = p.cover_inside_convection * p.cover_area * _power_033(xp, top - cover)
        cover_out = p.cover_area * (p.cover_outside_convection + p.cover_wind_convection * c.wind_speed)
        floor_air = xp.where(floor > air, 1.7, 1.0) * _power_033(xp, floor - air)
        mixing = AIR_HEAT * mixing_flow
        top_out = AIR_HEAT * c.vent_exchange
        air_out = AIR_HEAT * c.air_exchange

        # Long-wave radiation, W m-2 K-1
        seen = 1.0 - xp.exp(-p.extinction_long_wave * area)
        transmission = p.screen_long_wave_transmission
        open_sky = (1.0 - c.energy_closure * (1.0 - transmission)) * (1.0 - c.blackout_closure * (1.0 - transmission))
        shut = 1.0 - open_sky
        kelvin_canopy, kelvin_cover, kelvin_screen, kelvin_floor = (
            canopy + 273.15,
            cover + 273.15,
            screen + 273.15,
            floor + 273.15,
        )
        kelvin_sky = c.sky_temperature + 273.15
        up_cover, up_screen = open_sky * p.cover_emission, shut * p.screen_emission
        from_canopy = seen * p.canopy_emission
        canopy_cover = _long_wave(from_canopy * up_cover, kelvin_canopy, kelvin_cover)
        canopy_screen = _long_wave(from_canopy * up_screen, kelvin_canopy, kelvin_screen)
        canopy_floor = _long_wave(from_canopy, kelvin_canopy, kelvin_floor)
        floor_cover = _long_wave((1.0 - seen) * up_cover, kelvin_floor, kelvin_cover)
        floor_screen = _long_wave((1.0 - seen) * up_screen, kelvin_floor, kelvin_screen)
        screen_cover = _long_wave(shut * p.screen_emission * p.cover_emission, kelvin_screen, kelvin_cover)
        cover_sky = _long_wave(p.cover_emission, kelvin_cover, kelvin_sky)

        # Pipes, W m-2; a part warms the air, the rest the bodies that see the pipes. A grow pipe hangs in the crop.
        rail = p.rail_exchange * (state.rail - air)
        grow = p.grow_exchange * (state.grow - air)
        pipe = rail + grow
        exchange = p.rail_exchange + p.grow_exchange
        radiant = 1.0 - p.pipe_convection
        upward = 1.0 - 0.5 * seen - 0.35
        share_up_cover = radiant * upward * open_sky
        share_up_screen = radiant * upward * shut
        share_canopy = radiant * 0.5 * seen
        share_floor = radiant * 0.35
        lamp = c.lamp_long_wave

        # Soil, W m-2 K-1: floor to the middle of the first layer
        soil = p.soil_conductivity / (0.5 * SOIL_LAYERS[0])

        # Vapour, m s-1
        saturated_canopy, slope_canopy = _saturation(xp, canopy)
        saturated_cover, slope_cover = _saturation(xp, cover)
        saturated_screen, slope_screen = _saturation(xp, screen)
        saturated_floor, slope_floor = _saturation(xp, floor)
        canopy_conductance = c.canopy_conductance
        wet_floor = xp.where(saturated_floor > vapour, p.floor_wetness, 0.0) * floor_air * MASS_PER_HEAT
        wet_cover = xp.where(top_vapour > saturated_cover, top_cover * MASS_PER_HEAT, 0.0)
        wet_screen = xp.where(vapour > saturated_screen, air_screen * MASS_PER_HEAT, 0.0)
        transpiration = canopy_conductance * (saturated_canopy - vapour)
        evaporation = wet_floor * (saturated_floor - vapour)
        on_cover = wet_cover * (top_vapour - saturated_cover)
        on_screen = wet_screen * (vapour - saturated_screen)

        # Net fluxes into each of the eight states at its start
        q_canopy_air = canopy_air * (canopy - air)
        q_air_screen = air_screen * (air - screen)
        q_screen_top = screen_top * (screen - top)
        q_top_cover = top_cover * (top - cover)
        q_floor_air = floor_air * (floor - air)
        q_mixing = mixing * (air - top)
        self.top_heat_out = top_out * (top - c.outdoor_temperature)
        self.air_heat_out = air_out * (air - c.outdoor_temperature)
        q_canopy_cover = canopy_cover * (canopy - cover)
        q_canopy_screen = canopy_screen * (canopy - screen)
        q_canopy_floor = canopy_floor * (canopy - floor)
        q_floor_cover = floor_cover * (floor - cover)
        q_floor_screen = floor_screen * (floor - screen)
        q_screen_cover = screen_cover * (screen - cover)
        self.to_sky = cover_sky * (cover - c.sky_temperature)
        self.to_outside = cover_out * (cover - c.outdoor_temperature)
        self.to_soil = soil * (floor - state.soil_1)
        v_mixing = mixing_flow * (vapour - top_vapour)
        self.top_vapour_out = c.vent_exchange * (top_vapour - c.outdoor_vapour)
        self.air_vapour_out = c.air_exchange * (vapour - c.outdoor_vapour)
        latent = LATENT_HEAT
        self.net = [
            q_canopy_air + q_floor_air - q_air_screen - q_mixing - self.air_heat_out
            + p.pipe_convection * pipe + c.heat,
            q_mixing + q_screen_top - q_top_cover - self.top_heat_out,
            c.sun_canopy - q_canopy_air - q_canopy_cover - q_canopy_screen - q_canopy_floor
            + share_canopy * pipe + 0.6 * seen * lamp - latent * transpiration,
            c.sun_cover + q_top_cover + q_canopy_cover + q_floor_cover + q_screen_cover
            + share_up_cover * pipe + 0.4 * open_sky * lamp - self.to_sky - self.to_outside + latent * on_cover,
            c.sun_screen + q_air_screen - q_screen_top + q_canopy_screen + q_floor_screen - q_screen_cover
            + share_up_screen * pipe + 0.4 * shut * lamp + latent * on_screen,
            c.sun_floor - q_floor_air + q_canopy_floor - q_floor_cover - q_floor_screen
            + share_floor * pipe + 0.6 * (1.0 - seen) * lamp - self.to_soil - latent * evaporation,
            transpiration + evaporation - on_screen - v_mixing - self.air_vapour_out + c.vapour,
            v_mixing - on_cover - self.top_vapour_out,
        ]  # fmt: skip

        # How the net fluxes fall as the states rise (minus the Jacobian)
        lc, lk = latent * canopy_conductance * slope_canopy, latent * wet_cover * slope_cover
        ls, lf = latent * wet_screen * slope_screen, latent * wet_floor * slope_floor
        self.matrix = [
            [canopy_air + floor_air + air_screen + mixing + air_out + p.pipe_convection * exchange,
             -mixing, -canopy_air, ZERO, -air_screen, -floor_air, ZERO, ZERO],
            [-mixing, mixing + screen_top + top_cover + top_out, ZERO, -top_cover, -screen_top, ZERO, ZERO, ZERO],
            [share_canopy * exchange - canopy_air, ZERO,
             canopy_air + canopy_cover + canopy_screen + canopy_floor + lc, -canopy_cover, -canopy_screen,
             -canopy_floor, -latent * canopy_conductance, ZERO],
            [share_up_cover * exchange, -top_cover, -canopy_cover,
             top_cover + canopy_cover + floor_cover + screen_cover + cover_sky + cover_out + lk, -screen_cover,
             -floor_cover, ZERO, -latent * wet_cover],
            [share_up_screen * exchange - air_screen, -screen_top, -canopy_screen, -screen_cover,
             air_screen + screen_top + canopy_screen + floor_screen + screen_cover + ls, -floor_screen,
             -latent * wet_screen, ZERO],
            [share_floor * exchange - floor_air, ZERO, -canopy_floor, -floor_cover, -floor_screen,
             floor_air + canopy_floor + floor_cover + floor_screen + soil + lf, -latent * wet_floor, ZERO],
            [ZERO, ZERO, -canopy_conductance * slope_canopy, ZERO, -wet_screen * slope_screen,
             -wet_floor * slope_floor, canopy_conductance + wet_floor + wet_screen + mixing_flow + c.air_exchange,
             -mixing_flow],
            [ZERO, ZERO, ZERO, -wet_cover * slope_cover, ZERO, ZERO, -mixing_flow,
             mixing_flow + wet_cover + c.vent_exchange],
        ]  # fmt: skip

        self.capacity = (*capacities(p, area), p.air_height, p.top_height)
        self.mixing_flow = mixing_flow
        self.rates = (top_out, air_out, cover_sky, cover_out, soil)
        self.water = (transpiration, evaporation, on_cover + on_screen)
        self.water_slopes = (
            canopy_conductance, slope_canopy, wet_floor, slope_floor, wet_cover, slope_cover, wet_screen, slope_screen,
        )  # fmt: skip
        self.pipes = (rail, grow)

    def step(self, seconds: float) -> tuple[Climate, Ledger]:
        """Return the state after `seconds` and what crossed the boundary meanwhile."""
        p, state, c = self.p, self.state, self.c
        matrix = [row[:] for row in self.matrix]
        for index, capacity in enumerate(self.capacity):
            matrix[index][index] = matrix[index][index] + capacity / seconds
        d_air, d_top, d_canopy, d_cover, d_screen, d_floor, d_vapour, d_top_vapour = solve(matrix, self.net[:])

        top_out, air_out, cover_sky, cover_out, soil = self.rates
        to_sky = self.to_sky + cover_sky * d_cover
        to_outside = self.to_outside + cover_out * d_cover
        heat_out = self.top_heat_out + self.air_heat_out + top_out * d_top + air_out * d_air
        vapour_out = (
            self.top_vapour_out + self.air_vapour_out + c.vent_exchange * d_top_vapour + c.air_exchange * d_vapour
        )
        transpiration, evaporation, condensation = self.water
        gc, sc, gf, sf, gk, sk, gs, ss = self.water_slopes
        transpiration = transpiration + gc * (sc * d_canopy - d_vapour)
        evaporation = evaporation + gf * (sf * d_floor - d_vapour)
        condensation = condensation + gk * (d_top_vapour - sk * d_cover) + gs * (d_vapour - ss * d_screen)

        # Soil and pipes are slow: explicit, with the very fluxes that the floor and the air saw.
        to_soil = self.to_soil + soil * d_floor
        first, second, third = SOIL_LAYERS
        to_second = p.soil_conductivity * (state.soil_1 - state.soil_2) / (0.5 * (first + second))
        to_third = p.soil_conductivity * (state.soil_2 - state.soil_3) / (0.5 * (second + third))
        to_deep = p.soil_conductivity * (state.soil_3 - p.deep_soil_temperature) / (0.5 * third)
        per_metre = seconds / p.soil_heat_capacity
        rail_loss = self.pipes[0] - p.rail_exchange * d_air
        grow_loss = self.pipes[1] - p.grow_exchange * d_air

        # CO2: two linear equations
        mixing, vent, exchange = self.mixing_flow, c.vent_exchange, c.air_exchange
        below, above = p.air_height / seconds, p.top_height / seconds
        low = c.co2 - mixing * (state.co2 - state.top_co2) - exchange * (state.co2 - c.outdoor_co2)
        high = mixing * (state.co2 - state.top_co2) - vent * (state.top_co2 - c.outdoor_co2)
        m_low, m_high = below + mixing + exchange, above + mixing + vent
        determinant = m_low * m_high - mixing * mixing
        d_co2 = (m_high * low + mixing * high) / determinant
        d_top_co2 = (m_low * high + mixing * low) / determinant
        co2_out = vent * (state.top_co2 + d_top_co2 - c.outdoor_co2) + exchange * (state.co2 + d_co2 - c.outdoor_co2)

        after = Climate(
            state.air + d_air,
            state.top + d_top,
            state.canopy + d_canopy,
            state.cover + d_cover,
            state.screen + d_screen,
            state.floor + d_floor,
            state.vapour + d_vapour,
            state.top_vapour + d_top_vapour,
            state.co2 + d_co2,
            state.top_co2 + d_top_co2,
            state.soil_1 + per_metre / first * (to_soil - to_second),
            state.soil_2 + per_metre / second * (to_second - to_third),
            state.soil_3 + per_metre / third * (to_third - to_deep),
            state.rail + seconds / p.rail_capacity * (c.rail_heat - rail_loss),
            state.grow + seconds / p.grow_capacity * (c.grow_heat - grow_loss),
        )
        crossed = (
            to_sky, to_outside, heat_out, to_deep, vapour_out, condensation, transpiration, evaporation, co2_out,
            rail_loss, grow_loss,
        )  # fmt: skip
        return after, Ledger(*[flux * seconds for flux in crossed])


def _saturation(xp: Any, temperature: Array) -> tuple[Array, Array]:
    """Return the vapour content of saturated air, kg m-3, and its slope, kg m-3 K-1 (derivative of air.py's form)."""
    content = saturation_concentration(xp, temperature)
    shifted = temperature + 243.04
    return content, content * (17.625 * 243.04 / (shifted * shifted) - 1.0 / (temperature + 273.15))


def advance(
    xp: Any, p: GreenhouseParameters, state: Climate, conditions: Conditions, seconds: float
) -> tuple[Climate, Ledger]:
    """Return the state after `seconds` under constant conditions, and what crossed the boundary meanwhile."""
    here = Linearised(xp, p, state, conditions)
    whole, whole_ledger = here.step(seconds)
    half, first = here.step(0.5 * seconds)
    end, second = Linearised(xp, p, half, conditions).step(0.5 * seconds)
    after = Climate(*[2.0 * fine - coarse for fine, coarse in zip(end, whole, strict=True)])
    crossed = [2.0 * (a + b) - coarse for a, b, coarse in zip(first, second, whole_ledger, strict=True)]
    return after, Ledger(*crossed)
