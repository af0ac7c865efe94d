"""Strict YAML: a file is read into a dataclass, and every error says `file:line:column: what, and what would be right`.

A schema is a frozen dataclass whose fields are typed and made by `setting`. The file's own types are not used,
since YAML 1.1 reads 12:30 as 750, NO as false, 0123 as 83 and 1e3 as text; a scalar is read by the field's type
(`igrow.core.yaml_scalars`). Beside scalars:

| field type | reads |
|---|---|
| `X | None` | null, or X |
| `tuple[X, ...]`, `Mapping[str, X]`, a dataclass | a list, a mapping, the keys of the dataclass |
| `A | B` of dataclasses | the one whose `Literal` field (such as `kind: Literal["tcp"]`) has the file's value |

A mapping in the file changes only the keys it names; the others keep the default of the field it stands for.
Duplicate keys, unknown keys, tags and merge keys are refused. A dataclass may check itself in `__post_init__` and
raise `SettingError(what, key)`; the loader adds the place.
"""

from __future__ import annotations

import dataclasses
import datetime
import os
import types
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import yaml

from igrow.core.errors import IgrowError
from igrow.core.yaml_scalars import convert, listed, nearest, wanted

T = TypeVar("T")


_NONE = ("none", "no", "false", "off", "nothing", "n/a", "-")
"""What people write where there is none of something."""


class SchemaError(IgrowError):
    """An error in a configuration file, with its place."""


class SettingError(IgrowError):
    """What a dataclass of a schema finds wrong with itself; `path` leads from it to the key at fault."""

    def __init__(self, what: str, *path: str | int) -> None:
        super().__init__(what)
        self.path = path


def setting(
    *,
    help: str,  # noqa: A002 - the word that users of argparse know
    unit: str = "",
    low: float | datetime.timedelta | None = None,
    high: float | datetime.timedelta | None = None,
    default: Any = dataclasses.MISSING,
    default_factory: Any = dataclasses.MISSING,
    keys: Iterable[str] | None = None,
) -> Any:
    """Define one field of a schema: what it means, its unit, its bounds and its default (without one it is required).

    Bounds are inclusive and hold for each number of a list or mapping too; `keys` are the only names that a
    mapping may have.
    """
    metadata = {"help": help, "unit": unit, "low": low, "high": high, "keys": None if keys is None else tuple(keys)}
    return dataclasses.field(default=default, default_factory=default_factory, metadata=metadata)


