"""Files that users name for what a command writes; what finishes a run that was killed."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from trackfield.errors import ScenarioError

LOG: Final = "record.log"
"""In the folder of a run, what it has recorded so far."""


def check_writable(file: Path, key: str) -> None:
    """Raise ``ScenarioError`` unless this file can be written; ``key`` is the option that names it."""
    is_new = not file.exists()
    try:
        file.open("ab").close()
    except OSError as error:
        what = f"cannot be written ({error.strerror})"
        raise ScenarioError(what, file=str(file), key=key, expected="a file in a writable folder") from None
    if is_new:
        file.unlink()


def recovering(folder: Path) -> str:
    """What finishes a run in this folder that was killed, to be added to what is expected; nothing if nothing does."""
    return f"; trackfield recover {folder} finishes it" if (folder / LOG).exists() else ""


def check_text(arguments: Iterable[str], key: str = "") -> None:
    """Raise ``ScenarioError`` for one that is not text, as a file's name need not be; ``key`` is the option's name."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            encoding = sys.getfilesystemencoding()
            text = "UTF-8" if encoding == "utf-8" else f"text in the encoding of the locale ({encoding})"
            raise ScenarioError(f"{argument!a} is not text", key=key, expected=text) from None
