"""`igrow-edge password`: sets the password of the grower's page."""

from __future__ import annotations

import argparse
import getpass
import sys

from igrow.core.errors import IgrowError
from igrow.edge.cli.common import add_configuration, configuration_of
from igrow.edge.page.password import hashed, remove_password, write_password

EXAMPLE = "igrow-edge password /etc/igrow/daemon.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_configuration(parser)
    parser.add_argument("--remove", action="store_true", help="remove it: the page then only shows")


def run(options: argparse.Namespace) -> int:
    """Ask twice at a terminal, else read one line; only a hash is kept. Who was signed in has to sign in again."""
    folder = configuration_of(options).state_folder
    if options.remove:
        print("the page only shows now" if remove_password(folder) else "there was no password")
        return 0
    if sys.stdin.isatty():
        word = getpass.getpass("New password of the page: ")
        if getpass.getpass("Once more: ") != word:
            raise IgrowError("the two are not the same; nothing was changed")
    else:
        word = sys.stdin.readline().rstrip("\r\n")
    write_password(folder, hashed(word))
    print("the page has a new password")
    return 0
