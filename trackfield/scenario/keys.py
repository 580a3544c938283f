"""All keys of a scenario file as a table, for messages, written files and the documentation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Final, get_args, get_origin

from pydantic import Discriminator
from pydantic.fields import FieldInfo

from trackfield.scenario.contents import Contents
from trackfield.scenario.section import OTHER, Section

_UNITS: Final = {
    "m_s": "m/s", "m": "m", "s": "s", "ms": "ms", "deg": "degrees", "db": "dB", "dbm": "dBm", "ppm": "ppm", "j": "J",
    "mj": "mJ",
}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """A key: its unit, its default in TOML (empty if it has none), its allowed values, and what it means.

    A key whose value is a table has ``parts``, the keys of that table.
    """

    name: str
    unit: str
    default: str
    expected: str
    meaning: str
    required: bool
    parts: tuple[Key, ...] = ()


@dataclass(frozen=True)
class Kinds:
    """A section: the key ``tag`` that selects its kind, and the keys of each kind.

    A section with one kind has an empty tag and an empty kind name. ``default`` is the kind of a section that is
    left out; empty if it is required. A section that is ``many`` may occur any number of times, as ``[[name]]``.
    A section that is ``open`` has the kind ``OTHER`` for all other values of its tag, with keys unknown here.
    """

    tag: str
    kinds: Mapping[str, Mapping[str, Key]]
    default: str
    many: bool = False

    @property
    def open(self) -> bool:
        """Whether users may add kinds of their own."""
        return OTHER in self.kinds

    def named(self, kind: object) -> str | None:
        """The kind that this value of the tag selects; None if there is none."""
        if isinstance(kind, str) and kind in self.kinds:
            return kind
        return OTHER if self.open and isinstance(kind, str) else None

    def header(self, name: str) -> str:
        """How a section of this ``name`` begins in a file."""
        return f"[[{name}]]" if self.many else f"[{name}]"

    def keys(self, kind: object) -> Mapping[str, Key]:
        """The keys of this kind; the keys of all kinds if there is no such kind."""
        name = self.named(kind)
        if name is not None:
            return self.kinds[name]
        return {name: key for keys in self.kinds.values() for name, key in keys.items()}


@cache
def top_level() -> Mapping[str, Key]:
    """The keys outside any section."""
    sections = sections_of_file()
    return {name: key for name, key in _keys(Contents).items() if name not in sections}


@cache
def sections_of_file() -> Mapping[str, Kinds]:
    """The sections by name."""
    found = {}
    for name, field in Contents.model_fields.items():
        models, tag = _models(field.annotation, field.discriminator)
        if models:
            kinds = {kind: _keys(model) for model in models for kind in _values(model, tag)}
            default = getattr(field.default, tag, "") if tag else ""
            found[name] = Kinds(tag, kinds, default, many=get_origin(field.annotation) is tuple)
    return found


def own_option(name: str) -> Key:
    """A key of a kind that a user added."""
    return Key(name, "", "", "a number, a text, or true or false", "of that kind", required=False)


def _models(hint: Any, tag: str | Discriminator | None) -> tuple[list[type[Section]], str]:
    """The kinds of section in a type, and the key that selects one; empty if there is one kind, or none."""
    if get_origin(hint) is Annotated:
        hint, *about = get_args(hint)
        return _models(hint, next((one.discriminator for one in about if isinstance(one, FieldInfo)), tag))
    name = "kind" if isinstance(tag, Discriminator) else tag or ""
    if isinstance(hint, type) and issubclass(hint, Section):
        return [hint], name
    parts = [_models(part, tag) for part in get_args(hint)]
    return [model for models, _ in parts for model in models], next((name for models, name in parts if models), name)


def _values(model: Any, tag: str) -> tuple[str, ...]:
    """The values of the tag by which this kind of the section is named."""
    return get_args(model.model_fields[tag].annotation) or (OTHER,) if tag else ("",)


def _keys(model: type[Section]) -> Mapping[str, Key]:
    schema = model.model_json_schema(by_alias=True)
    required = schema.get("required", ())
    fields = {field.alias or name: field for name, field in model.model_fields.items()}
    return {
        name: _key(name, about, name in required, _parts(fields[name].annotation))
        for name, about in schema["properties"].items()
    }


def _parts(hint: Any) -> tuple[Key, ...]:
    """The keys of a table."""
    return tuple(_keys(hint).values()) if isinstance(hint, type) and issubclass(hint, Section) else ()


def _key(name: str, about: Mapping[str, Any], required: bool, parts: tuple[Key, ...]) -> Key:
    default = about.get("default")
    return Key(
        name=name,
        unit=next((unit for end, unit in _UNITS.items() if name.endswith(f"_{end}")), ""),
        default="" if default is None else _written(default),
        expected=_expected(about),
        meaning=about.get("description", ""),
        required=required,
        parts=parts,
    )


def _written(value: Any) -> str:
    """A default in TOML; tables without their unset keys."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {json.dumps(one)}' for key, one in value.items() if one is not None)} }}"
    return json.dumps(value)


def _expected(about: Mapping[str, Any]) -> str:
    """A JSON schema in words, unless the key has its own."""
    if "expected" in about:
        return str(about["expected"])
    about = next((one for one in about.get("anyOf", ()) if one.get("type") != "null"), about)
    if "enum" in about or "const" in about:
        return "one of " + ", ".join(map(str, about.get("enum", [about.get("const")])))
    if about.get("type") == "array":
        inner = about["prefixItems"][0] if "prefixItems" in about else about["items"]
        least = "" if "prefixItems" in about else "at least "
        return f"a list of {least}{about.get('minItems', 0)}, each {_expected(inner)}"
    names = {"number": "a number", "integer": "a whole number", "string": "a text", "boolean": "true or false"}
    return " ".join([names.get(about.get("type", ""), "a section"), *_limits(about)])


def _limits(about: Mapping[str, Any]) -> list[str]:
    low, above, high = (about.get(limit) for limit in ("minimum", "exclusiveMinimum", "maximum"))
    if above is not None:
        return [f"above {_short(above)}", *([] if high is None else [f"and at most {_short(high)}"])]
    if low is not None and high is not None:
        return [f"from {_short(low)} to {_short(high)}"]
    return [] if low is None else [f"of at least {_short(low)}"]


def _short(limit: float) -> str:
    return str(limit) if isinstance(limit, int) else f"{limit:.9g}"
