"""A command line of several commands, one module each: how one is found, called, and what its end means.

A command's module has `add_arguments(parser)`, `run(arguments) -> exit code` and an `EXAMPLE`. It is imported only when
it is called, so that `--help` is quick on a small gateway and does not wait for torch at the trainer.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Mapping, Sequence

from igrow import __version__
from igrow.core.errors import IgrowError


def run_command(
    program: str, description: str, commands: Mapping[str, tuple[str, str]], arguments: Sequence[str] | None = None
) -> int:
    """Run one command; returns its exit code, 2 for a user's mistake or a file that fails, 130 when interrupted.

    Args:
        program: the name that the user calls it by.
        description: one sentence.
        commands: name -> (module, summary).
        arguments: what follows the program's name; None takes the process's own.
    """
    _open_standard_files()
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parse(program, description, commands, given)
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


def _open_standard_files() -> None:
    """Open what whoever started us has closed: the first file or socket would get its number, and our words with it."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


def _parse(
    program: str, description: str, commands: Mapping[str, tuple[str, str]], given: Sequence[str]
) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog=program,
        description=description,
        epilog=f"{program} COMMAND --help explains a command, with an example.",
    )
    parser.add_argument("--version", action="version", version=f"{program} {__version__}")
    parsers = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
    wanted = next((word for word in given if not word.startswith("-")), None)
    for name, (module_name, summary) in commands.items():
        command = parsers.add_parser(
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
    return parser.parse_args(given)
