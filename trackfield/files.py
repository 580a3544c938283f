"""Text files that users give: read whole, as far as they are files, text, and of a sensible size.

Also the limits of lengths and times, the same in scenarios and in these files. Only the standard library: nodes use it.
"""

from __future__ import annotations

import errno
import io
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
GZIP: Final = b"\x1f\x8b"
"""How gzip data begins."""


def read_text(file: Path, most: int = DATA) -> str:
    """The text of a file of at most so many bytes, in UTF-8, with or without a byte order mark; line ends as they are.

    Raises ``OSError`` as ``read_bytes`` does; ``ValueError`` if it is not text, with the line.
    """
    return text_of(read_bytes(file, most))


def read_bytes(file: Path, most: int = DATA) -> bytes:
    """The content of a file of at most so many bytes.

    Raises ``OSError`` if it cannot be read, is no regular file (such as a device, which may never end) or is larger.
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
    return content


def unpacked(content: bytes, most: int = DATA) -> bytes:
    """The content of a gzip file, of at most so many bytes; other content as it is.

    Raises ``ValueError`` if it is damaged, cut off or larger.
    """
    if not content.startswith(GZIP):
        return content
    import gzip
    import zlib

    try:
        with gzip.GzipFile(fileobj=io.BytesIO(content)) as stream:
            whole = stream.read(most + 1)
    except EOFError:
        raise ValueError("is cut off: the end of its gzip data is missing") from None
    except (OSError, zlib.error) as error:
        raise ValueError(f"has damaged gzip data ({error})") from None
    if len(whole) > most:
        raise ValueError(f"has more than {most / MIB:g} MiB when unpacked")
    return whole


def text_of(content: bytes) -> str:
    """The text of a file's content in UTF-8. Raises ``ValueError`` if it is not text, with the line."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line}: the byte 0x{content[error.start]:02x} is not text in UTF-8") from None
    if (at := text.find("\0")) >= 0:
        line = text.count("\n", 0, at) + 1
        raise ValueError(f"line {line}: the byte 0x00 is not text")
    return text
