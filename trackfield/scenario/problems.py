"""The errors of a scenario, for its author: where, what, and what is expected."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, Final

from pydantic import ValidationError

from trackfield.errors import MOST_TOLD, ScenarioError
from trackfield.scenario.keys import Key, Kinds, own_option, sections_of_file, top_level
from trackfield.scenario.nearest import suggestion
from trackfield.words import quoted, shortened

NUMBER: Final = re.compile(r"\[(\d+)\]")
"""The index in a list of sections: ``faults[0]``."""

Near = Callable[[str, Iterable[str]], str]
"""The nearest of the names that are known, in words."""

_HEADER: Final = re.compile(r"\s*\[(\[)?\s*([\w.-]+)\s*\]")
_SETTING: Final = re.compile(r"""\s*["']?([\w-]+)["']?\s*=""")


def problems(error: ValidationError, file: str, text: str, set_keys: Collection[str]) -> list[ScenarioError]:
    """All that validation found in a ``file`` with this ``text``, of which ``set_keys`` were overridden."""
    found: dict[str, ScenarioError] = {}
    lines, set_tables = Lines(text), set[str]().union(*(_within(key.split(".")) for key in set_keys))
    for number, one in enumerate(error.errors(include_url=False)):
        path, what, expected = _problem(one, suggestion if number < MOST_TOLD else _unsaid)
        key = ".".join(path)
        place = re.sub(NUMBER, "", key)
        is_set = place in set_tables or not _within(place.split(".")).isdisjoint(set_keys)
        here = "" if is_set else file
        line = lines.of(path) if here else None
        where = f"{here}:{line}" if line else here
        found.setdefault(key, ScenarioError(what, file=where, key=key, expected=expected))
    return list(found.values())


def _unsaid(name: str, known: Iterable[str]) -> str:
    """In place of ``suggestion`` for errors that are only counted: it takes long."""
    return ""


STAND_INS: Final = {"name": "scenario", "target": {"path": "s1", "step_s": 3600.0}}
"""Stand-ins for required parts, so that the rest of a scenario can be checked; no deadline is past so long a step."""


def section_of(key: str) -> str:
    """The section that a key is in: ``faults[0].at_s`` in ``faults``."""
    return re.sub(NUMBER, "", key.partition(".")[0])


def without(data: Mapping[str, Any], keys: Collection[str]) -> dict[str, Any]:
    """A scenario without these keys; a list of sections, or a section of unknown kind, is removed as a whole."""
    less = {name: dict(part) if isinstance(part, Mapping) else part for name, part in data.items()}
    for key in keys:
        name, _, rest = key.partition(".")
        part, section = less.get(name), sections_of_file().get(name)
        own = rest.partition(".")[0]
        if isinstance(part, dict) and own in part and (section is None or own != section.tag):
            del part[own]
        else:
            less.pop(section_of(key), None)
    missing = {section_of(key) for key in keys} - less.keys()
    if "targets" in missing and "target" not in less:
        missing.add("target")
    return less | {name: value for name, value in STAND_INS.items() if name in missing}


def _problem(error: Mapping[str, Any], near: Near) -> tuple[list[str], str, str]:
    """The key's path, its error, and what is expected."""
    path, section, kind = _where(error["loc"])
    context = error.get("ctx", {})
    missing = error["type"] == "missing" and isinstance(error["loc"][-1], str)
    what, expected = "missing" if missing else f"is {_short(error['input'])}", "a section"
    match error["type"]:
        case "own":
            what, expected = context["what"], context["expected"]
            path = [*(path if context["key"].startswith(".") else ()), *filter(None, context["key"].split("."))] or path
        case "too_long":
            what, expected = f"has more than {context['max_length']} entries", "fewer"
        case "string_too_long":
            what, expected = f"has more than {context['max_length']} characters", "fewer"
        case "extra_forbidden":
            what, expected = _unknown(path, section, kind, near)
        case "union_tag_invalid" if section:
            what, expected = f"unknown {section.tag} {quoted(context['tag'])}", _one_of(section.kinds)
            what += near(str(context["tag"]), section.kinds)
            path = [*path, section.tag]
        case "union_tag_not_found" if section:
            what, expected, path = "missing", _one_of(section.kinds), [*path, section.tag]
        case _ if section:
            keys = section.keys(kind) if len(path) < 3 else _parts(section.keys(kind)[path[1]])
            expected = (
                (keys.get(path[-1]) or own_option(path[-1])).expected if len(path) > 1 else _a_section(path[0], section)
            )
        case _:
            expected = top_level()[path[0]].expected
    if error["type"] == "literal_error":
        what += near(str(error["input"]), expected.removeprefix("one of ").split(", "))
    return path, what, expected


def _where(loc: Sequence[str | int]) -> tuple[list[str], Kinds | None, str]:
    """The path of the key at this place, its section, and the section's kind."""
    path = [part for part in loc if isinstance(part, str)]
    section = sections_of_file().get(path[0]) if path else None
    if section is None:
        return path, None, ""
    kind = path.pop(1) if section.tag and len(path) > 1 else ""
    if section.many and len(loc) > 1:
        path[0] += f"[{loc[1]}]"
    key = section.keys(kind).get(path[1]) if len(path) > 1 else None
    return path[: 3 if key and key.parts else 2], section, kind  # further down there are only the parts of a value


def _parts(key: Key) -> dict[str, Key]:
    """The keys of a table by name."""
    return {part.name: part for part in key.parts}


def _a_section(name: str, section: Kinds) -> str:
    """The section expected under this name, in words: one, or a list of them where an index is missing."""
    alone = re.sub(NUMBER, "", name)
    return f"{'sections' if section.many and alone == name else 'a section'} {section.header(alone)}"


def _unknown(path: Sequence[str], section: Kinds | None, kind: str, near: Near) -> tuple[str, str]:
    """The message for a key that is unknown, or that belongs to another kind of its section."""
    name = path[-1]
    if section is None:
        known: Collection[str] = [*top_level(), *sections_of_file()]
    elif len(path) > 2:
        known = _parts(section.keys(kind)[path[1]])
    else:
        return _not_of_section(name, section, kind, near)
    return f"unknown{near(name, known)}", _one_of(known)


def _not_of_section(name: str, section: Kinds, kind: str, near: Near) -> tuple[str, str]:
    known = section.keys(kind)
    others = [other for other, keys in section.kinds.items() if name in keys]
    if others:
        return f"belongs to {section.tag} {' or '.join(others)}, not to {kind}", _one_of(known)
    return f"unknown{near(name, section.keys(None))}", _one_of(known)


def _one_of(names: Collection[str]) -> str:
    return "one of " + ", ".join(names)


def _short(value: object) -> str:
    return shortened(json.dumps(value, default=quoted))


class Lines:
    """On which line a TOML text sets a key, or opens a section.

    Knows ``[section]``, ``[section.key]`` and ``[[section]]`` headers, and ``key =`` on a line of its own, which is how
    scenario files are written.
    """

    def __init__(self, text: str) -> None:
        self._set: dict[tuple[str, ...], int] = {}
        self._opened: dict[str, int] = {}
        here = ""
        seen: Counter[str] = Counter()
        for number, line in enumerate(text.splitlines(), start=1):
            if header := _HEADER.match(line):
                here = f"{header[2]}[{seen[header[2]]}]" if header[1] else header[2]
                seen[header[2]] += 1
                self._opened[here] = number
            elif setting := _SETTING.match(line):
                self._set.setdefault((*filter(None, here.split(".")), setting[1]), number)

    def of(self, path: Sequence[str]) -> int | None:
        """The line of the key at this path, or else of its section; None if neither is found."""
        found = [self._set[key] for key in (tuple(path), tuple(path[:2])) if key in self._set]
        return min(found) if found else self._opened.get(path[0]) if path else None


def _within(path: Sequence[str]) -> set[str]:
    """The key at this path, and the tables that it is in."""
    return {".".join(path[:end]) for end in range(1, len(path) + 1)}
