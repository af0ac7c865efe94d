"""The command line `igrow-edge COMMAND`; `igrow_core/command_line.py` says what makes a module a command."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.core.command_line import run_command

COMMANDS = {
    "run": ("igrow.edge.cli.run", "control the greenhouse until told to stop"),
    "check-config": ("igrow.edge.cli.check_config", "check the configuration and say what it means"),
    "probe": ("igrow.edge.cli.probe", "show what a Modbus device answers, raw and decoded in every way"),
    "simulate-plc": ("igrow.edge.cli.simulate_plc", "serve a simulated greenhouse over Modbus"),
    "status": ("igrow.edge.cli.status", "show what the daemon does, and why"),
    "page": ("igrow.edge.cli.page", "serve the grower's page"),
    "password": ("igrow.edge.cli.password", "set the password of the page, so that one can act from there"),
    "plan": ("igrow.edge.cli.plan", "compute one plan now, from the bundle in force and the log, and print it"),
    "forecast": ("igrow.edge.cli.forecast", "fetch the weather forecast that plans read"),
    "override": ("igrow.edge.cli.override", "set a setpoint by hand for some time, or give it back"),
    "separating-test": (
        "igrow.edge.cli.separating_test",
        "list the tests that tell causes apart, approve one, or withdraw it",
    ),
    "alarms": ("igrow.edge.cli.alarms", "list the alarms, or say that you know of them"),
    "notify": ("igrow.edge.cli.notify", "tell people of alarms, by e-mail, ntfy or a web hook"),
    "mqtt": ("igrow.edge.cli.mqtt", "publish the daemon's state to an MQTT broker"),
    "model": ("igrow.edge.cli.model", "show the bundles of this gateway, and at which step each is"),
    "exchange": (
        "igrow.edge.cli.exchange",
        "show what waits for the trainer; make a round now, such as to a USB stick",
    ),
    "commission": ("igrow.edge.cli.commission", "walk through the checks with a new PLC"),
    "backup": (
        "igrow.edge.cli.backup",
        "copy log, configuration and bundles into one file, also while it runs",
    ),
    "restore": ("igrow.edge.cli.restore", "put a backup in place, on this gateway or on a new one"),
    "export": ("igrow.edge.cli.export", "write log and ledger as CSV files"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    description = "Run a greenhouse through the Modbus registers of its PLC."
    return run_command("igrow-edge", description, COMMANDS, arguments)
