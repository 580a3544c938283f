"""Files: whether one that a user names can be written, and how those of a run are, whatever the disk does."""

from __future__ import annotations

import fcntl
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from errno import EDQUOT, EIO, ENOSPC
from pathlib import Path
from typing import Final

from trackfield.errors import RunFailed, ScenarioError

RETRY_S: Final = 5.0
"""How long a disk that takes nothing is given, at the end of a run, until that is an error."""
RETRY_EVERY_S: Final = 0.25
_MAY_PASS: Final = (ENOSPC, EDQUOT, EIO)

LOG: Final = "record.log"
"""In the folder of a run, what it has recorded so far."""
MANIFEST: Final = "manifest.json"
"""In the folder of a run or a study, what it was made with."""
SCENARIO: Final = "scenario.toml"
"""In such a folder, the scenario, every default written out."""
TRACKS_TABLE: Final = "tracks.parquet"
MESSAGES_TABLE: Final = "messages.parquet"
"""The tables of a run; a study has the first of them, too."""
CAMERA: Final = "camera.json"
"""In the folder of a run with a camera, what its processes told of it."""
PLACES: Final = "places.json"
"""In the folder of a run with planned faults of containers, which host has which place, and when it began."""
CONTAINERS: Final = "containers.log"
"""In such a folder, what was done to containers, and when: ``containers/faults.py`` writes it."""


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


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """A file beside this one to write to, which takes its place at the end: it is whole, or as it was before."""
    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(file)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def write_whole(file: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with whole_file(file) as part:
        part.write_text(text, encoding="utf-8")


def patiently(write: Callable[[], object], what: str) -> None:
    """Write ``what``, again and again while the disk is full or fails.

    Raises ``RunFailed`` if that lasts ``RETRY_S``, or if it cannot be written for another reason.
    """
    deadline = time.monotonic() + RETRY_S
    while True:
        try:
            write()
            return
        except OSError as error:
            if time.monotonic() >= deadline or error.errno not in _MAY_PASS:
                raise RunFailed(f"{what} could not be written ({reason(error)})") from None
        time.sleep(RETRY_EVERY_S)


def reason(error: OSError) -> str:
    """Why a file could not be written, in the words of the system alone: Arrow's own are a paragraph."""
    return os.strerror(error.errno) if error.errno else str(error)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder's lock, as a run does in its own until all is written. Raises ``BlockingIOError`` if it is held.

    Where the file system has no such locks nothing is held. Processes that are started meanwhile do not have it.
    """
    held = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        lock(held)
        yield
    finally:
        os.close(held)


def lock(file: int) -> None:
    """Lock an open file as long as it is open, if its file system can. Raises ``BlockingIOError`` if it is locked."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # not every file system has locks
        pass


class PatientFile:
    """A new file to which bytes are appended; what the disk does not take is kept and tried again.

    It is locked as long as it is open.

    ``error`` is why the last attempt failed (None: nothing is left to write). Not thread-safe.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.error: OSError | None = None
        self._open: int | None = None
        self._kept = bytearray()

    def append(self, data: bytes) -> None:
        """Keep these bytes for the next attempt."""
        self._kept += data

    def flush(self) -> None:
        """Write what is kept, as far as possible; sets ``error`` and never raises an ``OSError``."""
        try:
            if self._open is None:
                self._open = os.open(self.file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
                with suppress(BlockingIOError):
                    lock(self._open)
            while self._kept:
                del self._kept[: os.write(self._open, self._kept)]
            self.error = None
        except OSError as error:
            self.error = error

    def close(self) -> None:
        """Write the rest, patiently. Raises ``RunFailed`` if the disk does not take it."""
        try:
            patiently(self._insist, str(self.file))
        finally:
            if self._open is not None:
                os.close(self._open)
                self._open = None

    def _insist(self) -> None:
        self.flush()
        if self.error:
            raise self.error
