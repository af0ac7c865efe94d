"""What both command lines do alike: quick help, one-line errors, exit codes."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import types

import pytest

import igrow.edge.cli
import igrow.trainer.cli
from igrow.core.command_line import run_command
from igrow.core.errors import IgrowError


def end_with(monkeypatch, error: BaseException) -> int:
    def run(options) -> int:
        raise error

    module = types.ModuleType("failing_command")
    module.__dict__.update(add_arguments=lambda parser: None, run=run, EXAMPLE="program fail")
    monkeypatch.setitem(sys.modules, "failing_command", module)
    return run_command("program", "Fails.", {"fail": ("failing_command", "fail")}, ["fail"])


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (IgrowError("no such site"), 2, "error: no such site\n"),
        (PermissionError(13, "Permission denied", "log.csv"), 2, "error: log.csv: Permission denied\n"),
        (OSError("no space"), 2, "error: no space\n"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_what_ends_a_command_is_one_line_and_an_exit_code(monkeypatch, capsys, error, code, told):
    assert end_with(monkeypatch, error) == code
    assert capsys.readouterr() == ("", told)


def test_a_fault_of_ours_is_not_hidden(monkeypatch):
    with pytest.raises(ZeroDivisionError):
        end_with(monkeypatch, ZeroDivisionError())


def test_an_unreadable_file_at_the_trainer_is_one_line_and_exit_code_2(tmp_path, capsys):
    keys = tmp_path / "keys"
    keys.write_text("a file where a folder is needed")
    code = igrow.trainer.cli.main(["keys", "create", str(keys)])
    printed = capsys.readouterr()
    assert (code, printed.out) == (2, "")
    assert printed.err.count("\n") == 1
    assert printed.err.startswith(f"error: {keys}")


def test_a_reader_who_has_enough_ends_a_command_quietly():
    talkative = (
        "import sys, types; from igrow.core.command_line import run_command\n"
        "def talk(options):\n    while True: print('a line')\n"
        "module = types.ModuleType('talk'); module.EXAMPLE = 'program talk'; module.run = talk\n"
        "module.add_arguments = lambda parser: None; sys.modules['talk'] = module\n"
        "sys.exit(run_command('program', 'Talks.', {'talk': ('talk', 'talk')}, ['talk']))"
    )
    process = subprocess.Popen([sys.executable, "-c", talkative], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    assert process.wait() == 0


@pytest.mark.parametrize("side", [igrow.edge.cli, igrow.trainer.cli])
def test_every_module_of_the_tables_is_there(side):
    for module, _ in side.COMMANDS.values():
        assert importlib.util.find_spec(module) is not None


@pytest.mark.parametrize(("side", "heavy"), [("edge", "pymodbus"), ("edge", "onnxruntime"), ("trainer", "torch")])
def test_help_waits_for_no_command(side, heavy):
    code = (
        f"import sys; from igrow.{side}.cli import main\n"
        "try: main(['--help'])\n"
        f"except SystemExit: sys.exit({heavy!r} in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "commands:" in done.stdout
