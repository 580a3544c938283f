"""record.log: all that the recorder accepted, in the order in which it came, on disk at most a second later.

The ledger is a function of these entries, so tables, metrics and timeline can be made from them again if the recorder
dies. The file is ``MAGIC``, then entries. Each is its length and the CRC-32 of length and content (4 bytes each, little
endian), then the content, MessagePack of ``[key, payload, attachment]``. So a torn or damaged end is recognised, and
what precedes it is read. Entries of one ``flush`` follow a mark, with the time up to which all was heard.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from struct import Struct
from typing import BinaryIO, Final, NamedTuple
from zlib import crc32

import msgpack

from launcher.files import LOG, PatientFile, reason

MAGIC: Final = b"trackfield record 1\n"
MARK: Final = "record/mark"
"""The key of a mark; its payload is the emulated time in ns, decimal. It is none of Zenoh's."""
REFUSED: Final = "record/refused"
"""The key of how many samples were refused since the last mark: MessagePack of a list of (plane, reason, how many)."""
_HEAD: Final = Struct("<II")
_LENGTH: Final = Struct("<I")


class Entry(NamedTuple):
    """A sample as it came."""

    key: str
    payload: bytes
    attachment: bytes | None = None


class Log:
    """Writes the log of a run. What the disk does not take is kept, and tried again at the next flush.

    ``outages`` says when that was: (emulated ns from, until, why); until is None while it lasts.
    """

    def __init__(self, folder: Path) -> None:
        self.outages: list[tuple[int, int | None, str]] = []
        self._file = PatientFile(folder / LOG)
        self._file.append(MAGIC)
        self._entries = bytearray()
        self._refused: Counter[tuple[str, str]] = Counter()

    def append(self, entry: Entry) -> None:
        """Add an entry; it is written at the next flush."""
        self._entries += frame(entry)

    def refused(self, key: str, reason: str) -> None:
        """Count a sample that was not accepted."""
        self._refused[key.partition("/")[0], reason] += 1

    def flush(self, now_ns: int | None) -> None:
        """Write what came; ``now_ns`` is the emulated time up to which all was heard (None: before the start)."""
        if now_ns is not None:
            self._file.append(frame(Entry(MARK, b"%d" % now_ns)))
        if self._refused:
            self.append(Entry(REFUSED, msgpack.packb([(*of, n) for of, n in self._refused.items()])))
            self._refused.clear()
        self._file.append(bytes(self._entries))
        self._entries.clear()
        self._file.flush()
        self._note(now_ns or 0)

    def _note(self, now_ns: int) -> None:
        begun = self.outages[-1] if self.outages and self.outages[-1][1] is None else None
        if self._file.error and begun is None:
            self.outages.append((now_ns, None, reason(self._file.error)))
        elif begun and not self._file.error:
            self.outages[-1] = (begun[0], now_ns, begun[2])

    def remove(self) -> None:
        """Remove the file: its content is in the tables."""
        self._file.file.unlink(missing_ok=True)


def frame(entry: Entry) -> bytes:
    """An entry as it stands in the file."""
    content: bytes = msgpack.packb(entry)
    length = len(content)
    return _HEAD.pack(length, crc32(content, crc32(_LENGTH.pack(length)))) + content


class Reading:
    """The entries of a log, one after the other; ``damaged`` says, at the end, that what followed cannot be read.

    Raises ``OSError`` if the file cannot be read at all.
    """

    def __init__(self, file: Path) -> None:
        self.file, self.damaged = file, False

    def __iter__(self) -> Iterator[Entry]:
        with self.file.open("rb") as log:
            size = self.file.stat().st_size
            self.damaged = log.read(len(MAGIC)) != MAGIC
            while not self.damaged and log.tell() < size:
                entry = _next(log, size)
                if entry is None:
                    self.damaged = True
                else:
                    yield entry


def _next(log: BinaryIO, size: int) -> Entry | None:
    """The entry that begins here; None if it is torn or damaged."""
    head = log.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    length, check = _HEAD.unpack(head)
    if length > size - log.tell():
        return None
    content = log.read(length)
    if len(content) < length or crc32(content, crc32(head[: _LENGTH.size])) != check:
        return None
    try:
        key, payload, attachment = msgpack.unpackb(content)
    except (ValueError, TypeError, msgpack.UnpackException):
        return None  # by hand, with a matching check
    whole = isinstance(key, str) and isinstance(payload, bytes) and isinstance(attachment, bytes | None)
    return Entry(key, payload, attachment) if whole else None
