"""The mechanistic greenhouse: climate, tomato, and the PLC's own control, from published equations.

It generates virtual trajectories and is the plant behind the virtual PLC. One greenhouse runs on python floats,
many run at once on numpy arrays of shape (N,): the same equations, written against a namespace `xp`.

    climate computer --> actuators --> climate (air, cover, screens, pipes, soil, vapour, CO2) --> tomato
          ^                                        |
          +--------------- sensors <---------------+

Sources: B. H. E. Vanthoor (2011), A model-based greenhouse design method, PhD thesis, Wageningen, and its
electronic appendix; D. Katzin et al. (2020), GreenLight, Biosystems Engineering 194, 61-81; H. F. de Zwart
(1996), Analyzing energy-saving options in greenhouse cultivation using a simulation model, PhD thesis,
Wageningen; C. Stanghellini (1987), Transpiration of greenhouse crops, PhD thesis, Wageningen.
"""

from igrow.core.greenhouse.disturbances import Disturbances
from igrow.core.greenhouse.hidden import HiddenEffect
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.recipe import recipe, recipe_by_hour
from igrow.core.greenhouse.season import Season, simulate, simulate_many
from igrow.core.greenhouse.sensors import Sensors
from igrow.core.greenhouse.virtual import VirtualGreenhouse
from igrow.core.greenhouse.weather import generate_weather, hourly_weather

__all__ = [
    "Disturbances",
    "GreenhouseParameters",
    "HiddenEffect",
    "Season",
    "Sensors",
    "VirtualGreenhouse",
    "generate_weather",
    "hourly_weather",
    "recipe",
    "recipe_by_hour",
    "simulate",
    "simulate_many",
]
