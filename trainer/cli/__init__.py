"""The trainer's command line: `igrow-trainer COMMAND`, one module a command.

A command's module has `add_arguments(parser)`, `run(arguments) -> exit code` and an `EXAMPLE`. It is imported
only when it is called, so that `--help` does not wait for torch.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from igrow_core.errors import IgrowError

COMMANDS = {
    "generate": ("trainer.cli.generate", "simulate a greenhouse and write its log"),
    "train": ("trainer.cli.train", "train the growth and yield stages on logs"),
    "calibrate": ("trainer.cli.calibrate", "fit the simulator to a log; print the errors before and after"),
    "diagnose": ("trainer.diagnosis.command", "find what the simulator lacks, and why; write the corrected bundle"),
    "recalibrate": ("trainer.diagnosis.loop", "diagnose every site of an exchange and publish what passed"),
    "export": ("trainer.cli.export", "write a bundle from a fitted simulator"),
    "policy": ("trainer.policies.train", "train a policy by soft actor-critic"),
    "publish": ("trainer.cli.publish", "sign a bundle and put it into the exchange"),
    "reproduce": ("trainer.reproduce.command", "reproduce the tables and figures of the iGrow paper"),
    "evaluate": ("trainer.reproduce.evaluate", "run a bundle on logged or virtual seasons and print its errors"),
    "bundle": ("trainer.cli.bundle", "build the default bundle from the mechanistic greenhouse"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code, 2 for a user's mistake."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(
        prog="igrow-trainer",
        description="Learn the simulator of a greenhouse from its log, find what it lacks, and publish the better one.",
        epilog="igrow-trainer COMMAND --help explains a command, with an example.",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    wanted = next((word for word in given if not word.startswith("-")), None)
    for name, (module_name, summary) in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name == wanted:
            module = importlib.import_module(module_name)
            module.add_arguments(command)
            command.epilog = f"example:\n  {module.EXAMPLE}"
            command.set_defaults(run=module.run)
    options = parser.parse_args(given)
    try:
        return int(options.run(options))
    except IgrowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Whoever read our output has gone (`igrow-trainer ... | head`).
        sys.stderr.close()
        return 0
