"""Where the router of a run listens, the session by it, and a router by itself."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import Final

import zenoh
from setproctitle import setproctitle

from launcher.signals import handling
from trackfield.drivers.session import open_client, open_router
from trackfield.errors import RunFailed

PREFIX: Final = "trackfield-run-"
_NAME: Final = "router.sock"
_PLAIN: Final = re.compile(r"[A-Za-z0-9._+/-]+")
"""Paths that mean the same in an endpoint of Zenoh, where ``?`` and ``#`` begin other parts."""
_ROOM: Final = 70
"""Bytes of the path of a folder for temporary files: a socket's path has 107 at most."""
_YOUNG_S: Final = 60.0
"""A folder that is younger is left alone: whoever made it may not have locked it yet."""


class SocketFolder:
    """A folder for the socket of one run's router, which is locked for as long as its launcher lives.

    Raises ``RunFailed`` if there is no place for one. Folders of launchers that were killed are removed.
    """

    def __init__(self) -> None:
        self.path = _new_folder()
        self.endpoint = f"unixsock-stream/{self.path / _NAME}"
        self._lock = os.open(self.path, os.O_RDONLY)
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        _sweep(self.path.parent)

    def clear(self) -> None:
        """Remove what was left by a router that was killed."""
        for left in self.path.iterdir():
            left.unlink()

    def close(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)


def session_by(endpoint: str, run: str, timeout_s: float) -> zenoh.Session:
    """A session in this run by the router at ``endpoint``. Raises ``RunFailed`` if none answers."""
    try:
        return open_client(endpoint, run, timeout_s)
    except zenoh.ZError as error:
        what = f"no Zenoh router answers at {endpoint} (or it refuses the credentials of this process)"
        raise RunFailed(f"{what}: {str(error).partition(' at /')[0]}") from None


def serve(endpoints: Sequence[str]) -> None:
    """Be the router at these endpoints until it is told to end. Raises ``RunFailed`` if it cannot listen there."""
    done = Event()
    setproctitle("trackfield router")
    places = ", ".join(endpoints)
    try:
        router = open_router(*endpoints)
    except zenoh.ZError as error:
        raise RunFailed(f"cannot listen at {places}: {str(error).partition(' at /')[0]}") from None
    with handling(lambda _: done.set()):
        print(f"router at {places}", file=sys.stderr)
        done.wait()
    router.close()  # type: ignore[no-untyped-call]


def _new_folder() -> Path:
    """A new folder in the first place where there can be a socket."""
    for place in _places():
        if len(place) > _ROOM or not _PLAIN.fullmatch(place):
            continue
        with suppress(OSError):
            folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=place))
            try:
                with socket.socket(socket.AF_UNIX) as trial:
                    trial.bind(str(folder / _NAME))
                (folder / _NAME).unlink()
            except OSError:
                shutil.rmtree(folder, ignore_errors=True)
                raise
            return folder
    raise RunFailed(
        f"there is no place for the router's socket, not in {', '.join(_places())}: set TMPDIR to a folder that can be "
        f"written, whose path has at most {_ROOM} bytes, and of these only A-Z a-z 0-9 . _ + - /"
    )


def _places() -> Iterator[str]:
    with suppress(OSError):  # there is none
        yield tempfile.gettempdir()
    if own := os.environ.get("XDG_RUNTIME_DIR"):
        yield own
    yield from ("/tmp", "/var/tmp", "/dev/shm")


def _sweep(place: Path) -> None:
    """Remove the folders there whose launchers are dead."""
    for folder in place.glob(f"{PREFIX}*"):
        with suppress(OSError):  # another user's, in use, or removed by another launcher
            if time.time() - folder.stat().st_mtime < _YOUNG_S:
                continue
            lock = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)
