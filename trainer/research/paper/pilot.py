"""The second pilot of Cao et al. (2022): its table, with honest spreads and tests, its figure 5, and figures S4 to S13.

Two greenhouses of growers against five of iGrow, in Liaoyang. Two of a kind tell little, whatever the test. Three are
given, since the published p-values come of different ones: that of the yield of the one-sample test against the mean of
the growers, that of the net profit of Student's for two samples. Welch's takes no mean as known, no spreads as equal.
"""

from __future__ import annotations

import json
import warnings
from argparse import ArgumentParser
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy import stats

from igrow.core.arrays import Floats
from igrow.core.language import ENGLISH
from igrow.core.quantities import QUANTITIES
from igrow.trainer.figure_style import COLOURS, date_axis, few_ticks, name_above, panels
from igrow.trainer.research.paper.liaoyang2020 import AREA, CONTROL, EXPERIMENT, Pilot, read, read_climate_pair

PUBLISHED: Mapping[str, Mapping[str, float]] = {
    "yield": {"change": 10.15, "control_spread": 53.0, "experiment_spread": 45.0, "p": 8e-3},
    "net profit": {"control": 1498.56, "experiment": 2887.70, "change": 92.70, "p": 2.8e-4},
}
"""What the paper prints, where it prints it: kg and EUR per greenhouse, per cent."""
_GROUPS = (("growers", CONTROL, "deployed"), ("iGrow", EXPERIMENT, "corrected"))
_FIRST_PAIR = 4
"""Number of the first of the figures S4 to S13."""


@dataclass(frozen=True)
class Line:
    """One line of the table, per greenhouse."""

    unit: str
    control: float
    control_spread: float
    """Standard deviation, of the two themselves (as the paper has it)."""
    experiment: float
    experiment_spread: float
    change: float
    """Per cent."""
    p_one_sample: float
    """Of the experiment against the control's mean, two-sided."""
    p_student: float
    """Of two samples with one spread, two-sided."""
    p_welch: float
    """Of two samples, two-sided."""


def table(pilot: Pilot) -> dict[str, Line]:
    """Return the pilot's table by what is compared."""
    total = {
        "yield": ("kg", lambda greenhouse: pilot.production[greenhouse].sum()),
        "income": ("EUR", lambda greenhouse: pilot.income[greenhouse].sum()),
        "costs": ("EUR", lambda greenhouse: sum(pilot.costs[greenhouse].values())),
        "net profit": ("EUR", pilot.net_profit),
    }
    lines = {name: _line(unit, AREA, one) for name, (unit, one) in total.items()}
    lines["price"] = _line(
        "EUR kg-1", 1.0, lambda greenhouse: pilot.income[greenhouse].sum() / pilot.production[greenhouse].sum()
    )
    return lines


