"""A bundle on disk: written whole or not at all, read with every checksum compared."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.bundle.manifest import BundleError, Manifest
from igrow.core.bundle.manifest_json import manifest_from_json, manifest_to_json
from igrow.core.whole_files import sync_folder, write_through

MANIFEST_FILE = "manifest.json"
GOLDEN_FILE = "golden.npz"
REQUIRED_GRAPHS = ("simulator", "optimizer")
"""The graphs that a bundle must hold, each in a file of its name with the suffix .onnx, with golden values."""
REQUIRED_FILES = (*(f"{graph}.onnx" for graph in REQUIRED_GRAPHS), GOLDEN_FILE)

LARGEST_FILE = 256 * 2**20
"""Bytes; a gateway with little memory refuses to read more."""


@dataclass(frozen=True)
class Golden:
    """Inputs of one graph, and the outputs that they must give; arrays by the graph's own names."""

    inputs: Mapping[str, NDArray[Any]]
    outputs: Mapping[str, NDArray[Any]]


@dataclass(frozen=True, repr=False)
class Bundle:
    """A bundle that was read and whose checksums agree."""

    folder: Path
    manifest: Manifest
    identity: str
    """The first 16 hexadecimal digits of the manifest's SHA-256: equal if and only if all content is."""

    def __repr__(self) -> str:
        return f"Bundle({self.label!r}, {self.manifest.variant}, {str(self.folder)!r})"

    def graph(self, name: str) -> Path:
        """Return the file of a graph; raises BundleError where the bundle has none."""
        file = f"{name}.onnx"
        if file not in self.manifest.files:
            raise BundleError(f"{self.folder}: the bundle holds no {file}")
        return self.folder / file

    def content(self, name: str) -> bytes:
        """Return what one of the files holds; raises BundleError where it cannot be read."""
        path = self.folder / name
        try:
            return path.read_bytes()
        except OSError as error:
            raise BundleError(f"{path}: not readable: {error.strerror}") from None

    @property
    def label(self) -> str:
        """A name for people: site, day made, identity."""
        return f"{self.manifest.site}-{self.manifest.created:%Y%m%d}-{self.identity[:8]}"


def write_bundle(folder: Path, manifest: Manifest, files: Mapping[str, bytes], golden: Mapping[str, Golden]) -> Bundle:
    """Write a bundle to `folder`, which must not exist yet, and read it back.

    `files` are file name -> content (`simulator.onnx`, `optimizer.onnx`, ...), `golden` is graph name ->
    golden values for the self-test. The manifest's `files` is filled in here. The folder appears by one
    rename after everything is on the disk. Raises BundleError where something is missing or in the way.
    """
    if folder.exists():
        raise BundleError(f"{folder}: exists already; a bundle is never overwritten")
    contents = dict(files)
    contents[GOLDEN_FILE] = _golden_to_bytes(golden)
    _require(contents, str(folder))
    checksums = {name: hashlib.sha256(content).hexdigest() for name, content in sorted(contents.items())}
    text = manifest_to_json(dataclasses.replace(manifest, files=checksums))
    manifest_from_json(text)  # what cannot be read back must not leave this machine
    contents[MANIFEST_FILE] = text.encode()

    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    try:
        for name, content in contents.items():
            write_through(partial / name, content)
        partial.rename(folder)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    sync_folder(folder.parent)
    return read_bundle(folder)


def read_bundle(folder: Path) -> Bundle:
    """Read the manifest of the bundle in `folder` and compare every checksum.

    Raises BundleError in one line: no folder, a file missing, changed, too large or not listed.
    """
    path = folder / MANIFEST_FILE
    text = _read(path)
    manifest = manifest_from_json(text.decode(errors="replace"), where=str(path))
    _require(manifest.files, str(path))
    for name in manifest.graphs:
        if f"{name}.onnx" not in manifest.files:
            raise BundleError(f"{path}: graphs.{name}: there is no file {name}.onnx")
    for name, checksum in manifest.files.items():
        if hashlib.sha256(_read(folder / name)).hexdigest() != checksum:
            raise BundleError(f"{folder / name}: the content does not match its checksum in the manifest")
    present = {entry.name for entry in folder.iterdir()}
    if stray := sorted(present - set(manifest.files) - {MANIFEST_FILE}):
        raise BundleError(f"{folder / stray[0]}: not listed in the manifest")
    return Bundle(folder, manifest, hashlib.sha256(text).hexdigest()[:16])


BUILT_IN = "default"
"""Site of the built-in bundle: a greenhouse with all defaults of a description."""


def default_bundle_folder() -> Path:
    """Return the folder of the default bundle that is installed with igrow: a greenhouse that nobody has measured."""
    return Path(str(resources.files("igrow.core"))) / "default_bundle"


def read_golden(bundle: Bundle) -> dict[str, Golden]:
    """Return the golden values by graph; raises BundleError where the file cannot be read."""
    path = bundle.folder / GOLDEN_FILE
    parts: dict[str, tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]] = {}
    try:
        with np.load(path, allow_pickle=False) as archive:
            for key in archive.files:
                graph, side, name = key.split("|", 2)
                parts.setdefault(graph, ({}, {}))[("input", "output").index(side)][name] = archive[key]
    except Exception as error:
        # A damaged archive raises from zipfile, zlib or numpy; for the user it is one fault.
        raise BundleError(f"{path}: not readable as golden values: {error}") from None
    return {graph: Golden(inputs, outputs) for graph, (inputs, outputs) in parts.items()}


def _require(names: Mapping[str, object], where: str) -> None:
    for name in REQUIRED_FILES:
        if name not in names:
            raise BundleError(f"{where}: a bundle needs {name}")


def _golden_to_bytes(golden: Mapping[str, Golden]) -> bytes:
    arrays: dict[str, NDArray[Any]] = {}
    for graph, values in golden.items():
        arrays.update({f"{graph}|input|{name}": np.asarray(array) for name, array in values.inputs.items()})
        arrays.update({f"{graph}|output|{name}": np.asarray(array) for name, array in values.outputs.items()})
    stream = io.BytesIO()
    np.savez_compressed(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _read(path: Path) -> bytes:
    try:
        if path.is_symlink() or not path.is_file():
            raise BundleError(f"{path}: no such file, or not a plain one")
        if path.stat().st_size > LARGEST_FILE:
            raise BundleError(f"{path}: larger than {LARGEST_FILE >> 20} MiB")
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"{path}: {error.strerror}") from None
