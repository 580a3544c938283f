"""The file of a timeline, written through a pipe.

Rerun's own file sink ends at the first error, such as a full disk: all later data is lost, flushing takes five seconds
each time, and ending the program does not end. So Rerun writes to a pipe, which never fails, and a thread here writes
what comes out of it to the file; what the disk does not take is kept and tried again.
"""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread
from typing import Final

import rerun as rr

from launcher.files import PatientFile

CHUNK: Final = 1 << 16


class TimelineFile:
    """A file as a sink for Rerun."""

    def __init__(self, file: Path) -> None:
        self._file = PatientFile(file)
        self._out, self._into = os.pipe()
        self._thread = Thread(target=self._copy, name="timeline", daemon=True)

    def sink(self) -> rr.FileSink:
        """Where Rerun is to write; ``begun`` is to be called when it has opened it."""
        return rr.FileSink(f"/dev/fd/{self._into}")

    def begun(self) -> None:
        """Rerun has opened its end: the file ends when Rerun closes it."""
        os.close(self._into)
        self._thread.start()

    def close(self) -> None:
        """Wait until all is written, after Rerun has closed its end. Raises ``RunFailed`` if the disk is full."""
        self._thread.join()
        os.close(self._out)
        self._file.close()

    def _copy(self) -> None:
        while data := os.read(self._out, CHUNK):
            self._file.append(data)
            self._file.flush()
