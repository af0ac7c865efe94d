"""The command line `igrow-trainer COMMAND`; `igrow_core/command_line.py` says what makes a module a command."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.command_line import run_command

COMMANDS = {
    "generate": ("igrow.trainer.cli.generate", "simulate a greenhouse and write its log"),
    "import": ("igrow.trainer.cli.import_", "find out how a greenhouse computer's export is to be read"),
    "train": ("igrow.trainer.cli.train", "train the growth and yield stages on logs"),
    "calibrate": ("igrow.trainer.cli.calibrate", "fit the simulator to a log; print the errors before and after"),
    "diagnose": ("igrow.trainer.cli.diagnose", "find what the simulator lacks, and why; write the corrected bundle"),
    "collect": ("igrow.trainer.cli.collect", "bring what gateways left in the exchange into the archive"),
    "recalibrate": ("igrow.trainer.cli.recalibrate", "diagnose every site of an exchange and publish what passed"),
    "export": ("igrow.trainer.cli.export", "write a bundle from a fitted simulator"),
    "season": ("igrow.trainer.cli.season", "plan a whole season; write the bundle that carries what the crop is worth"),
    "policy": ("igrow.trainer.research.policies.train", "train a policy by soft actor-critic"),
    "publish": ("igrow.trainer.cli.publish", "sign a bundle and put it into the exchange"),
    "reproduce": ("igrow.trainer.research.paper.command", "reproduce the tables and figures of the iGrow paper"),
    "evaluate": ("igrow.trainer.cli.evaluate", "score a bundle on a log that it has not seen, beside persistence"),
    "fleet": ("igrow.trainer.cli.fleet", "collect, diagnose and publish for many sites; one page for all of them"),
    "keys": ("igrow.trainer.cli.keys", "make, keep and replace the signing keys"),
    "bundle": ("igrow.trainer.cli.bundle", "build the default bundle from the mechanistic greenhouse"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    description = "Learn the simulator of a greenhouse from its log, find what it lacks, and publish the better one."
    return run_command("igrow-trainer", description, COMMANDS, arguments)
