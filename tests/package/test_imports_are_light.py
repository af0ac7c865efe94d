"""What an import loads: nothing that takes seconds before it is used."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

HEAVY = {"torch", "matplotlib", "pandas", "scipy", "onnx", "onnxruntime", "pyarrow", "ndonnx", "sklearn", "ray"}


def loaded_by(code: str) -> list[str]:
    """Return the modules that a fresh interpreter has after some code, of which it had none before."""
    program = f"import json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True)
    return list(json.loads(told.stdout))


HELP = """from igrow.trainer.cli import main
try:
    main(["--help"])
except SystemExit:
    pass"""


@pytest.mark.parametrize(
    ("code", "most"),
    [("import igrow.trainer", 250), ("from igrow.trainer import read_log, __version__", 600), (HELP, 400)],
)
def test_an_import_loads_nothing_heavy(code: str, most: int) -> None:
    quiet = f"import contextlib, io\nwith contextlib.redirect_stdout(io.StringIO()):\n    exec({code!r})"
    found = loaded_by(quiet)
    assert HEAVY & {name.split(".")[0] for name in found} == set()
    assert len(found) < most


@pytest.mark.parametrize("command", ["generate", "export", "diagnose", "collect", "publish", "evaluate"])
def test_only_commands_that_train_load_torch(command: str) -> None:
    assert "torch" not in loaded_by(f"import igrow.trainer.cli.{command}")


def test_the_process_that_sends_a_message_fits_into_its_little_memory() -> None:
    found = loaded_by("import igrow.edge.notifications.sending")
    assert (HEAVY | {"numpy"}) & {name.split(".")[0] for name in found} == set()


def test_a_command_of_the_gateway_does_not_load_what_fetches_bundles() -> None:
    found = loaded_by("import igrow.edge.cli.run")
    assert (HEAVY | {"tuf", "securesystemslib"}) & {name.split(".")[0] for name in found} == set()


def test_the_interface_of_a_notebook_is_whole() -> None:
    import igrow.trainer

    for name in igrow.trainer.__all__:
        assert getattr(igrow.trainer, name) is not None
    assert {"read_log", "calibrate", "compare", "diagnose", "export", "publish", "__version__"} <= set(
        dir(igrow.trainer)
    )


def test_what_a_notebook_shows_fits_on_a_line() -> None:
    from igrow.core.bundle import default_bundle_folder, read_bundle
    from igrow.trainer import FittedModel, prepare_log
    from tests.virtual_log import SITE, virtual_log

    table = virtual_log(2, seed=1, step=900.0)
    model = FittedModel.described(SITE)
    for shown in (read_bundle(default_bundle_folder()), table.only(["air_temperature"]), SITE, model, model.posterior):
        assert repr(shown).startswith(f"{type(shown).__name__}(")
        assert len(repr(shown)) < 200
    assert len(repr(prepare_log(table, SITE))) < 120
