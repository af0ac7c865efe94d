"""`igrow-trainer diagnose`: find what the simulator lacks, and why; write the report and the corrected bundle."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.greenhouse import HiddenEffect
from igrow.core.greenhouse.described import parse_effect
from igrow.core.language import LANGUAGES
from igrow.trainer.cli.common import replace_bundle
from igrow.trainer.cli.log_arguments import add_log_arguments, log_of, typed
from igrow.trainer.cli.progress import progress
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.diagnosis.answer.evidence import errors_with
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.exporting import read_model
from igrow.trainer.report import write_diagnosis

EXAMPLE = "igrow-trainer diagnose logs/ --bundle bundle/ --site site.yaml --out diagnosis/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_log_arguments(parser)
    parser.add_argument("--bundle", type=Path, help="the bundle in force (default: the built-in one)")
    parser.add_argument("--out", type=Path, required=True, help="folder for diagnosis.json, report.html and the bundle")
    parser.add_argument("--without", action="append", default=[], metavar="EFFECT", help="an effect not to consider")
    parser.add_argument(
        "--truth",
        action="append",
        default=[],
        metavar="NAME[=SIZE][@START]",
        help="of a virtual greenhouse: what is hidden in it; the errors with that known go to truth.json",
    )
    parser.add_argument("--seed", type=int, default=0, help="of random flips and bootstraps")
    parser.add_argument("--language", choices=LANGUAGES, default=LANGUAGES[0], help="of the report (default: en)")


def run(arguments: argparse.Namespace) -> int:
    """Diagnose; returns 0 nothing, 10 named, 11 ambiguous, 12 unexplained, 13 data fault.

    Raises:
        IgrowError: a file cannot be read or the log cannot be diagnosed.
    """
    truth = [parse_effect(text) for text in arguments.truth]
    bundle = read_bundle(arguments.bundle or default_bundle_folder())
    log = log_of(arguments)
    model = read_model(bundle, log.known_site)
    with progress("diagnosing") as say:
        result = diagnose(log, model, without=arguments.without, seed=arguments.seed, progress=say)
        say("writing the report")
        write_diagnosis(arguments.out, result, arguments.language, typed(arguments))
        if result.findings:
            say("writing the corrected bundle")
            replace_bundle(arguments.out / "bundle", result.corrected)
    if truth and result.evidence is not None:
        errors = errors_with(result.evidence, [known_term(one) for one in truth])
        (arguments.out / "truth.json").write_text(json.dumps({"errors_24_h": errors}), encoding="utf-8")
    print(result.summary(typed(arguments)))
    print(f"written to {arguments.out}", file=sys.stderr)
    return result.exit_code


def known_term(hidden: HiddenEffect) -> ActiveTerm:
    """Return what is hidden in a virtual greenhouse as a term of the model, in the catalogue's form."""
    effect = hidden.definition
    size = effect.amplitude.typical if hidden.size is None else hidden.size
    return ActiveTerm(hidden.name, size, {one.name: one.typical for one in effect.shapes}, hidden.start)
