"""Which scenario a run folder is of: the digest of scenario.toml and the files that it names, kept in the manifest."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

from trackfield.errors import ScenarioError

SCENARIO: Final = "scenario.toml"
MANIFEST: Final = "manifest.json"
_NAMES: Final = "file"
"""The key of a section that names a file."""


def scenario_digest(folder: Path) -> str:
    """Of the scenario in a run folder, empty if there is none. Raises ``ValueError`` if a file is missing."""
    toml = folder / SCENARIO
    if not toml.exists():
        return ""
    content = toml.read_bytes()
    digest = blake2b(content, digest_size=16)
    for name in sorted(set(_files(tomllib.loads(content.decode())))):
        copy = folder / name
        if copy.parent != folder or not copy.is_file():
            raise ValueError(f"{name} is not in the folder")
        digest.update(name.encode() + b"\0" + copy.read_bytes())
    return digest.hexdigest()


def check_scenario(folder: Path) -> None:
    """Raise ``ScenarioError`` unless the scenario in a run folder is the one that ran."""
    try:
        manifest = json.loads((folder / MANIFEST).read_bytes())
    except (OSError, ValueError) as error:
        what = f"has no {MANIFEST}" if isinstance(error, OSError) else f"its {MANIFEST} is damaged"
        raise ScenarioError(what, file=str(folder), expected="the folder of a run") from None
    ran = manifest.get("scenario") if isinstance(manifest, dict) else None
    try:
        found = scenario_digest(folder)
    except (OSError, ValueError, RecursionError):
        found = ""
    if not isinstance(ran, str) or not ran or found != ran:
        what = "is not the scenario of this run: it, or a file that it names, was changed afterwards"
        expected = f"it as it was; trackfield run {folder / SCENARIO} runs the changed one"
        raise ScenarioError(what, file=str(folder / SCENARIO), expected=expected)


def _files(table: Any) -> Iterator[str]:
    """The files that a scenario names, in any section of it."""
    if isinstance(table, dict):
        if isinstance(table.get(_NAMES), str):
            yield table[_NAMES]
        table = list(table.values())
    if isinstance(table, list):
        for item in table:
            yield from _files(item)
