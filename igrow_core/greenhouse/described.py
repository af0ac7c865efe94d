"""The mechanistic greenhouse that a site file describes, and hidden effects as a command line writes them."""

from __future__ import annotations

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.greenhouse.hidden import HiddenEffect
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.site import Site


def parameters_of(site: Site) -> GreenhouseParameters:
    """Return the plant's parameters for what a site says of its greenhouse; the rest keeps its default.

    A site's cover figures describe what a calibrated model sees, not the plant's own cover, and stay out of it.
    """
    greenhouse = site.greenhouse
    return GreenhouseParameters(
        latitude=site.latitude,
        longitude=site.longitude,
        air_height=greenhouse.mean_height,
        lamp_capacity=greenhouse.lamps.power if greenhouse.lamps else 0.0,
        lamp_photons=greenhouse.lamps.efficacy if greenhouse.lamps else 1.24,
        leakage=greenhouse.leakage,
        rail_exchange=greenhouse.rail_pipe_heat_transfer,
        grow_exchange=greenhouse.grow_pipe_heat_transfer,
        boiler_capacity=greenhouse.heating_capacity,
        stem_density=site.crop.stem_density,
    )


def parse_effect(text: str) -> HiddenEffect:
    """Return the effect written as NAME, NAME=SIZE, NAME@START or NAME=SIZE@START.

    Raises:
        IgrowError: it is written in another way, or there is no such effect.
    """
    head, _, start = text.partition("@")
    name, separator, number = head.partition("=")
    try:
        size = float(number) if separator else None
        begins = np.datetime64(start.removesuffix("Z"), "s") if start else None
    except ValueError:
        right = "NAME[=SIZE][@START] is right, such as co2_valve_leak=0.5@2020-03-01"
        raise IgrowError(f"effect {text!r}: {right}") from None
    return HiddenEffect(name, size, begins)
