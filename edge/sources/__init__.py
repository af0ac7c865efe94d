"""Where setpoints come from, in order.

Override, an approved separating test (`igrow.edge.separating_tests`), the recipe where the grower wants it, valid plan,
last valid plan, recipe, hands off.
"""

from igrow.edge.sources.decision import Choice, Decision, Offer, Source, decide
from igrow.edge.sources.hands_off import HandsOff
from igrow.edge.sources.override import GrowerOverride, Lease, WantedRecipe
from igrow.edge.sources.plans import FreshPlan, LastValidPlan, PlanKeeper
from igrow.edge.sources.recipe import Period, Recipe, RecipeSource, recipe_at, recipe_course

__all__ = [
    "Choice",
    "Decision",
    "FreshPlan",
    "GrowerOverride",
    "HandsOff",
    "LastValidPlan",
    "Lease",
    "Offer",
    "Period",
    "PlanKeeper",
    "Recipe",
    "RecipeSource",
    "Source",
    "WantedRecipe",
    "decide",
    "recipe_at",
    "recipe_course",
]
