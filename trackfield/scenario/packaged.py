"""The scenarios that come with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Final

ALIASES: Final = {"spcpf": "zhai-spcpf"}
"""Former names, under which packaged scenarios still load."""

_DATA: Final = (".gpx", ".gz", ".csv")
_FOLDER: Final = Path(__file__).parent


def names() -> tuple[str, ...]:
    """The names of all packaged scenarios."""
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.toml")))


def packaged_file(name: str) -> Path:
    """The file of the packaged scenario ``name``, which may be a former name of it."""
    return _FOLDER / f"{ALIASES.get(name, name)}.toml"


def packaged_data(name: str) -> Path | None:
    """The file of this name that comes with the packaged scenarios, such as a recording; None if there is none."""
    return next((file for file in _FOLDER.iterdir() if file.name == name and file.suffix in _DATA), None)


def or_packaged(file: Path) -> Path:
    """The file; one that is not there, but comes with the packaged scenarios, is that one."""
    packaged = packaged_data(str(file))
    return file if packaged is None or file.exists() else packaged


def summary(name: str) -> str:
    """One line that describes the packaged scenario ``name``: its file's first comment."""
    return packaged_file(name).read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")
