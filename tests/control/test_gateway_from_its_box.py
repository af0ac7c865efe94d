"""A gateway that was just installed: it plans, tells its version, proves its bundle, and moves to another machine."""

from __future__ import annotations

import tarfile

import pytest

import igrow
from igrow.core.bundle import default_bundle_folder
from igrow.edge.backup import BackupError, back_up, put_back
from igrow.edge.cli import main
from igrow.edge.configuration import load_configuration
from igrow.edge.image import Quality, Value
from igrow.edge.store import SqliteStore
from tests.control.daemon_bench import free_port, write_files


def test_the_installed_configuration_begins_with_a_bundle_that_is_there():
    configuration = load_configuration("config/daemon.yaml")
    assert configuration.bundle_folder == default_bundle_folder()
    assert (default_bundle_folder() / "simulator.onnx").is_file()


def test_check_config_reads_the_bundle_that_it_names(tmp_path, capsys):
    path = write_files(tmp_path, 5020, bundle="empty")
    (tmp_path / "empty").mkdir()
    assert main(["check-config", str(path)]) == 2
    assert "manifest.json" in capsys.readouterr().err


def test_the_version_is_told(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"igrow-edge {igrow.__version__}\n"


def test_a_probe_that_nobody_answers_ends_in_failure(capsys):
    assert main(["probe", "--tcp", f"127.0.0.1:{free_port()}", "--timeout", "0.2"]) == 1


@pytest.fixture
def gateway(tmp_path):
    """A configuration and a state folder with all that a daemon leaves there."""
    folder = tmp_path / "old"
    folder.mkdir()
    configuration = load_configuration(write_files(folder, 5020))
    store = SqliteStore(configuration.store_folder)
    store.record_event(1.0, "started", {})
    store.append(1.0, {"air_temperature": Value(20.0, Quality.GOOD, 0.0)})
    store.close()
    state = configuration.state_folder
    for name in ("holds.json", "updates/bundles/abc/manifest.json", "updates/trust/metadata/root.json"):
        (state / name).parent.mkdir(parents=True, exist_ok=True)
        (state / name).write_text(name)
    (state / "lock").touch()
    (state / "updates" / "half.part").touch()
    return configuration


def test_a_backup_brings_a_new_machine_where_the_old_one_was(tmp_path, gateway):
    archive = tmp_path / "backup.tar.gz"
    assert back_up(gateway, archive) == []
    assert archive.stat().st_mode & 0o077 == 0
    new = put_back(archive, tmp_path / "new" / "greenhouse.yaml")
    assert new.path.read_text() == gateway.path.read_text()
    assert (new.site, new.register_map) == (gateway.site, gateway.register_map)
    kept = {str(path.relative_to(new.state_folder)) for path in new.state_folder.rglob("*") if path.is_file()}
    assert {"holds.json", "updates/bundles/abc/manifest.json", "updates/trust/metadata/root.json"} < kept
    assert not {"lock", "updates/half.part"} & kept
    assert (new.state_folder / "holds.json").read_text() == "holds.json"


def test_a_restore_replaces_nothing(tmp_path, gateway):
    archive = tmp_path / "backup.tar.gz"
    back_up(gateway, archive)
    with pytest.raises(BackupError, match=r"exists; move all of"):
        put_back(archive, gateway.path)


def test_a_file_of_the_configuration_that_lies_elsewhere_is_named(tmp_path, gateway):
    elsewhere = tmp_path / "elsewhere.yaml"
    elsewhere.write_text((gateway.path.parent / gateway.file.site).read_text())
    text = gateway.path.read_text().replace(f"site: {gateway.file.site}", f"site: {elsewhere}")
    gateway.path.write_text(text)
    assert back_up(load_configuration(gateway.path), tmp_path / "backup.tar.gz") == [elsewhere]


@pytest.mark.parametrize(("name", "kind"), [("../../evil", tarfile.REGTYPE), ("state/link", tarfile.SYMTYPE)])
def test_an_archive_that_would_write_outside_its_folder_is_refused(tmp_path, name, kind):
    archive = tmp_path / "evil.tar.gz"
    with tarfile.open(archive, "w:gz") as made:
        member = tarfile.TarInfo(name)
        member.type, member.linkname = kind, "/etc" if kind == tarfile.SYMTYPE else ""
        made.addfile(member)
    with pytest.raises(BackupError, match="cannot be restored"):
        put_back(archive, tmp_path / "new" / "daemon.yaml")
    assert not (tmp_path / "new").exists()