def load(path: str | os.PathLike[str], schema: type[T]) -> T:
    """Read a YAML file into `schema`, a dataclass; raises SchemaError with the place of the first error."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise SchemaError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SchemaError(f"{path}: is not UTF-8 text") from None
    return parse(text, schema, str(path))


def parse(text: str, schema: type[T], name: str = "text") -> T:
    """Read YAML text into `schema`; `name` stands for the file in errors."""
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        raise SchemaError(f"{place}: not valid YAML: {error.problem or error.context}") from None
    except yaml.YAMLError as error:
        raise SchemaError(f"{name}: not valid YAML: {str(error).splitlines()[0]}") from None
    except RecursionError:
        raise SchemaError(f"{name}: nested too deeply for any file of igrow") from None
    if node is None:
        raise SchemaError(f"{name}:1:1: the file is empty: it needs {_required(schema)}")
    value: T = _Reader(name).read(node, schema, "", {})
    return value


def place(path: str | os.PathLike[str], *keys: str | int) -> str:
    """Return `file:line:column` of what `keys` lead to, or of the last one on the way that the file has.

    For a fault that shows only when several files are put together. A file that cannot be read is its own place.
    """
    try:
        node = yaml.compose(Path(path).read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError):
        node = None
    if node is None:
        return str(path)
    mark = _find(node, keys).start_mark
    return f"{path}:{mark.line + 1}:{mark.column + 1}"


class _Reader:
    """Reads nodes by type; knows the file's name for its errors."""

    def __init__(self, name: str) -> None:
        self._name = name

    def error(self, node: yaml.Node, what: str) -> SchemaError:
        return SchemaError(f"{self._name}:{node.start_mark.line + 1}:{node.start_mark.column + 1}: {what}")

    def read(self, node: yaml.Node, kind: Any, where: str, limits: Mapping[str, Any], base: Any = None) -> Any:
        if not node.tag.startswith("tag:yaml.org,2002:") or "python" in node.tag:
            raise self.error(node, f"the tag {node.tag} is not allowed: write the plain value")
        origin, arguments = get_origin(kind), get_args(kind)
        if origin in (Union, types.UnionType):
            return self._union(node, arguments, where, limits, base)
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            return self._dataclass(node, kind, where, base)
        if origin is tuple:
            if not isinstance(node, yaml.SequenceNode):
                raise self.error(node, f"{where} must be a list, such as [a, b]")
            return tuple(self.read(item, arguments[0], f"{where}[{i}]", limits) for i, item in enumerate(node.value))
        if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
            pairs = self._pairs(node, where)
            known = limits.get("keys")
            for key, (key_node, _) in pairs.items():
                if known is not None and key not in known:
                    raise self.error(key_node, f"{_join(where, key)} is not known: {nearest(key, known)}")
            bases = base if isinstance(base, Mapping) else {}
            return {
                key: self.read(value, arguments[1], _join(where, key), limits, bases.get(key))
                for key, (_, value) in pairs.items()
            }
        if not isinstance(node, yaml.ScalarNode):
            found = "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"
            raise self.error(node, f"{where or 'the file'} is {found}: {wanted(kind, limits)} is needed")
        return self._scalar(node, kind, where, limits)

    def _pairs(self, node: yaml.Node, where: str) -> dict[str, tuple[yaml.Node, yaml.Node]]:
        if not isinstance(node, yaml.MappingNode):
            raise self.error(node, f"{where or 'the file'} must be a mapping of keys to values, such as `key: value`")
        pairs: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise self.error(key_node, "a key must be a plain name")
            key = key_node.value
            if key in pairs:
                first = pairs[key][0].start_mark.line + 1
                raise self.error(key_node, f"{_join(where, key)} stands twice: remove it here or in line {first}")
            pairs[key] = (key_node, value_node)
        return pairs

    def _dataclass(self, node: yaml.Node, schema: type[Any], where: str, base: Any) -> Any:
        if isinstance(node, yaml.ScalarNode) and node.value == "":
            raise self.error(
                node, f"{where or 'the file'} is empty: it needs {_required(schema) or 'keys, or remove it'}"
            )
        pairs = self._pairs(node, where)
        fields = {field.name: field for field in dataclasses.fields(schema) if field.init}
        hints = get_type_hints(schema)
        for key, (key_node, _) in pairs.items():
            if key not in fields:
                above = next((name for name in fields if key in _names_in(hints[name])), None)
                what = "is not known: " + nearest(key, fields) if above is None else f"stands below {above}, indented"
                raise self.error(key_node, f"{_join(where, key)} {what}")
        values: dict[str, Any] = {}
        for name, field in fields.items():
            default = getattr(base, name) if type(base) is schema else _default(field)
            if name in pairs:
                inside = _join(where, name)
                values[name] = self.read(pairs[name][1], hints[name], inside, field.metadata, default)
            elif default is not dataclasses.MISSING:
                values[name] = default
            else:
                needed = f"{_join(where, name)} is missing: add `{name}:` with"
                raise self.error(node, f"{needed} {wanted(hints[name], field.metadata)}{_meaning(field)}")
        try:
            return schema(**values)
        except SettingError as error:
            raise self.error(_find(node, error.path), str(error)) from None

    def _union(self, node: yaml.Node, kinds: tuple[Any, ...], where: str, limits: Mapping[str, Any], base: Any) -> Any:
        if type(None) in kinds:
            if isinstance(node, yaml.ScalarNode) and node.style is None and node.value in ("", "null", "~"):
                return None
            if isinstance(node, yaml.ScalarNode) and node.style is None and node.value.lower() in _NONE:
                raise self.error(node, f"{where} is {node.value!r}: where there is none, write null")
            kinds = tuple(kind for kind in kinds if kind is not type(None))
        if len(kinds) == 1:
            return self.read(node, kinds[0], where, limits, base)
        pairs = self._pairs(node, where)
        tags = {_tag(kind): kind for kind in kinds}
        key = next(iter(tags))[0]
        if key not in pairs:
            raise self.error(
                node, f"{_join(where, key)} is missing: add `{key}:` with one of {listed(t[1] for t in tags)}"
            )
        value = pairs[key][1].value
        if (key, value) not in tags:
            choices = [tag[1] for tag in tags]
            raise self.error(pairs[key][1], f"{_join(where, key)} is {value!r}: {nearest(str(value), choices)}")
        return self.read(node, tags[(key, value)], where, limits)

    def _scalar(self, node: yaml.ScalarNode, kind: Any, where: str, limits: Mapping[str, Any]) -> Any:
        text: str = node.value
        if text == "" and node.style is None:
            raise self.error(node, f"{where} is empty: {wanted(kind, limits)} is needed")
        if node.style is not None and kind in (float, int, bool):
            raise self.error(node, f"{where} is the text {text!r}: write it without quotes")
        try:
            value = convert(text, kind)
        except ValueError as error:
            hint = str(error) or f"{wanted(kind, limits)} is needed"
            raise self.error(node, f"{where} is {text!r}: {hint}") from None
        low, high = limits.get("low"), limits.get("high")
        if isinstance(value, (int, float, datetime.timedelta)) and not isinstance(value, bool):
            self._bounds(node, value, low, high, f"{where} is {text}: {wanted(kind, limits)} is needed")
        return value

    def _bounds(self, node: yaml.Node, value: Any, low: Any, high: Any, what: str) -> None:
        if (low is not None and value < low) or (high is not None and value > high):
            raise self.error(node, what)


def _names_in(kind: Any) -> set[str]:
    """Return the keys of a dataclass of a schema, also where it may be left out; none of anything else."""
    schemas = [one for one in (kind, *get_args(kind)) if dataclasses.is_dataclass(one)]
    return {field.name for schema in schemas for field in dataclasses.fields(schema) if field.init}


def _tag(kind: Any) -> tuple[str, str]:
    """Return the name and the value of the first `Literal` field of a dataclass."""
    for name, hint in get_type_hints(kind).items():
        if get_origin(hint) is Literal:
            return name, str(get_args(hint)[0])
    raise TypeError(f"{kind} needs a Literal field to be told from the others")


def _find(node: yaml.Node, path: tuple[str | int, ...]) -> yaml.Node:
    """Return the node that `path` leads to, or the last one on the way that the file has."""
    for step in path:
        if isinstance(node, yaml.MappingNode):
            values = [value for key, value in node.value if key.value == step]
            if not values:
                return node
            node = values[0]
        elif isinstance(node, yaml.SequenceNode) and isinstance(step, int) and step < len(node.value):
            node = node.value[step]
    return node


def _default(field: dataclasses.Field[Any]) -> Any:
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def _required(schema: type[Any]) -> str:
    names = [
        field.name for field in dataclasses.fields(schema) if field.init and _default(field) is dataclasses.MISSING
    ]
    return listed(names)


def _meaning(field: dataclasses.Field[Any]) -> str:
    return f" ({field.metadata['help']})" if field.metadata.get("help") else ""


def _join(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key
