"""The plant's books: what crossed its boundary, what it holds, and whether the two agree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Array
from igrow.core.greenhouse import climate_state, tomato
from igrow.core.greenhouse.climate_state import Climate, Ledger
from igrow.core.greenhouse.light import Light
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.state import ACCUMULATED, PlantState, add


class Inflow(NamedTuple):
    """What came in during a tick beside sun and pipes; W m-2 and kg m-2 s-1."""

    lamp_power: Array
    heat: Array
    """Of effects and disturbances, as are the next two."""
    vapour: Array
    co2: Array
    dosing: Array
    respired: Array
    """CO2 from the crop, and into it."""
    uptake: Array
    drain: Array
    """L m-2 during the tick."""


def account(
    parameters: GreenhouseParameters, state: PlantState, seconds: float, ledger: Ledger, light: Light, inflow: Inflow
) -> None:
    """Enter one tick into the books of `state`."""
    totals, control = state.totals, state.control
    for name, amount in (
        ("sun_in", light.sun_absorbed * seconds),
        ("lamp_in", (inflow.lamp_power - light.lamp_out) * seconds),
        ("boiler_in", (control.rail_heat + control.grow_heat) * seconds),
        ("unmodelled_heat_in", inflow.heat * seconds),
        ("unmodelled_vapour_in", inflow.vapour * seconds),
        ("unmodelled_co2_in", inflow.co2 * seconds),
        ("to_sky", ledger.to_sky),
        ("to_outside", ledger.to_outside),
        ("air_heat_out", ledger.air_heat_out),
        ("to_deep_soil", ledger.to_deep_soil),
        ("vapour_out", ledger.vapour_out),
        ("condensation", ledger.condensation),
        ("transpiration", ledger.transpiration),
        ("floor_evaporation", ledger.floor_evaporation),
        ("co2_out", ledger.co2_out),
        ("co2_dosed", inflow.dosing * seconds),
        ("co2_respired", inflow.respired * seconds),
        ("co2_taken_up", inflow.uptake * seconds),
        ("electricity", inflow.lamp_power * seconds),
        ("irrigation", control.irrigation * (seconds / 3600.0)),
        ("drain", inflow.drain),
        ("pipe_heat", ledger.rail_loss + ledger.grow_loss),
    ):
        add(totals, name, amount)
    for name, value in zip(ACCUMULATED, state.actuators(parameters), strict=True):
        add(state.log, name, value * seconds)
    state.log_seconds += seconds


def stored(parameters: GreenhouseParameters, state: PlantState) -> dict[str, Array]:
    """Return what the plant holds: energy J m-2; water, CO2 and carbohydrate kg m-2 (crop with its harvest)."""
    area = tomato.leaf_area_index(parameters, state.crop)
    return {
        "energy": stored_energy(parameters, state.climate, area),
        "vapour": stored_vapour(parameters, state.climate),
        "slab": state.slab,
        "co2": stored_co2(parameters, state.climate),
        "carbohydrate": tomato.stored_carbohydrate(state.crop) + state.assimilated,
    }


def residuals(parameters: GreenhouseParameters, state: PlantState, before: Mapping[str, Array]) -> dict[str, Array]:
    """Return what the balances of energy, vapour, slab water, CO2 and carbohydrate miss since the start.

    `before` is `stored` at the start. Energy counts the latent heat of the vapour that effects and disturbances
    bring. Condensate takes none along: its latent heat stays with the cover that it warmed.
    """
    t, now = state.totals, stored(parameters, state)
    energy_in = (
        t["sun_in"] + t["lamp_in"] + t["boiler_in"] + t["unmodelled_heat_in"] + t.get("leaf_heat_in", 0.0)
        + LATENT_HEAT * t["unmodelled_vapour_in"]
    )  # fmt: skip
    energy_out = t["to_sky"] + t["to_outside"] + t["air_heat_out"] + t["to_deep_soil"] + LATENT_HEAT * t["vapour_out"]
    vapour = (
        t["transpiration"] + t["floor_evaporation"] + t["unmodelled_vapour_in"] - t["condensation"] - t["vapour_out"]
    )
    co2 = t["co2_dosed"] + t["co2_respired"] + t["unmodelled_co2_in"] - t["co2_taken_up"] - t["co2_out"]
    carbohydrate = (t["co2_taken_up"] - t["co2_respired"]) / tomato.CO2_PER_CARBOHYDRATE
    # The crop is charged for its respiration at the next slow step; the air has it already.
    pending = state.respiration * state.crop_seconds
    return {
        "energy": now["energy"] - before["energy"] - energy_in + energy_out,
        "vapour": now["vapour"] - before["vapour"] - vapour,
        "slab": now["slab"] - before["slab"] - t["irrigation"] + t["drain"] + t["transpiration"],
        "co2": now["co2"] - before["co2"] - co2,
        "carbohydrate": now["carbohydrate"] - pending - before["carbohydrate"] - carbohydrate,
    }


def stored_energy(p: GreenhouseParameters, state: Climate, leaf_area_index: Array) -> Array:
    """Return sensible and latent heat in the greenhouse above 0 degC, J m-2."""
    air, top, canopy, cover, screen, floor = climate_state.capacities(p, leaf_area_index)
    soil = p.soil_heat_capacity * (
        climate_state.SOIL_LAYERS[0] * state.soil_1
        + climate_state.SOIL_LAYERS[1] * state.soil_2
        + climate_state.SOIL_LAYERS[2] * state.soil_3
    )
    sensible = (
        air * state.air
        + top * state.top
        + canopy * state.canopy
        + cover * state.cover
        + screen * state.screen
        + floor * state.floor
        + soil
        + p.rail_capacity * state.rail
        + p.grow_capacity * state.grow
    )
    return sensible + LATENT_HEAT * stored_vapour(p, state)


def stored_vapour(p: GreenhouseParameters, state: Climate) -> Array:
    """Return the water vapour in both airs, kg m-2."""
    return p.air_height * state.vapour + p.top_height * state.top_vapour


def stored_co2(p: GreenhouseParameters, state: Climate) -> Array:
    """Return the CO2 in both airs, kg m-2."""
    return p.air_height * state.co2 + p.top_height * state.top_co2
