"""`igrow-trainer calibrate`: fit the simulator's parameters to a log, and print the errors on weeks it has not seen."""

from __future__ import annotations

import argparse
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from igrow.core.bundle import HeldOutError, Span, default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.local_time import utc_datetime
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid.nominal import nominal, site_record
from igrow.trainer.calibration.actuation import setpoint_columns
from igrow.trainer.calibration.evaluation import errors_of, evaluate, summarise
from igrow.trainer.calibration.holding import fit_holding
from igrow.trainer.calibration.posterior import prior
from igrow.trainer.calibration.site_model import fit_site
from igrow.trainer.cli.log_arguments import add_log_arguments, log_of
from igrow.trainer.data.splits import alternate_weeks, split_weeks
from igrow.trainer.diagnosis.deployed import learn_misfit
from igrow.trainer.export.bundle import read_hybrid_model, write_hybrid_bundle
from igrow.trainer.model import known_range

EXAMPLE = "igrow-trainer calibrate DATA/agc2019 --compartment Reference --out out/reference"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    add_log_arguments(parser)
    parser.add_argument(
        "--bundle", type=Path, help="bundle whose parameters are known before (default: the built-in one)"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the new bundle; must not exist yet")
    parser.add_argument(
        "--fit-weeks", type=int, help="fit on the first weeks, test on all later ones; else every 4th tests"
    )


def run(arguments: argparse.Namespace) -> int:
    """Fit, test, write the bundle."""
    if arguments.out.exists():
        raise IgrowError(f"{arguments.out} exists already; name a new folder")
    log = log_of(arguments)
    log.require("a calibration")
    site = log.known_site
    model = read_hybrid_model(read_bundle(arguments.bundle or default_bundle_folder()), site)
    # What the built-in bundle knows is a virtual greenhouse; a real one begins with the site's description.
    knowledge = model.posterior if arguments.bundle else prior(nominal(site))
    record = site_record(log.telemetry, site, max(300.0, log.telemetry.step))
    if record.unknown:
        print(f"the log lacks {', '.join(record.unknown)}: what hangs on them keeps its usual value")
    setpoints, inferred = setpoint_columns(log.telemetry, record)
    if inferred:
        print(f"the log lacks {', '.join(inferred)}: inferred from what was held")
    weeks = arguments.fit_weeks
    split = split_weeks(record.time, weeks - 1, 1) if weeks else alternate_weeks(record.time)
    if not split.held_out.any():
        raise IgrowError("the log is too short to hold a week back for the test: four weeks are needed")
    fitted = fit_site(
        [(record, setpoints, split.fit, split.selection)],
        knowledge,
        {},
        progress=lambda line: print(line, flush=True),
    )
    horizons = ("1_h", "24_h")
    before = evaluate(record, knowledge, {}, horizons, split.held_out)
    alone = evaluate(record, fitted.posterior, {}, horizons, split.held_out)
    after = summarise([errors_of(record, fitted.predictor(record), horizons, split.held_out)])
    errors = []
    print(f"\nmean absolute error on {int(split.held_out.sum() * record.step / 86_400)} held-out days")
    print("before: the prior; calibrated: its parameters fitted; observed: also with the disturbance seen so far")
    columns = ("persistence", "before", "calibrated", "observed")
    print(f"{'quantity':18}{'horizon':>8}" + "".join(f"{name:>12}" for name in columns) + "   90 % interval")
    for quantity, by_horizon in after.items():
        for horizon, summary in by_horizon.items():
            unit = QUANTITIES[quantity].unit
            old, plain = before[quantity][horizon].mae, alone[quantity][horizon].mae
            print(
                f"{quantity:18}{horizon:>8}{summary.persistence:12.3f}{old:12.3f}{plain:12.3f}{summary.mae:12.3f}   "
                f"{summary.mae_low:.3f} to {summary.mae_high:.3f} {unit}"
            )
            errors.append(HeldOutError(quantity, horizon, float(old), float(plain), unit))
    held = fit_holding(record, setpoints, fitted.posterior.values, model.holding)
    span = Span(utc_datetime(record.time[0]), utc_datetime(record.time[-1]))
    known = known_range({**record.measured, **record.inputs, **setpoints})
    corrected = model.corrected(fitted.posterior, ()).trained(span, known, tuple(errors)).controlled(fitted.rules, held)
    deviation = dict(zip(fitted.posterior.names, map(float, fitted.posterior.standard_deviation), strict=True))
    misfit = learn_misfit(record, fitted.posterior.values, deviation, site.longitude)
    corrected = replace(corrected, calibrated_on=site.name, known_misfit=misfit)
    bundle = write_hybrid_bundle(arguments.out, corrected, created=datetime.now(UTC))
    print(f"wrote {bundle.folder} ({bundle.label})")
    return 0
