"""The command line `igrow-trainer COMMAND`; `igrow_core/command_line.py` says what makes a module a command."""

from __future__ import annotations

from collections.abc import Sequence

from igrow_core.command_line import run_command

COMMANDS = {
    "generate": ("trainer.cli.generate", "simulate a greenhouse and write its log"),
    "train": ("trainer.cli.train", "train the growth and yield stages on logs"),
    "calibrate": ("trainer.cli.calibrate", "fit the simulator to a log; print the errors before and after"),
    "diagnose": ("trainer.cli.diagnose", "find what the simulator lacks, and why; write the corrected bundle"),
    "recalibrate": ("trainer.cli.recalibrate", "diagnose every site of an exchange and publish what passed"),
    "export": ("trainer.cli.export", "write a bundle from a fitted simulator"),
    "policy": ("trainer.policies.train", "train a policy by soft actor-critic"),
    "publish": ("trainer.cli.publish", "sign a bundle and put it into the exchange"),
    "reproduce": ("trainer.reproduce.command", "reproduce the tables and figures of the iGrow paper"),
    "evaluate": ("trainer.reproduce.evaluate", "run a bundle on logged or virtual seasons and print its errors"),
    "bundle": ("trainer.cli.bundle", "build the default bundle from the mechanistic greenhouse"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    description = "Learn the simulator of a greenhouse from its log, find what it lacks, and publish the better one."
    return run_command("igrow-trainer", description, COMMANDS, arguments)
