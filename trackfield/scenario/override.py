"""Changing single keys of a scenario: ``--set link.model=fixed``, or from Python."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from trackfield.errors import ScenarioError
from trackfield.scenario.keys import Kinds, sections_of_file
from trackfield.scenario.section import OTHER
from trackfield.scenario.toml import DEEPEST, parsed
from trackfield.words import quoted


def parse(text: str) -> tuple[str, Any]:
    """``key.path=value`` as (key path, value): a TOML value, a number like ``.5``, or else plain text.

    Raises ``ScenarioError`` if there is no key or no ``=``.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not key or not equals:
        raise ScenarioError(f"{quoted(text)} sets nothing", file="--set", expected="key=value, like link.model=fixed")
    try:
        found = parsed(f"value = {value}")
    except ValueError:
        return key, _number_or_text(value)
    return key, found["value"] if len(found) == 1 else value  # of several lines it is text


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def apply(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The scenario ``data`` with the ``values`` set, each by its key path.

    A section that changes its kind keeps the keys that the new kind has too. Setting a key that only
    one kind has selects that kind: ``link.loss`` the model ``fixed``, ``target.file`` the path ``file``.
    """
    changed: dict[str, Any] = deepcopy(dict(data))
    for name, section in sections_of_file().items():
        own = {key.partition(".")[2]: value for key, value in values.items() if key.startswith(f"{name}.")}
        if own and section.many:
            what = "are a list, which can only be set as a whole"
            raise ScenarioError(what, key=name, expected=f"{name}=[{{{section.tag}='...', ...}}, ...]")
        old = changed.get(name, {section.tag: section.default})
        if own and section.tag and isinstance(old, dict):
            changed[name] = _of_kind(section, old, own)
    for key, value in values.items():
        node: Any = changed
        *parents, last = key.split(".")
        if len(parents) > DEEPEST:
            raise ScenarioError(
                f"names {len(parents)} sections", key=key, expected="a key of a scenario, like link.loss"
            )
        for depth, parent in enumerate(parents, start=1):
            node = node.setdefault(parent, {})
            if not isinstance(node, dict):
                raise ScenarioError(f"is {quoted(node)}", key=".".join(parents[:depth]), expected="a section")
        node[last] = value
    return changed


def _of_kind(section: Kinds, old: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """``old`` as the kind that ``own`` names or needs, without the keys that this kind does not have."""
    now = old.get(section.tag, section.default)
    able = [kind for kind, keys in section.kinds.items() if own.keys() <= keys.keys() and kind != OTHER]
    chosen = len(able) == 1 and now in section.kinds  # a user's own kind may have keys of any name
    kind = own.get(section.tag, able[0] if chosen else now)
    if kind == now or section.named(kind) is None:
        return dict(old)
    return {name: value for name, value in old.items() if name in section.keys(kind)} | {section.tag: kind}
