"""The gateway's command line: `igrow-edge COMMAND`, one module a command.

A command's module has `add_arguments(parser)`, `run(arguments) -> exit code` and an `EXAMPLE`. It is imported only
when it is called, so that `--help` is quick on a small gateway.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from igrow_core.errors import IgrowError

COMMANDS = {
    "run": ("edge.cli.run", "control the greenhouse until told to stop"),
    "check-config": ("edge.cli.check_config", "check the configuration and say what it means"),
    "probe": ("edge.cli.probe", "show what a Modbus device answers, raw and decoded in every way"),
    "simulate-plc": ("edge.cli.simulate_plc", "serve a simulated greenhouse over Modbus"),
    "status": ("edge.cli.status", "show what the daemon does, and why"),
    "plan": ("edge.cli.plan", "compute one plan now, from the bundle in force and the log, and print it"),
    "override": ("edge.cli.override", "set a setpoint by hand for some time, or give it back"),
    "commission": ("edge.cli.commission", "walk through the checks with a new PLC"),
    "backup": ("edge.cli.backup", "copy the daemon's log and ledger into one file, also while it runs"),
    "restore": ("edge.cli.restore", "put a backup in the place of the log and ledger"),
    "export": ("edge.cli.export", "write log and ledger as CSV files"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code, 2 for a user's mistake."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(
        prog="igrow-edge",
        description="Run a greenhouse through the Modbus registers of its PLC.",
        epilog="igrow-edge COMMAND --help explains a command, with an example.",
    )
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
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
    except BrokenPipeError:
        # Whoever read our output (`head`, a pager) has enough; the interpreter's last flush must not complain either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"error: {place}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
