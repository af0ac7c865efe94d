"""`igrow-edge forecast`: fetch the weather forecast that plans read, once; a timer does it every hour."""

from __future__ import annotations

import argparse

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.planning.fetch import address, fetch

EXAMPLE = "igrow-edge forecast /etc/igrow/daemon.yaml --ensemble"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--ensemble", action="store_true", help="an ensemble, against whose spread plans hold")
    parser.add_argument("--server", help="address of another server that speaks Open-Meteo's language")


def run(options: argparse.Namespace) -> int:
    """Fetch and tell."""
    configuration = configuration_of(options)
    path = configuration.forecast_file
    if path is None or path.suffix.lower() != ".json":
        raise IgrowError(f"{configuration.path}: planning.forecast must name a .json file for the forecast to go to")
    members = fetch(address(configuration.site, options.server, options.ensemble), path)
    print(f"{path}: a forecast of {members} member{'s' * (members > 1)}")
    return 0
