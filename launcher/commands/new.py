"""``new``: a scenario file to start from."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from launcher.commands import choices
from trackfield.errors import ScenarioError

if TYPE_CHECKING:
    from trackfield.scenario import Scenario

COMMENT_AT: Final = 36
"""The column of the comments, as in the files that Trackfield writes."""
LISTED: Final = {
    "field": ("layout", "layouts"),
    "sensor": ("kind", "sensors"),
    "target": ("path", "paths"),
    "link": ("model", "links"),
    "architecture": ("kind", "architectures"),
    "fusion": ("trackers", "trackers"),
}
"""Keys that name things, by section, and what ``list`` calls those."""
MORE: Final = """
# More sections, any number of each:
# [[targets]]                       # more targets, each with an id and keys as in [target] (trackfield list paths)
# [[faults]]                        # what goes wrong, where and when (trackfield list faults)
"""


def new(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The file to write, ending in .toml; it must not exist yet.")
    ],
    source: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="SCENARIO",
            autocompletion=choices.completed(choices.scenarios),
            help="The scenario to start from: {scenarios}, or a TOML file.",
        ),
    ] = "zhai-spcpf",
) -> None:
    """Write a scenario file to start from, with every key explained, and copies of the files that it names."""
    from launcher.show import program, tell

    for written in _write(file, source):
        tell(f"wrote {written}")
    name = shlex.quote(str(file))
    tell(f"next: {program()} validate {name}")
    tell(f"      {program()} run {name} --virtual")
    tell(f"      {program()} study {name} --seeds 10")


def _write(file: Path, source: str) -> list[Path]:
    """Write the file and those that it names beside it, or nothing: the paths, the file itself first.

    Raises ``ScenarioError`` for an unknown source, for a name that cannot be that of a scenario, and if one of the
    files exists already or cannot be written.
    """
    from tempfile import TemporaryDirectory

    from launcher.record.folder import with_files
    from trackfield.scenario import Scenario

    if file.suffix != ".toml":
        raise ScenarioError("does not end in .toml", file=str(file), key="FILE", expected=f"{file.stem}.toml")
    scenario = Scenario.load(source).set("name", file.stem)
    with TemporaryDirectory() as made:
        text = _explained(with_files(scenario, Path(made), f"{file.stem}-"), source)
        draft = Path(made) / file.name
        draft.write_text(text, encoding="utf-8")
        Scenario.load(draft)
        drafts = [draft, *sorted(set(Path(made).iterdir()) - {draft})]
        targets = [file.with_name(one.name) for one in drafts]
        for target in targets:
            if target.exists():
                raise ScenarioError("exists already", file=str(target), key="FILE", expected="a new file")
        try:
            for one, target in zip(drafts, targets, strict=True):
                target.write_bytes(one.read_bytes())
        except OSError as error:
            what = f"cannot be written ({error.strerror})"
            raise ScenarioError(what, file=str(target), key="FILE", expected="a file in a writable folder") from None
    return targets


def _explained(scenario: Scenario, source: str) -> str:
    """The text of the scenario file, with keys that have no value as comments, and where to find other kinds."""
    name = f"{scenario.name}.toml"
    lines = [
        f"# Started from {source}.",
        "#",
        f"# Check it:                         trackfield validate {name}",
        f"# Run it:                           trackfield run {name} --virtual",
        "# All keys and their ranges:        docs/scenarios.md",
        "",
    ]
    section, given = "", dict[str, str]()
    for line in scenario.to_toml().splitlines():
        if header := re.fullmatch(r"\[\[?([\w.-]+)\]\]?", line):
            lines += [*_left_out(section, given), ""]
            section, given = header[1], {}
        if setting := re.match(r"([\w-]+) = ", line):
            given[setting[1]] = line
        if line:
            lines.append(line)
    return "\n".join([*lines, *_left_out(section, given)]) + f"\n{MORE}"


def _left_out(section: str, given: Mapping[str, str]) -> Iterator[str]:
    """Comments for the keys of a section that are not ``given``, and where others of its kinds are listed.

    ``given`` are its lines by their keys; that of the section's kind says which keys it may have.
    """
    from trackfield.scenario.keys import sections_of_file

    if section not in sections_of_file():
        return
    kinds = sections_of_file()[section]
    kind = tomllib.loads(given[kinds.tag])[kinds.tag] if kinds.tag in given else None
    for key in kinds.keys(kind).values():
        if key.name not in given:
            yield f"{f'# {key.name} = ...':{COMMENT_AT}}# {key.meaning} ({key.expected})"
    if section in LISTED:
        key_name, kind_name = LISTED[section]
        yield f"{f'# {key_name} = ...':{COMMENT_AT}}# others: trackfield list {kind_name}"
