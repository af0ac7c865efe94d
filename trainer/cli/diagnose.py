"""`igrow-trainer diagnose`: find what the simulator lacks, and why; write the report and the corrected bundle."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from datetime import UTC, datetime
from pathlib import Path

from igrow.core.bundle import Bundle, default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.cli.log_arguments import add_log_arguments, log_of
from igrow.trainer.diagnosis.correction import corrected_model
from igrow.trainer.diagnosis.deployed import Deployed, from_manifest
from igrow.trainer.diagnosis.diagnose import Evidence, diagnose
from igrow.trainer.diagnosis.result import Diagnosis
from igrow.trainer.export.bundle import write_hybrid_bundle

EXAMPLE = "igrow-trainer diagnose logs/ --bundle bundle/ --site site.yaml --out diagnosis/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_log_arguments(parser)
    parser.add_argument("--bundle", type=Path, help="the bundle in force (default: the built-in one)")
    parser.add_argument("--out", type=Path, required=True, help="folder for diagnosis.json, report.html and the bundle")
    parser.add_argument("--without", action="append", default=[], metavar="EFFECT", help="an effect not to consider")
    parser.add_argument("--seed", type=int, default=0, help="of random flips and bootstraps")


def run(arguments: argparse.Namespace) -> int:
    """Diagnose; returns 0 nothing, 10 named, 11 ambiguous, 12 unexplained, 13 data fault.

    Raises:
        IgrowError: a file cannot be read or the log cannot be diagnosed.
    """
    log = log_of(arguments)
    site = log.known_site
    bundle = read_bundle(arguments.bundle or default_bundle_folder())
    deployed = from_manifest(bundle.manifest, site)
    diagnosis, evidence = diagnose(log, site, deployed, without=arguments.without, seed=arguments.seed)
    write(arguments.out, diagnosis, evidence, deployed)
    if evidence is not None and diagnosis.findings:
        write_corrected(arguments.out / "bundle", bundle, site, diagnosis, evidence)
    print(summary(diagnosis))
    print(f"written to {arguments.out}", file=sys.stderr)
    return diagnosis.exit_code


def write(folder: Path, diagnosis: Diagnosis, evidence: Evidence | None, deployed: Deployed) -> None:
    """Write diagnosis.json and report.html into a folder."""
    from igrow.trainer.report.page import write_report  # noqa: PLC0415  (matplotlib is slow to import)

    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(diagnosis.to_json(), indent=2, allow_nan=False) + "\n"
        (folder / "diagnosis.json").write_text(text, encoding="utf-8")
        write_report(folder / "report.html", diagnosis, evidence, deployed)
    except OSError as error:
        raise IgrowError(f"{folder}: cannot be written: {error.strerror}") from None


def write_corrected(folder: Path, bundle: Bundle, site: Site, diagnosis: Diagnosis, evidence: Evidence) -> None:
    """Write the corrected simulator as a bundle ready to publish, in the place of an earlier one."""
    fresh = folder.with_name(f"{folder.name}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    write_hybrid_bundle(fresh, corrected_model(bundle, site, diagnosis, evidence), created=datetime.now(UTC))
    shutil.rmtree(folder, ignore_errors=True)
    fresh.rename(folder)


def summary(diagnosis: Diagnosis) -> str:
    """Return the verdict in a few lines for people."""
    lines = [f"{diagnosis.site}: {diagnosis.verdict}"]
    lines += [f"  {one.sentence}" for one in diagnosis.findings]
    lines += [f"  rivals that fit as well: {', '.join(one.rivals[1:])}" for one in diagnosis.findings if one.rivals[1:]]
    if diagnosis.unknown:
        lines.append(f"  the log lacks {', '.join(diagnosis.unknown)}: usual values stand in")
    lines += [f"  {note}" for note in diagnosis.notes]
    for quantity, horizons in diagnosis.errors.items():
        day = horizons.get("24_h")
        if day:
            stages = ", ".join(f"{stage} {value:.3g}" for stage, value in day.items())
            lines.append(f"  {quantity}, 24 h ahead on unseen days: {stages}")
    return "\n".join(lines)
