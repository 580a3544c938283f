"""What is wrong with a scenario, for the person who wrote it: where, what, and what would be right."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from trackfield.errors import ScenarioError
from trackfield.scenario.keys import Kinds, sections_of_file, top_level
from trackfield.scenario.nearest import suggestion


def combined(errors: Sequence[ScenarioError]) -> ScenarioError:
    """One error that tells all of them, a line each."""
    return errors[0] if len(errors) == 1 else ScenarioError("\n".join(map(str, errors)))


def problems(error: ValidationError, file: str, text: str, set_keys: Collection[str]) -> list[ScenarioError]:
    """All that validation found in a ``file`` with this ``text``, of which ``set_keys`` were set anew."""
    found: dict[str, ScenarioError] = {}
    for one in error.errors(include_url=False):
        path, what, expected = _problem(one)
        key = ".".join(path)
        is_set = any(f"{key}.".startswith(f"{new}.") or new.startswith(f"{key}.") for new in set_keys)
        here = "" if is_set else file
        line = line_of(text, path) if here else None
        where = f"{here}:{line}" if line else here
        found.setdefault(key, ScenarioError(what, file=where, key=key, expected=expected))
    return list(found.values())


def _problem(error: Mapping[str, Any]) -> tuple[list[str], str, str]:
    """The key's path, what is wrong with it, and what is expected."""
    path = [str(part) for part in error["loc"] if not isinstance(part, int)]
    context = error.get("ctx", {})
    section = sections_of_file().get(path[0]) if path else None
    kind = path.pop(1) if section and section.tag and len(path) > 1 else ""
    missing = error["type"] == "missing" and isinstance(error["loc"][-1], str)
    what, expected = "missing" if missing else f"is {_short(error['input'])}", "a section"
    match error["type"]:
        case "own":
            what, expected = context["what"], context["expected"]
            path = context["key"].split(".") if context["key"] else path
        case "extra_forbidden":
            what, expected = _unknown(path, section, kind)
        case "union_tag_invalid" if section:
            what, expected = f"unknown {section.tag} {context['tag']!r}", _one_of(section.kinds)
            what += suggestion(str(context["tag"]), section.kinds)
            path = [*path, section.tag]
        case "union_tag_not_found" if section:
            what, expected, path = "missing", _one_of(section.kinds), [*path, section.tag]
        case _ if section:
            expected = section.keys(kind)[path[1]].expected if len(path) > 1 else f"a section [{path[0]}]"
        case _:
            expected = top_level()[path[0]].expected
    if error["type"] == "literal_error":
        what += suggestion(str(error["input"]), expected.removeprefix("one of ").split(", "))
    return path, what, expected


def _unknown(path: Sequence[str], section: Kinds | None, kind: str) -> tuple[str, str]:
    """What to say of a key that nobody knows, or that belongs to another kind of its section."""
    name = path[-1]
    if section is None:
        known: Collection[str] = [*top_level(), *sections_of_file()]
        return f"unknown{suggestion(name, known)}", _one_of(known)
    known = section.keys(kind)
    others = [other for other, keys in section.kinds.items() if name in keys]
    if others:
        return f"belongs to {section.tag} {' or '.join(others)}, not to {kind}", _one_of(known)
    return f"unknown{suggestion(name, section.keys(None))}", _one_of(known)


def _one_of(names: Collection[str]) -> str:
    return "one of " + ", ".join(names)


def _short(value: object) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:57] + "..."


def line_of(text: str, path: Sequence[str]) -> int | None:
    """The line on which a TOML text sets this key, or opens this section; None if it cannot be told.

    Knows ``[section]`` headers and ``key =`` on a line of its own, which is how scenario files are written.
    """
    here = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[\s*([\w.-]+)\s*\]", line):
            here = header[1]
            if [here] == list(path):
                return number
            continue
        setting = re.match(r"""\s*["']?([\w-]+)["']?\s*=""", line)
        if setting and [*filter(None, [here]), setting[1]] == list(path[:2]):
            return number
    return None
