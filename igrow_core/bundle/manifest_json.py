"""The manifest as JSON, read strictly.

An unknown key, a missing key or a value of the wrong type is refused with the path to it
(`manifest.json: effects[0].parameters.amplitude.low: expected a number, found "x"`), because a gateway that guesses
what a bundle means would control a greenhouse by guesses.
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Literal, cast

from igrow.core.bundle.manifest import FORMAT_VERSION, BundleError, Json, Manifest


def manifest_to_json(manifest: Manifest) -> str:
    """Return the manifest as indented JSON with a stable order, ending in a newline."""
    return json.dumps(_encode(manifest), indent=2, allow_nan=False) + "\n"


def manifest_from_json(text: str, *, where: str = "manifest.json") -> Manifest:
    """Read a manifest strictly.

    Raises BundleError naming `where` and the path to the faulty value.
    """
    try:
        document = json.loads(text, object_pairs_hook=_refuse_duplicates)
    except (json.JSONDecodeError, _DuplicateKeyError, RecursionError) as error:
        raise BundleError(f"{where}: not readable as JSON: {error}") from None
    version = document.get("format_version") if isinstance(document, dict) else None
    if isinstance(version, int) and version > FORMAT_VERSION:
        raise BundleError(
            f"{where}: format version {version} is newer than this igrow reads ({FORMAT_VERSION}); update igrow"
        )
    try:
        manifest = cast(Manifest, _decode(Manifest, _upgraded(document), ""))
    except _FaultError as fault:
        raise BundleError(f"{where}: {fault}") from None
    _check(manifest, where)
    return manifest


def _upgraded(document: Json) -> Json:
    """Return a document that an earlier igrow wrote as one of today's.

    Format 1 kept what the trainer knows among the runtime's settings; and what a calibration could not explain was
    amplitudes without their covariance, which nothing reads any more.
    """
    if not isinstance(document, dict):
        return document
    document = {name: value for name, value in document.items() if name != "discrepancy"}
    settings = document.get("simulator") if document.get("format_version") == 1 else None
    if not isinstance(settings, dict):
        return document
    kept = {name: value for name, value in settings.items() if name not in ("known_misfit", "calibrated_on")}
    known: dict[str, Json] = {}
    if document.get("variant") == "hybrid":
        known["calibrated_on"] = settings.get("calibrated_on", document.get("site"))
    return document | known | {"simulator": kept, "format_version": 2}


def _check(manifest: Manifest, where: str) -> None:
    """Raise BundleError on a manifest that is well formed but contradicts itself."""
    size = len(manifest.parameters)
    covariance = manifest.covariance
    if covariance is not None and (len(covariance) != size or any(len(row) != size for row in covariance)):
        raise BundleError(f"{where}: covariance: expected {size} rows of {size} numbers, one per parameter")
    for name in manifest.files:
        if "/" in name or "\\" in name or name in {"", ".", "..", "manifest.json"}:
            raise BundleError(f'{where}: files: "{name}" is not a plain file name')
    for graph, signature in manifest.graphs.items():
        for tensor in (*signature.inputs, *signature.outputs):
            if len(tensor.units) != len(tensor.quantities):
                raise BundleError(
                    f"{where}: graphs.{graph}: {tensor.name}: expected one unit for each of its "
                    f"{len(tensor.quantities)} quantities, found {len(tensor.units)}"
                )


class _FaultError(Exception):
    """A value of the wrong shape, with the path to it."""


class _DuplicateKeyError(Exception):
    """A key given twice."""


def _refuse_duplicates(pairs: list[tuple[str, Json]]) -> dict[str, Json]:
    table: dict[str, Json] = {}
    for key, value in pairs:
        if key in table:
            raise _DuplicateKeyError(f'"{key}" is given twice')
        table[key] = value
    return table


def _encode(value: Any) -> Json:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {item.name: _encode(getattr(value, item.name)) for item in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _encode(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_encode(item) for item in value]
    if isinstance(value, datetime):
        return value.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    return value


def _decode(kind: Any, value: Json, path: str) -> Any:
    """Return `value` as an instance of the annotated type `kind`, or raise _FaultError with its path."""
    if kind is Any:
        return value
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return _decode_record(kind, value, path)
    if kind is datetime:
        return _decode_time(value, path)
    if kind is float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise _fault(path, "a number", value)
        return float(value)
    if kind is int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise _fault(path, "a whole number", value)
        return value
    if kind is str:
        if not isinstance(value, str):
            raise _fault(path, "a text", value)
        return value
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is Literal:
        if value not in arguments:
            raise _fault(path, "one of " + ", ".join(map(str, arguments)), value)
        return value
    if origin is types.UnionType:
        (inner,) = (argument for argument in arguments if argument is not type(None))
        return None if value is None else _decode(inner, value, path)
    if origin is tuple:
        if not isinstance(value, list):
            raise _fault(path, "a list", value)
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return tuple(_decode(arguments[0], item, f"{path}[{index}]") for index, item in enumerate(value))
        if len(value) != len(arguments):
            raise _fault(path, f"a list of {len(arguments)}", value)
        pairs = enumerate(zip(arguments, value, strict=True))
        return tuple(_decode(argument, item, f"{path}[{index}]") for index, (argument, item) in pairs)
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            raise _fault(path, "an object", value)
        return {key: _decode(arguments[1], item, _join(path, key)) for key, item in value.items()}
    raise TypeError(f"no rule to read {kind}")


def _decode_record(kind: type, value: Json, path: str) -> Any:
    if not isinstance(value, dict):
        raise _fault(path, "an object", value)
    hints = typing.get_type_hints(kind)
    arguments = {}
    for item in dataclasses.fields(kind):
        if item.name in value:
            arguments[item.name] = _decode(hints[item.name], value[item.name], _join(path, item.name))
        elif item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING:
            raise _FaultError(f"{_join(path, item.name)}: missing")
    unknown = sorted(set(value) - set(hints))
    if unknown:
        raise _FaultError(f"{_join(path, unknown[0])}: unknown key; known are {', '.join(hints)}")
    return kind(**arguments)


def _decode_time(value: Json, path: str) -> datetime:
    if isinstance(value, str) and value.endswith("Z"):
        try:
            return datetime.fromisoformat(value)
        except ValueError:
            pass
    raise _fault(path, "a time in UTC such as 2026-03-14T00:00:00Z", value)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _fault(path: str, expected: str, found: Json) -> _FaultError:
    shown = json.dumps(found)
    return _FaultError(f"{path or 'top level'}: expected {expected}, found {shown[:60]}")
