"""`igrow-trainer calibrate`: fit the simulator's parameters to a log, and print the errors on weeks it has not seen."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from igrow_core.bundle import HeldOutError, Span, read_bundle
from igrow_core.errors import IgrowError
from igrow_core.quantities import QUANTITIES
from igrow_core.simulator.hybrid.nominal import site_record
from igrow_core.site import Site, load_site
from trainer.calibration.evaluation import evaluate
from trainer.calibration.fit import calibrate
from trainer.calibration.split import alternate_weeks, split_weeks
from trainer.default_bundle import default_bundle_folder
from trainer.export.bundle import read_hybrid_model, write_hybrid_bundle
from trainer.model import known_range
from trainer.readers.open_log import open_log

EXAMPLE = "igrow-trainer calibrate ../shared/data/agc2019 --compartment Reference --out out/reference"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("log", type=Path, nargs="+", help="telemetry files, or the folder of a data set or exchange")
    parser.add_argument("--compartment", help="its name, where a data set has several")
    parser.add_argument("--site", type=Path, help="site file; a known data set brings its own")
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
    log = open_log(arguments.log[0] if len(arguments.log) == 1 else arguments.log, arguments.compartment)
    site = _site(arguments.site, log.site)
    for note in log.notes:
        print(f"note: {note}")
    model = read_hybrid_model(read_bundle(arguments.bundle or default_bundle_folder()), site)
    record = site_record(log.telemetry, site, max(300.0, log.telemetry.step))
    if record.unknown:
        print(f"the log lacks {', '.join(record.unknown)}: what hangs on them keeps its usual value")
    weeks = arguments.fit_weeks
    split = split_weeks(record.time, weeks, 0) if weeks else alternate_weeks(record.time)
    used = ~split.held_out
    if not split.held_out.any():
        raise IgrowError("the log is too short to hold a week back for the test: four weeks are needed")
    posterior = calibrate([(record, used)], model.posterior, {}, progress=lambda line: print(line, flush=True))
    before = evaluate(record, model.posterior, {}, ("1_h", "24_h"), split.held_out)
    after = evaluate(record, posterior, {}, ("1_h", "24_h"), split.held_out)
    errors = []
    print(f"\nmean absolute error on {int(split.held_out.sum() * record.step / 86_400)} held-out days")
    print(f"{'quantity':18}{'horizon':>8}{'persistence':>13}{'before':>10}{'after':>10}   90 % interval")
    for quantity, horizons in after.items():
        for horizon, summary in horizons.items():
            unit = QUANTITIES[quantity].unit
            old = before[quantity][horizon].mae
            print(
                f"{quantity:18}{horizon:>8}{summary.persistence:13.3f}{old:10.3f}{summary.mae:10.3f}   "
                f"{summary.mae_low:.3f} to {summary.mae_high:.3f} {unit}"
            )
            errors.append(HeldOutError(quantity, horizon, float(old), float(summary.mae), unit))
    span = Span(_utc(record.time[0]), _utc(record.time[-1]))
    fitted = model.corrected(posterior, ()).trained(span, known_range(log.telemetry.columns), tuple(errors))
    bundle = write_hybrid_bundle(arguments.out, fitted, created=datetime.now(UTC))
    print(f"wrote {bundle.folder} ({bundle.label})")
    return 0


def _site(path: Path | None, known: Site | None) -> Site:
    if path is not None:
        return load_site(path)
    if known is None:
        raise IgrowError("this log does not tell its greenhouse: give the site file with --site")
    return known


def _utc(time: np.datetime64) -> datetime:
    return datetime.fromisoformat(str(time.astype("datetime64[s]"))).replace(tzinfo=UTC)
