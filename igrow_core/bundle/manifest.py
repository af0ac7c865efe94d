"""The manifest of a bundle: typed records, and their strict reading from JSON.

Reading is strict on purpose: an unknown key, a missing key or a value of the wrong type is refused with the
path to it (`manifest.json: effects[0].parameters.amplitude.low: expected a number, found "x"`), because a
gateway that guesses what a bundle means would control a greenhouse by guesses.
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Literal, cast

from igrow.core.errors import IgrowError

FORMAT_VERSION = 1
"""Raised by one whenever an older reader would misunderstand a newer bundle."""

Json = Any
"""A value as `json.loads` gives it."""


class BundleError(IgrowError):
    """A bundle that cannot be used, and why."""


@dataclass(frozen=True)
class Tensor:
    """One input or output of a graph: what its last axis holds, in which order and unit."""

    name: str
    axes: tuple[str, ...] = ()
    """Names of the axes, for example ("batch", "hour", "quantity")."""
    quantities: tuple[str, ...] = ()
    """The quantity at each index of the last axis; one entry when the whole tensor is one quantity."""
    units: tuple[str, ...] = ()
    """The unit of each entry of `quantities`."""


@dataclass(frozen=True)
class GraphSignature:
    """The inputs and outputs of one graph, in the graph's order."""

    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]


@dataclass(frozen=True)
class Span:
    """A stretch of time, UTC, its end not included."""

    start: datetime
    end: datetime


@dataclass(frozen=True)
class Onset:
    """When an effect began, with the bounds of its interval."""

    time: datetime
    low: datetime
    high: datetime


@dataclass(frozen=True)
class Estimate:
    """A fitted value with its 90 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class EffectRecord:
    """A named effect that the simulator carries."""

    name: str
    kind: Literal["process", "sensor", "remainder"]
    parameters: Mapping[str, Estimate]
    balances: tuple[str, ...] = ()
    onset: Onset | None = None


@dataclass(frozen=True)
class Parameter:
    """A calibrated parameter: posterior mean and standard deviation."""

    mean: float
    standard_deviation: float
    unit: str


@dataclass(frozen=True)
class HeldOutError:
    """Mean absolute error of one quantity on days that no fit has seen, before and after the correction."""

    quantity: str
    horizon: str
    """"1_step", "1_h", "24_h" or "7_d"."""
    before: float
    after: float
    unit: str


@dataclass(frozen=True)
class Manifest:
    """Everything a gateway must know about a bundle before it lets it near a greenhouse."""

    site: str
    created: datetime
    igrow_version: str
    variant: Literal["network", "hybrid"]
    opset: int
    graphs: Mapping[str, GraphSignature]
    training_span: Span | None = None
    effects: tuple[EffectRecord, ...] = ()
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    covariance: tuple[tuple[float, ...], ...] | None = None
    """Of `parameters`, rows and columns in their order; None where only the deviations are known."""
    errors: tuple[HeldOutError, ...] = ()
    training_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Smallest and largest value of each quantity that the simulator was fitted on."""
    simulator: Mapping[str, Json] = field(default_factory=dict)
    """What the simulator's runtime needs to know beside its graph; its own business."""
    golden_tolerance: float = 1e-3
    """Largest deviation in the self-test, as a fraction of the largest expected magnitude of an output."""
    format_version: int = FORMAT_VERSION
    files: Mapping[str, str] = field(default_factory=dict)
    """File name to SHA-256 of its content, in hexadecimal; filled by `write_bundle`."""


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
        manifest = cast(Manifest, _decode(Manifest, document, ""))
    except _FaultError as fault:
        raise BundleError(f"{where}: {fault}") from None
    _check(manifest, where)
    return manifest


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
