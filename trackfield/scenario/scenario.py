"""A scenario: loading, changing, writing."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Self

import tomlkit
from pydantic import ValidationError
from tomlkit.items import Item, Table

from trackfield.errors import ScenarioError, combined
from trackfield.scenario.contents import Contents
from trackfield.scenario.keys import Key, Kinds, own_option, sections_of_file, top_level
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.override import apply
from trackfield.scenario.packaged import ALIASES, names, packaged_data, packaged_file
from trackfield.scenario.problems import problems, section_of, without
from trackfield.scenario.toml import check_values, read_toml
from trackfield.words import quoted

FILES: Final = {
    **dict.fromkeys(("field", "link", "backbone"), ("file",)),
    **dict.fromkeys(("target", "targets"), ("file", "recording", "sound")),
    **dict.fromkeys(("sensor", "sensors"), ("recording",)),
}
"""Sections that may name a file, and the keys that do."""


class Scenario(Contents):
    """A scenario, complete and valid; immutable."""

    @classmethod
    def load(
        cls,
        source: str | Path | Mapping[str, Any],
        overrides: Mapping[str, Any] | None = None,
        *,
        known_trackers: Collection[str] | None = None,
    ) -> Self:
        """The scenario of a packaged name, a TOML file or a dict, with some keys set to other values.

        Files that it names are relative to its own; those in ``overrides`` and in a dict relative to the
        working directory. The trackers' names are checked if ``known_trackers`` are given. Raises
        ``ScenarioError`` with all errors, one per line.
        """
        scenario, errors = cls.examine(source, overrides, known_trackers=known_trackers)
        if scenario is None or errors:
            raise combined(errors)
        return scenario

    @classmethod
    def examine(
        cls,
        source: str | Path | Mapping[str, Any],
        overrides: Mapping[str, Any] | None = None,
        *,
        known_trackers: Collection[str] | None = None,
    ) -> tuple[Self | None, list[ScenarioError]]:
        """Like ``load``, but returns all errors, and the scenario without the wrong keys (None if there is none)."""
        try:
            data, file, text = _written(source)
            check_values(overrides or {})
            changed = _anchored(apply(data, overrides or {}), Path.cwd())
        except ScenarioError as error:
            return None, [error]
        found: list[ScenarioError] = []
        while True:
            try:
                return cls.model_validate(_tuples(changed), context={"trackers": known_trackers}), found
            except ValidationError as error:
                wrong = problems(error, file, text, overrides or {})
            broken = {section_of(one.key) for one in found}
            found += [one for one in wrong if section_of(one.key) not in broken]
            less = without(changed, [one.key for one in wrong])
            if less == changed:
                return None, found
            changed = less

    def set(self, key: str, value: Any) -> Self:
        """The scenario with one key, like ``link.model``, set to another value; see ``override.apply``.

        Raises ``ScenarioError`` as ``load`` does.
        """
        return self.set_all({key: value})

    def set_all(self, values: Mapping[str, Any]) -> Self:
        """The scenario with several keys set at once, such as a section's kind together with the keys of that kind."""
        return self.load(self.model_dump(mode="json", by_alias=True, exclude_unset=True), values)

    def plain(self) -> dict[str, Any]:
        """All keys that have a value, defaults too, as nested dicts, lists, numbers and text."""
        written = self.model_dump(mode="json", by_alias=True, exclude_none=True)
        for target, values in zip(self.targets, written["targets"], strict=True):
            for name in {"step_s", "steps"} - target.model_fields_set:  # the first target's values count
                values.pop(name, None)
        return {name: value for name, value in written.items() if value != []}

    def to_toml(self) -> str:
        """The same scenario as a file, with every default written out and every key explained."""
        document = tomlkit.document()
        for name, value in self.plain().items():
            if name in top_level():
                document.add(name, _setting(top_level()[name], value))
                continue
            section = sections_of_file()[name]
            document.add(tomlkit.nl())
            if section.many:
                tables = tomlkit.aot()
                for one in value:
                    tables.append(_table(section, one))
                document.add(name, tables)
            else:
                document.add(name, _table(section, value))
        return tomlkit.dumps(document)


def schema() -> dict[str, Any]:
    """The JSON schema of scenario files, for editors."""
    return Scenario.model_json_schema(by_alias=True)


def _written(source: str | Path | Mapping[str, Any]) -> tuple[dict[str, Any], str, str]:
    """The contents of a source, its file and that file's text; both are empty for a dict. Raises ``ScenarioError``."""
    if isinstance(source, Mapping):
        check_values(source)
        return _anchored(source, Path.cwd()), "", ""
    file = _file_of(source)
    data, text = read_toml(file)
    check_values(data, str(file))
    return _anchored(data, file.parent), str(file), text


def _file_of(source: str | Path) -> Path:
    if not isinstance(source, str | Path):
        raise ScenarioError(f"is {quoted(source)}", key="scenario", expected="the name, file or contents of one")
    file = Path(source)
    if isinstance(source, str):
        if source in names() or source in ALIASES:
            return packaged_file(source)
        if file.suffix != ".toml" and not _exists(file):
            what = f"unknown scenario {quoted(source)}{suggestion(source, names())}"
            raise ScenarioError(what, expected=f"one of {', '.join(names())}, or a TOML file")
    return file


def _exists(file: Path) -> bool:
    try:
        return file.exists()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _anchored(data: Mapping[str, Any], base: Path) -> dict[str, Any]:
    """The same, with the files that it names as absolute paths."""
    return {name: _with_files(part, base, FILES.get(name, ())) for name, part in data.items()}


def _with_files(part: Any, base: Path, keys: Sequence[str]) -> Any:
    """A section, or a list of them, with its files as absolute paths; anything else unchanged.

    A file that is not there, but comes with Trackfield, is that one.
    """
    if isinstance(part, list | tuple):
        return [_with_files(one, base, keys) for one in part]
    if not isinstance(part, Mapping):
        return part
    found = dict(part)
    for key in keys:
        if isinstance(name := part.get(key), str) and name:
            file, packaged = (base / name).absolute(), packaged_data(name)
            found[key] = str(file if packaged is None or file.exists() else packaged)
    return found


def _tuples(value: Any) -> Any:
    """Lists as tuples throughout: a scenario is immutable."""
    if isinstance(value, Mapping):
        return {key: _tuples(item) for key, item in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _table(section: Kinds, values: Mapping[str, Any]) -> Table:
    """A section as TOML, the key that names its kind first."""
    keys, table = section.keys(values.get(section.tag)), tomlkit.table()
    for key in sorted(values, key=lambda key: key != section.tag):
        table.add(key, _setting(keys.get(key) or own_option(key), values[key]))
    return table


def _setting(key: Key, value: Any) -> Item:
    """The value as TOML, followed by what the key means, in a column where it fits."""
    item: Item = tomlkit.item(value)
    if isinstance(value, Mapping):
        item = tomlkit.inline_table()
        item.update(value)
    item.comment(key.meaning)
    item.trivia.comment_ws = " " * max(2, 36 - len(f"{key.name} = {item.as_string()}"))
    return item
