"""What an installation brings: one package, both commands, the data files, and nothing with a stranger's name."""

from __future__ import annotations

import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel as an installation does, with the build backend that is here."""
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    # A copy, since the backend leaves a build folder beside the sources.
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    archive = subprocess.run(
        ["tar", "--create", "--null", "--files-from=-"], cwd=ROOT, input=tracked, capture_output=True, check=True
    )
    subprocess.run(["tar", "--extract"], cwd=source, input=archive.stdout, check=True)
    code = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(folder)], cwd=source, capture_output=True, check=True)
    (found,) = folder.glob("*.whl")
    return found


def test_a_wheel_brings_one_package_and_its_data(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"igrow"}
    for needed in ("core/default_bundle/simulator.onnx", "edge/cli/run.py", "trainer/cli/diagnose.py"):
        assert f"igrow/{needed}" in names
    sources = {
        f"igrow/{room}/{path.relative_to(ROOT / folder)}"
        for room, folder in (("core", "igrow_core"), ("edge", "edge"), ("trainer", "trainer"))
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert sources <= set(names), f"missing from the wheel: {sorted(sources - set(names))}"


def test_a_wheel_installs_into_an_empty_environment(wheel: Path, tmp_path: Path) -> None:
    venv.create(tmp_path, with_pip=True, symlinks=True)
    python = tmp_path / "bin" / "python"
    install = [str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    told = subprocess.run(
        [str(python), "-c", "import igrow; print(igrow.__version__)"], cwd=tmp_path, capture_output=True, check=True
    )
    assert told.stdout.decode().strip() == wheel.name.split("-")[1]
    for command in ("igrow-edge", "igrow-trainer"):
        helped = subprocess.run([str(tmp_path / "bin" / command), "--help"], capture_output=True, check=False)
        assert helped.returncode == 0, helped.stderr.decode()
        assert b"COMMAND" in helped.stdout


def test_the_built_in_bundle_is_found_in_an_installation(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    # The dependencies are this environment's; igrow itself is the wheel's.
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from igrow.core.bundle import default_bundle_folder, read_bundle\n"
        "print(read_bundle(default_bundle_folder()).folder)"
    )
    told = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], cwd=tmp_path, capture_output=True, check=False, text=True
    )
    assert told.returncode == 0, told.stderr
    assert Path(told.stdout.strip()).is_relative_to(tmp_path)
