"""Text files that users give: read whole, as far as they are files, text, and of a sensible size.

Also the limits of lengths and times, the same in scenarios and in these files. Only the standard library: nodes use it.
"""

from __future__ import annotations

import errno
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Final

MIB: Final = 1 << 20
DATA: Final = 64 * MIB
"""The largest file of positions, fixes, or frames of a link."""
FAR_M: Final = 1e7
"""The largest length and coordinate: a quarter of the way around the earth."""
LONG_S: Final = 1e9
"""The latest time; no run lasts that long."""
SLOW_MS: Final = 3_600_000
"""The longest delay of a frame: an hour."""


def read_text(file: Path, most: int = DATA) -> str:
    """The text of a file of at most so many bytes, in UTF-8, with or without a byte order mark; line ends as they are.

    Raises ``OSError`` if it cannot be read, is no regular file (such as a device, which may never end) or is larger;
    ``ValueError`` if it is not text, with the line.
    """
    try:
        mode = file.stat().st_mode
    except ValueError as error:  # a NUL in its name
        raise OSError(errno.EINVAL, str(error)) from None
    if not S_ISREG(mode):
        raise OSError(errno.EISDIR, "Is a directory") if S_ISDIR(mode) else OSError(errno.EINVAL, "not a regular file")
    with file.open("rb") as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"it has more than {most / MIB:g} MiB")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line}: the byte 0x{content[error.start]:02x} is not text in UTF-8") from None
    if (at := text.find("\0")) >= 0:
        line = text.count("\n", 0, at) + 1
        raise ValueError(f"line {line}: the byte 0x00 is not text")
    return text
