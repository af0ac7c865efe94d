"""The slow time scale: a strategy for the whole season, and what leaves, buffer and fruit of each age are worth.

A greenhouse has two time scales. Its climate forgets within a day, its crop within months, so that the season is
solved first with the climate as it settles, and each day then with the season's marginal values (Van Henten 1994,
Greenhouse climate management, thesis Wageningen; Van Straten, Van Willigenburg, Van Henten and Van Ooteghem 2010,
Optimal Control of Greenhouse Cultivation, CRC Press).

strategy  a season in a grower's terms: day and night, warmth by the sun, CO2 and lamps, from knot to knot
crop      the tomato of the mechanistic greenhouse, fed by what a simulator says that the canopy takes up
course    the season: days of weather through the simulator, the crop through all days, the balance at its end
worth     marginal values of the crop's state by finite differences, and the day's objective made of them
search    the best numbers of a strategy, or of a rule, by the elitist genetic algorithm
plan      what the season leaves to the days, as a bundle carries it
"""

from igrow.core.planner.season.course import Season, SeasonOutcome, run_season
from igrow.core.planner.season.plan import SEASON_FILE, SeasonPlan, valued
from igrow.core.planner.season.strategy import OPTIONAL, Strategy
from igrow.core.planner.season.worth import CropWorth, marginal_values

__all__ = [
    "OPTIONAL",
    "SEASON_FILE",
    "CropWorth",
    "Season",
    "SeasonOutcome",
    "SeasonPlan",
    "Strategy",
    "marginal_values",
    "run_season",
    "valued",
]
