"""Files that users name for what a command writes."""

from __future__ import annotations

from pathlib import Path

from trackfield.errors import ScenarioError


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
