"""Figure 3 of Cao et al. (2022): the champion's net profit over the season, predicted against measured.

The champion's climate is not published, nor his settings; so no climate can be simulated. What he decided is in the
books: lamps (electricity) and stems. From these and the slab's temperature his harvest is predicted by a predictor
fitted on the other five compartments; heat, CO2 and Brix are the mean of those five. No number of his harvest, heat,
CO2 or quality enters. The distance is the sum over the days of the absolute difference of cumulative net profit.
"""

from __future__ import annotations

import json
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.economics import co2_cost, product_price
from igrow.core.errors import IgrowError
from igrow.core.site import Prices
from igrow.trainer.research.paper.automatoes2020 import Champion
from igrow.trainer.research.paper.automatoes2020 import read as read_champion
from igrow.trainer.research.paper.compartments import Compartment, read_2019
from igrow.trainer.research.paper.harvests import PREDICTORS

CHAMPION = "Automatoes"
PUBLISHED = {"Wageningen's simulator": 349.0, "incremental": 507.0, "baseline": 571.0}
"""Distances of the paper; its own two simulators were driven by the champion's settings, which are not published."""


def predicted_profit(champion: Compartment, others: Sequence[Compartment], harvested: Floats, prices: Prices) -> Floats:
    """Return cumulative net profit (days,) EUR m-2 of a predicted cumulative harvest (days,) kg m-2.

    Everything picked is sold as class A, as it was picked: in the days on which the others harvested (their mean).
    """
    days = champion.day.size

    def mean(name: str) -> Floats:
        return np.asarray(np.mean([other.resources[name][:days] for other in others], axis=0))

    brix = np.mean([np.interp(np.arange(days), other.harvest_day, other.brix) for other in others], axis=0)
    income = np.cumsum(np.diff(harvested, prepend=0.0) * product_price(prices, champion.day, brix))
    electricity = (
        prices.electricity.peak * champion.resources["electricity_peak"]
        + prices.electricity.off_peak * champion.resources["electricity_off_peak"]
    )
    costs = np.cumsum(electricity + prices.heat * mean("heat") + prices.stem_day * champion.drivers["stem_density"])
    costs = costs + co2_cost(prices, 0.0, np.cumsum(mean("co2"))) + prices.plant * champion.plant_density
    return np.asarray(income - costs)


def distances(folder: Path, books: Path) -> tuple[Champion, dict[str, Floats]]:
    """Return the champion's measured profit, and the predicted ones (days,) by predictor, Wageningen's included.

    Raises IgrowError where the champion's compartment is missing from `folder`.
    """
    compartments = read_2019(folder)
    found = [crop for crop in compartments if crop.name == CHAMPION]
    if not found:
        raise IgrowError(f"{folder}: no compartment {CHAMPION}")
    champion, others = found[0], [crop for crop in compartments if crop.name != CHAMPION]
    measured = read_champion(books)
    prices = Prices()
    curves = {"Wageningen's simulator": measured.simulated - prices.plant * champion.plant_density}
    for name, predictor in PREDICTORS.items():
        curves[name] = predicted_profit(champion, others, predictor(others, champion), prices)
    return measured, curves


def run(agc2019: Path, books: Path, out: Path) -> dict[str, float]:
    """Print the distances; write figure3.json and figure3.svg to `out`. Returns the distance of each predictor."""
    measured, curves = distances(agc2019, books)
    result = {name: float(np.abs(curve - measured.measured).sum()) for name, curve in curves.items()}
    print("| predictor | sum of absolute daily differences, EUR m-2 | net profit at the end, EUR m-2 |")
    print("|---|---|---|")
    for name, curve in curves.items():
        print(f"| {name} | {result[name]:.0f} | {curve[-1]:.2f} |")
    print(f"| measured | | {measured.measured[-1]:.2f} |")
    for name, distance in PUBLISHED.items():
        print(f"| as published: {name} | {distance:.0f} | |")
    out.mkdir(parents=True, exist_ok=True)
    (out / "figure3.json").write_text(json.dumps(result, indent=1))
    plot(out / "figure3.svg", measured, curves)
    return result


def plot(path: Path, measured: Champion, curves: dict[str, Floats]) -> None:
    """Draw measured and predicted net profit over the season, and below how their distance adds up from day to day."""
    from igrow.core.language import ENGLISH  # noqa: PLC0415
    from igrow.trainer.figure_style import COLOURS, date_axis, name_above, panels  # noqa: PLC0415, only this draws

    figure, (profit, distance) = panels(2, 6.4, width=6.0)
    profit.plot(measured.day, measured.measured, color=COLOURS["measured"], linewidth=2.2, label="measured")
    for position, (name, curve) in enumerate(curves.items()):
        stroke = ("-", "--", ":", "-.")[position % 4]
        profit.plot(measured.day, curve, stroke, color=f"C{position}", label=name)
        adding = np.cumsum(np.abs(curve - measured.measured))
        distance.plot(measured.day, adding, stroke, color=f"C{position}")
    name_above(profit, "cumulative net profit, EUR/m²")
    name_above(distance, "sum of absolute daily differences, EUR/m²")
    profit.legend(fontsize=8, frameon=False)
    date_axis(distance, ENGLISH)
    figure.savefig(path, facecolor="white")


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `reproduce figure3`."""
    parser.add_argument("--agc2019", type=Path, required=True, help="folder of the second challenge")
    parser.add_argument("--books", type=Path, required=True, help="folder with the champion's workbook")
    parser.add_argument("--out", type=Path, required=True, help="folder for figure3.json and figure3.svg")
