"""A site: one greenhouse with its place, equipment, crop, prices, limits and paces, as a grower writes it down.

Only the name and the place are required. Every other value has the default of the cherry tomato compartments of
the second Autonomous Greenhouse Challenge (2019/2020, doi:10.4121/uuid:88d22c60-21b3-4ea8-90db-20249a5be2a7),
so that a file of ten lines describes a greenhouse. Its prices are those of that challenge's economics document.
"""

from igrow.core.site.agronomy import Agronomy, Band, Rest
from igrow.core.site.control import Limits, Planning, SetpointLimits
from igrow.core.site.crop import Crop
from igrow.core.site.equipment import Greenhouse, Lamps, Screen, Sensor
from igrow.core.site.prices import ElectricityTariff, Prices, ProductPrice, Tier
from igrow.core.site.site import Site, load_site

__all__ = [
    "Agronomy",
    "Band",
    "Crop",
    "ElectricityTariff",
    "Greenhouse",
    "Lamps",
    "Limits",
    "Planning",
    "Prices",
    "ProductPrice",
    "Rest",
    "Screen",
    "Sensor",
    "SetpointLimits",
    "Site",
    "Tier",
    "load_site",
]
