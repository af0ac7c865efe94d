"""`make results`: run the commands whose figures the documentation shows, and write each one's print as a page.

    python -m benchmarks.results [NAME ...]

Without a name all quick ones are run; the long ones (an hour or more each) are run when they are named, or by `--long`.
No table of the documentation is typed: each page says by which command, on which day and of which commit it was made.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.provenance import ROOT, provenance

FOLDER = ROOT / "docs" / "results"


@dataclass(frozen=True)
class Result:
    """One page of results."""

    title: str
    command: tuple[str, ...]
    """After ``python -m``."""
    about: str
    seeds: str
    long: bool = False


RESULTS = {
    "decision-rules": Result(
        "Every threshold of the diagnosis",
        ("benchmarks.diagnosis", "thresholds"),
        "Its value, whether it was chosen or fitted, and what it means.",
        "none",
    ),
    "diagnosis-summary": Result(
        "The diagnosis at a glance",
        ("benchmarks.diagnosis", "summary"),
        "Its figures side by side, each from the page of its own command, beside what it was to be.",
        "none",
    ),
    "diagnosis-transferred": Result(
        "By a neighbour's model, and by the built-in bundle",
        ("benchmarks.diagnosis", "transferred"),
        "Greenhouses that no calibration has shown: the neighbour's is 8 % off in every parameter.",
        "290000 and on; cases from 295000",
        long=True,
    ),
    "season-tuning": Result(
        "A season's rule and strategy, tuned",
        ("benchmarks.seasons", "tune"),
        "In the built-in bundle's simulator, 150 days from a mature crop, both with as many simulated seasons.",
        "1, 2; weather 9001 to 9020",
        long=True,
    ),
    "season-expected": Result(
        "What the simulator expects of the tuned strategies",
        ("benchmarks.seasons", "expect"),
        "EUR m-2 net, kg m-2 picked and grown, MJ, kWh and kg m-2 used in 150 days, by the built-in bundle.",
        "weather 9001 to 9020",
    ),
    "seasons": Result(
        "Whole seasons in greenhouses that no simulator was fitted to",
        ("benchmarks.seasons", "judge"),
        "150 days, through the PLC's own control; what was ripe and picked, less costs; six dark hours for all.",
        "greenhouses and weather 700",
        long=True,
    ),
    "season-causes": Result(
        "Why a season brings less than was expected",
        ("benchmarks.season_causes",),
        "The strategy of today's prices in greenhouses that were not looked at: each as the mean of its kind, with its "
        "own parameters, and with its undeclared effects.",
        "greenhouses and weather 700, greenhouses 20 to 39",
        long=True,
    ),
    "season-ranks": Result(
        "Whether the simulator ranks strategies as a greenhouse does",
        ("benchmarks.seasons", "rank"),
        "200 random strategies of 150 days, each expected by the simulator and led through one greenhouse.",
        "greenhouse and weather 700; strategies 5",
        long=True,
    ),
    "season-humidity": Result(
        "A season with a humidity setpoint and without",
        ("benchmarks.season_humidity",),
        "150 days, at today's prices; tuned in a simulator whose vents answer to the setpoint, and led through "
        "greenhouses whose climate computer takes one.",
        "greenhouses and weather 700; the seasons that teach the vents' rule 31",
        long=True,
    ),
    "season-plans": Result(
        "A plan a day through a short season",
        ("benchmarks.season_plans", "--days", "40", "--greenhouses", "3", "--generations", "24"),
        "With the season's marginal values, and with an average price instead; the same greenhouses for all.",
        "greenhouses and weather 700; searches 0 and on",
        long=True,
    ),
    "algorithm-1": Result(
        "Algorithm 1 with and without its lower level",
        ("benchmarks.algorithm_1", "--figure", "docs/results/algorithm-1.svg"),
        "35 days in three greenhouses that lack something the simulator does not know; a plan a day, by its simulator "
        "as it is, corrected by recent use, and renewed from the log every two weeks.",
        "greenhouses and weather 700; searches 0 and on",
        long=True,
    ),
    "figure-4": Result(
        "Figure 4: a season by the genetic algorithm, by soft actor-critic, and as growers led it",
        ("benchmarks.figure_4", "--minutes", "4", "--figure", "docs/results/figure-4.svg"),
        "119 days of three greenhouses, in our simulator and in the plant; what was ripe and picked, less costs.",
        "greenhouses and weather 700; weather 9001 to 9020 (EGA), 1000000 and on (SAC); networks 0",
        long=True,
    ),
    "march": Result(
        "Five days of March, with the day after and without it",
        (
            "benchmarks.strategies",
            "--days",
            "5",
            "--greenhouses",
            "2",
            "--starts",
            "2020-03-09",
            "--only",
            "genetic algorithm",
            "one day alone",
        ),
        "Plans that are searched with the day after what is followed, and plans of one day alone.",
        "greenhouses and weather 501; searches 0 and on",
        long=True,
    ),
    "limits": Result(
        "Whether a plan leaves a limit of the crop",
        ("benchmarks.limits", "--cases", "1000"),
        "Random sites, crops, weather and recipes; each plan inspected by code apart from what keeps the limits.",
        "0 and on",
        long=True,
    ),
    "fleet": Result(
        "What a fleet costs",
        ("benchmarks.fleet",),
        "A thousand sites, a day each; a year behind one; a weekly diagnosis; and what 100,000 would cost by these.",
        "0 to 19; of the diagnosed log 1",
        long=True,
    ),
    "fleet-cluster": Result(
        "A local Ray of two workers, one of which is killed, beside two processes",
        ("benchmarks.cluster",),
        "The day of each of 50 sites collected; no cluster beyond one machine was measured.",
        "0 to 49",
    ),
    "fleet-population": Result(
        "What a new greenhouse gains by the parameters that others have shared",
        ("benchmarks.population",),
        "Errors a day ahead of a model of its first 8 or 14 days, on the two weeks that follow.",
        "44000 to 44002",
        long=True,
    ),
    "fleet-discrepancy": Result(
        "What it gains by their discrepancy",
        ("benchmarks.shared_discrepancy",),
        "Later logs with nothing missing, and with a cause hidden; calibrated alone, and with what others have shared.",
        "45000 to 45004",
        long=True,
    ),
    "harvests": Result(
        "Harvests of ten compartments",
        ("benchmarks.harvests", "../shared/data"),
        "Each predicted by what was fitted to the others; the mean of these is what a predictor has to beat.",
        "0",
        long=True,
    ),
    "diagnosis-catalogue": Result(
        "Every cause of the catalogue in turn",
        ("benchmarks.diagnosis", "catalogue", "--figure", "docs/results/diagnosis-catalogue.svg"),
        "Each begins a week after the calibration: what is told two weeks later, and the error before and after.",
        "150000 and on, 160000 and on",
        long=True,
    ),
    "diagnosis-same": Result(
        "The same greenhouse later",
        ("benchmarks.diagnosis", "same", "--greenhouses", "4", "--cases", "160"),
        "Calibrated on eight weeks of its own, diagnosed weeks later by its history.",
        "900000 and on",
        long=True,
    ),
    "diagnosis-foreign": Result(
        "Greenhouses of another structure",
        ("benchmarks.diagnosis", "same", "--foreign", "--greenhouses", "4", "--cases", "120"),
        "A simulator that shares no balance with the project's own plant; nothing was learned or tuned on its seeds.",
        "800000 and on",
        long=True,
    ),
    "diagnosis-false-claims": Result(
        "Greenhouses in which nothing is missing",
        ("benchmarks.diagnosis", "false-claims"),
        "Calibrated on eight weeks of their own, diagnosed weeks later: whatever is told is false.",
        "260000 and on, 270000 and on",
        long=True,
    ),
    "diagnosis-false-claims-foreign": Result(
        "The same of another structure",
        ("benchmarks.diagnosis", "false-claims", "--foreign"),
        "Greenhouses of a simulator that shares no balance with the project's own plant.",
        "280000 and on",
        long=True,
    ),
    "diagnosis-same-season": Result(
        "The same greenhouse later, over twelve weeks",
        ("benchmarks.diagnosis", "same", "--days", "84", "--greenhouses", "2", "--cases", "60"),
        "The same greenhouses and causes; a log that is longer than six weeks is asked in parts, the oldest first.",
        "900000 and on",
        long=True,
    ),
    "diagnosis-omission": Result(
        "A term of the physics that the model lacks from its first day",
        ("benchmarks.diagnosis", "omission", "--greenhouses", "2"),
        "Greenhouses calibrated with the whole model, and with one term after the other taken out of it.",
        "610000 and on",
        long=True,
    ),
    "diagnosis-omission-real": Result(
        "The same on real logs",
        ("benchmarks.diagnosis", "omission", "../shared/data"),
        "Five compartments' eight weeks, calibrated with the whole model, and with one of three terms taken out of it.",
        "none",
        long=True,
    ),
    "real-weekly": Result(
        "A real compartment, refitted weekly",
        ("benchmarks.real_greenhouses", "../shared/data/agc2019", "Reference", "--tables", "weekly"),
        "AGC 2019 Reference, twelve weeks, each predicted by a model of the weeks before it: mean absolute error with "
        "a 90 % interval over days.",
        "none",
        long=True,
    ),
    "real-later": Result(
        "The same compartment, fitted once",
        ("benchmarks.real_greenhouses", "../shared/data/agc2019", "Reference", "--tables", "later"),
        "Weeks 1 to 12 fit, 13 to 15 select, 16 to 20 (April) test.",
        "none",
        long=True,
    ),
    "real-across": Result(
        "Compartments by a model of the others",
        ("benchmarks.real_greenhouses", "../shared/data/agc2018", "--tables", "across", "--every", "18900"),
        "AGC 2018, each compartment by a model that was fitted on three others, by it and the first 7 days of its own, "
        "and by these alone.",
        "none",
        long=True,
    ),
    "diagnosis-real": Result(
        "Real logs",
        ("benchmarks.diagnosis", "real", "../shared/data"),
        "Calibrated on eight weeks, diagnosed on the four that follow; columns withheld, a placebo.",
        "none",
        long=True,
    ),
    "diagnosis-real-withheld": Result(
        "Columns withheld from real logs, four weeks later",
        ("benchmarks.diagnosis", "real", "../shared/data", "--withheld-only", "--beginning", "42"),
        "Calibrated on eight weeks, asked of the next two to four; how they are told was chosen by earlier weeks.",
        "none",
        long=True,
    ),
    "diagnosis-real-faults": Result(
        "Faults in real logs",
        ("benchmarks.diagnosis", "real-faults", "../shared/data"),
        "The same compartments four weeks later, with a sensor that is off, or something else that the log has wrong.",
        "none",
        long=True,
    ),
}


def page(result: Result, output: str, seconds: float) -> str:
    """Return the page of a result."""
    made = provenance(" ".join(("python -m", *(shlex.quote(part) for part in result.command))))
    figures = "".join(f"![{result.title}]({Path(part).name})\n\n" for part in result.command if part.endswith(".svg"))
    return (
        f"# {result.title}\n\n{result.about}\n\n"
        f"| command | date | commit | seeds | took |\n|---|---|---|---|---|\n"
        f"| `{made['command']}` | {made['date']} | {made['commit']} | {result.seeds} | {seconds / 60.0:.0f} min |\n\n"
        f"{figures}```\n{output.rstrip()}\n```\n"
    )


def index(names: list[str]) -> str:
    """Return the page that lists all results, and how those that are not there are made."""
    lines = [
        "# Results",
        "",
        "Written by `make results`, each by the command that it names; nothing here is typed.",
        "",
    ]
    for name, result in RESULTS.items():
        there = f"[{result.title}]({name}.md)" if name in names else f"{result.title}: not made here yet"
        lines.append(f"* {there}: {result.about} (`python -m benchmarks.results {name}`)")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run what was asked for; returns 1 if a command failed, whose page then stays as it was."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(RESULTS)}")
    parser.add_argument("--long", action="store_true", help="run the long ones too")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in RESULTS]
    if unknown:
        parser.error(f"no result is called {', '.join(unknown)}; there are {', '.join(RESULTS)}")
    wanted = options.names or [name for name, result in RESULTS.items() if options.long or not result.long]
    FOLDER.mkdir(parents=True, exist_ok=True)
    failed = False
    for name in wanted:
        result = RESULTS[name]
        print(f"{name}: python -m {' '.join(result.command)}", file=sys.stderr, flush=True)
        begun = time.monotonic()
        run = subprocess.run(
            [sys.executable, "-m", *result.command], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False
        )
        if run.returncode != 0:
            print(f"{name}: failed with {run.returncode}; its page stays as it was", file=sys.stderr)
            failed = True
            continue
        (FOLDER / f"{name}.md").write_text(page(result, run.stdout, time.monotonic() - begun), encoding="utf-8")
    made = [path.stem for path in Path(FOLDER).glob("*.md")]
    (FOLDER / "README.md").write_text(index(made), encoding="utf-8")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
