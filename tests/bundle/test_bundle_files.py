"""A bundle is read back as it was written, and every way of damaging it is refused in one line."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from igrow.core.bundle import (
    Bundle,
    BundleError,
    Golden,
    default_bundle_folder,
    manifest_from_json,
    manifest_to_json,
    read_bundle,
    read_golden,
    self_test,
    write_bundle,
)
from tests.tiny_bundle import write_tiny_bundle


def test_a_bundle_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    written = write_tiny_bundle(tmp_path / "bundle")
    read = read_bundle(tmp_path / "bundle")
    assert read == written
    assert manifest_from_json(manifest_to_json(read.manifest)) == read.manifest
    assert read.manifest.effects[0].parameters["amplitude"].low == 0.04


def test_two_bundles_of_other_content_have_other_identities(tmp_path: Path) -> None:
    first = write_tiny_bundle(tmp_path / "first", offset=5.0)
    second = write_tiny_bundle(tmp_path / "second", offset=5.1)
    again = write_tiny_bundle(tmp_path / "again", offset=5.0)
    assert first.identity != second.identity
    assert first.identity == again.identity


def test_a_bundle_is_never_overwritten(tmp_path: Path) -> None:
    write_tiny_bundle(tmp_path / "bundle")
    with pytest.raises(BundleError, match="never overwritten"):
        write_tiny_bundle(tmp_path / "bundle")


def test_a_write_that_fails_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_tiny_bundle(tmp_path / "bundle")
    assert list(tmp_path.iterdir()) == []


def test_the_self_test_passes_on_the_machine_that_wrote_the_golden_values(tmp_path: Path) -> None:
    deviations = self_test(write_tiny_bundle(tmp_path / "bundle"))
    assert {deviation.graph for deviation in deviations} == {"simulator", "optimizer"}
    assert all(deviation.relative < 1e-6 for deviation in deviations)


def test_a_graph_that_computes_something_else_fails_the_self_test(tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundle", offset=5.0, golden_offset=5.2)
    with pytest.raises(BundleError, match=r"self-test failed: simulator.onnx, output air_temperature is off by"):
        self_test(bundle)


def copy_with_golden(bundle: Bundle, folder: Path, golden: Mapping[str, Golden]) -> Bundle:
    files = {name: (bundle.folder / name).read_bytes() for name in ("simulator.onnx", "optimizer.onnx")}
    return write_bundle(folder, bundle.manifest, files, golden)


@pytest.mark.parametrize("untested", ["simulator", "optimizer"])
def test_a_graph_that_cannot_be_tested_fails_the_self_test(tmp_path: Path, untested: str) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundle")
    golden = read_golden(bundle)
    without = copy_with_golden(
        bundle, tmp_path / "without", {name: values for name, values in golden.items() if name != untested}
    )
    with pytest.raises(BundleError, match=rf"no golden values for {untested}\.onnx"):
        self_test(without)
    empty = copy_with_golden(bundle, tmp_path / "empty", {**golden, untested: Golden(golden[untested].inputs, {})})
    with pytest.raises(BundleError, match=rf"{untested}\.onnx"):
        self_test(empty)


@pytest.mark.parametrize("unlisted", ["simulator", "optimizer"])
def test_a_graph_that_the_manifest_leaves_out_fails_the_self_test(tmp_path: Path, unlisted: str) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundle")
    listed = {name: graph for name, graph in bundle.manifest.graphs.items() if name != unlisted}
    shorter = dataclasses.replace(bundle, manifest=dataclasses.replace(bundle.manifest, graphs=listed))
    with pytest.raises(BundleError, match=rf"does not list {unlisted}\.onnx"):
        self_test(shorter)


def test_the_default_bundle_passes_with_all_its_graphs() -> None:
    tested = {deviation.graph for deviation in self_test(read_bundle(default_bundle_folder()))}
    assert tested == {"simulator", "hindcast", "optimizer"}


def test_a_bundle_without_an_optimizer_is_refused(tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundle")
    with pytest.raises(BundleError, match=r"needs optimizer\.onnx"):
        write_bundle(tmp_path / "other", bundle.manifest, {"simulator.onnx": b"x"}, {})


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda folder: (folder / "simulator.onnx").write_bytes(b"changed"), "does not match its checksum"),
        (lambda folder: (folder / "simulator.onnx").unlink(), "no such file"),
        (lambda folder: (folder / "extra.bin").write_bytes(b"x"), "not listed in the manifest"),
        (lambda folder: (folder / "manifest.json").write_text("{"), "not readable as JSON"),
        (lambda folder: (folder / "manifest.json").unlink(), "no such file"),
        (
            lambda folder: (
                (folder / "golden.npz").unlink(),
                (folder / "golden.npz").symlink_to("/etc/passwd"),
            ),
            "not a plain one",
        ),
    ],
)
def test_a_damaged_folder_is_refused(tmp_path: Path, damage, message: str) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundle")
    damage(bundle.folder)
    with pytest.raises(BundleError, match=message) as caught:
        read_bundle(bundle.folder)
    assert "\n" not in str(caught.value)


def _change(path: list, value: object):
    def apply(document: dict) -> None:
        for step in path[:-1]:
            document = document[step]
        document[path[-1]] = value

    return apply


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_change(["opset"], "18"), 'opset: expected a whole number, found "18"'),
        (
            _change(["effects", 0, "parameters", "amplitude", "low"], "x"),
            r'effects\[0\]\.parameters\.amplitude\.low: expected a number, found "x"',
        ),
        (_change(["variant"], "oracle"), "variant: expected one of network, hybrid"),
        (_change(["created"], "2026-03-14"), "created: expected a time in UTC"),
        (_change(["colour"], 1), "colour: unknown key"),
        (_change(["format_version"], 99), "format version 99 is newer"),
        (_change(["files", "../evil"], "00"), "not a plain file name"),
        (_change(["covariance"], [[1.0]]), "covariance: expected 0 rows"),
        (_change(["golden_tolerance"], True), "golden_tolerance: expected a number"),
    ],
)
def test_a_faulty_manifest_is_refused_with_the_path_to_the_fault(tmp_path: Path, change, message: str) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundle")
    document = json.loads((bundle.folder / "manifest.json").read_text())
    change(document)
    (bundle.folder / "manifest.json").write_text(json.dumps(document))
    with pytest.raises(BundleError, match=message):
        read_bundle(bundle.folder)


def test_a_key_given_twice_is_refused() -> None:
    with pytest.raises(BundleError, match='"site" is given twice'):
        manifest_from_json('{"site": "a", "site": "b"}')


def test_a_manifest_of_the_first_format_is_read_with_what_it_kept_among_the_settings(tmp_path: Path) -> None:
    """Such bundles lie in exchanges, and on gateways."""
    bundle = write_tiny_bundle(tmp_path / "bundle")
    document = json.loads((bundle.folder / "manifest.json").read_text())
    for name in ("calibrated_on", "alignment"):
        del document[name]
    document["format_version"] = 1
    document["simulator"] = {"latitude": 52.0, "known_misfit": {"heat:night": 1.5}, "calibrated_on": "there"}
    manifest = manifest_from_json(json.dumps(document))
    assert manifest.calibrated_on == "there"
    assert manifest.alignment is None
    assert manifest.simulator == {"latitude": 52.0}
    del document["simulator"]["calibrated_on"]
    assert manifest_from_json(json.dumps(document)).calibrated_on == manifest.site
    # Amplitudes without their covariance, of before the history: nothing reads them any more.
    assert manifest_from_json(json.dumps(document | {"discrepancy": {"heat:night": 1.5}})).simulator == {
        "latitude": 52.0
    }
    # Written again, it is of the present format.
    assert manifest_from_json(manifest_to_json(manifest)) == manifest