def _line(unit: str, area: float, value: Callable[[str], float]) -> Line:
    control, experiment = (
        area * np.array([value(greenhouse) for greenhouse in group]) for group in (CONTROL, EXPERIMENT)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        tests = (
            stats.ttest_1samp(experiment, control.mean()),
            stats.ttest_ind(experiment, control),
            stats.ttest_ind(experiment, control, equal_var=False),
        )
    change = 100.0 * (experiment.mean() / control.mean() - 1.0)
    return Line(
        unit,
        float(control.mean()),
        float(control.std()),
        float(experiment.mean()),
        float(experiment.std()),
        float(change),
        *(float(test.pvalue) for test in tests),
    )


def run(data: Path, out: Path) -> dict[str, Line]:
    """Print the table beside the published one; write pilot.json, figure5.svg and figureS4.svg to figureS13.svg."""
    pilot = read(data)
    lines = table(pilot)
    print("| per greenhouse | growers (2) | iGrow (5) | change | p one-sample | p Student | p Welch |")
    print("|---|---|---|---|---|---|---|")
    for name, one in lines.items():
        digits = 2 if one.control < 10.0 else 0
        cells = (f"{one.control:.{digits}f} ± {one.control_spread:.{digits}f}",
                 f"{one.experiment:.{digits}f} ± {one.experiment_spread:.{digits}f}", f"{one.change:+.2f} %",
                 f"{one.p_one_sample:.2g}", f"{one.p_student:.2g}", f"{one.p_welch:.2g}")  # fmt: skip
        print(f"| {name}, {one.unit} | {' | '.join(cells)} |")
        if name in PUBLISHED:
            told = ", ".join(f"{what.replace('_', ' ')} {value:g}" for what, value in PUBLISHED[name].items())
            print(f"| as published: {told} | | | | | | |")
    print(f"{price_share(lines['yield'], lines['income']):.0f} % of the extra income is price, the rest harvest")
    out.mkdir(parents=True, exist_ok=True)
    content = {"computed": {name: asdict(one) for name, one in lines.items()}, "published": PUBLISHED}
    (out / "pilot.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    figure5(pilot, out / "figure5.svg")
    pairs = [(experiment, control) for experiment in range(3, 8) for control in (1, 2)]
    for number, (experiment, control) in enumerate(pairs, _FIRST_PAIR):
        climate_pair(data, experiment, control, out / f"figureS{number}.svg")
    print(f"figures 5 and S{_FIRST_PAIR} to S{_FIRST_PAIR + len(pairs) - 1} in {out}")
    return lines


def price_share(harvest: Line, income: Line) -> float:
    """Return the per cent of the extra income that is a higher price of what was harvested."""
    dearer = income.experiment / harvest.experiment - income.control / harvest.control
    return 100.0 * harvest.experiment * dearer / (income.experiment - income.control)


def figure5(pilot: Pilot, path: Path) -> None:
    """Draw harvest, price and income by day: the mean of each group, with its lowest and highest greenhouse."""
    figure, places = panels(3, 5.0)
    harvested, earned = pilot.production, pilot.income
    courses: list[tuple[str, Callable[[str], Floats]]] = [
        ("harvest so far, kg/m²", lambda greenhouse: np.cumsum(harvested[greenhouse])),
        ("price, EUR/kg", lambda greenhouse: _price(harvested[greenhouse], earned[greenhouse])),
        ("income so far, EUR/m²", lambda greenhouse: np.cumsum(earned[greenhouse])),
    ]
    for axes, (title, course) in zip(places, courses, strict=True):
        for name, group, colour in _GROUPS:
            rows = np.array([course(greenhouse) for greenhouse in group])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # days without a harvest have no price
                mean, low, high = np.nanmean(rows, axis=0), np.nanmin(rows, axis=0), np.nanmax(rows, axis=0)
            axes.plot(pilot.day, mean, color=COLOURS[colour], label=f"{name} ({len(group)})")
            axes.fill_between(pilot.day, low, high, color=COLOURS[colour], alpha=0.25, linewidth=0.0)
        name_above(axes, title)
    places[0].legend(loc="upper left", frameon=False, fontsize=8.5)
    date_axis(places[-1], ENGLISH)
    figure.savefig(path, facecolor="white")


def _price(harvested: Floats, earned: Floats) -> Floats:
    """Return the price of each day, NaN where nothing was sold."""
    sold = (harvested > 0.0) & (earned > 0.0)
    return np.where(sold, earned / np.where(sold, harvested, 1.0), np.nan)


def climate_pair(folder: Path, experiment: int, control: int, path: Path) -> None:
    """Draw the climate of one greenhouse of each kind over the hours that both have."""
    ours, theirs = read_climate_pair(folder, experiment, control)
    names = [name for name in ours if np.isfinite(ours[name]).any() and np.isfinite(theirs[name]).any()]
    figure, places = panels(len(names), 0.8 + 1.2 * len(names))
    for axes, name in zip(places, names, strict=True):
        axes.plot(theirs[name], color=COLOURS["deployed"], linewidth=0.8, label=f"growers, greenhouse {control}")
        axes.plot(ours[name], color=COLOURS["corrected"], linewidth=0.8, label=f"iGrow, greenhouse {experiment}")
        few_ticks(axes)
        name_above(axes, f"{ENGLISH.name(name)}, {ENGLISH.unit(QUANTITIES[name].unit)}")
    figure.legend(
        *places[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=8.5
    )
    places[-1].set_xlabel("hours that both have")
    figure.savefig(path, facecolor="white")


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `reproduce pilot`."""
    parser.add_argument("--data", type=Path, required=True, help="folder of the pilot's data")
    parser.add_argument("--out", type=Path, required=True, help="folder for pilot.json and the figures")
