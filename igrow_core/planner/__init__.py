"""Plans: setpoints over a horizon, chosen by an elitist genetic algorithm on the simulator.

Template   genes <-> setpoints per hour, within the site's limits
objective  what a candidate is worth by the simulator's outcome
evolution  one generation as a pure function, the same in numpy and as optimizer.onnx
optimise   the loop: decode, simulate, value, select; the recipe competes and is returned when nothing beats it
"""

from igrow.core.planner.evolution import EvolutionSettings, NumpyGeneration
from igrow.core.planner.objective import Objective
from igrow.core.planner.optimise import Budget, PlanningState, PlanResult, optimise
from igrow.core.planner.template import Template

__all__ = [
    "Budget",
    "EvolutionSettings",
    "NumpyGeneration",
    "Objective",
    "PlanResult",
    "PlanningState",
    "Template",
    "optimise",
]
