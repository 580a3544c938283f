"""Where the router of a run is, the session by it, and a router by itself."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any, Final

import zenoh
from setproctitle import setproctitle

from launcher.processes import patience
from launcher.records import ROUTER
from launcher.security.guard import guarded
from launcher.signals import handling, wait_for
from trackfield.drivers.joining.credentials import refusal
from trackfield.drivers.session import Credentials, client_settings, open_session, router_settings
from trackfield.errors import RunFailed

if TYPE_CHECKING:
    from launcher.security.security import Security  # loads what makes certificates

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
        with suppress(OSError):  # not every file system has locks
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


@dataclass(frozen=True, slots=True)
class Way:
    """How the processes of a run reach each other: by the router at ``endpoint``, or, if that is empty, by the run's
    own, which also listens at ``listen`` for those that start elsewhere. With ``security`` all show certificates.
    """

    endpoint: str = ""
    listen: tuple[str, ...] = ()
    security: Security | None = None


class Door:
    """The router of a run as its processes see it; with the place of its socket, if it is the run's ``own``.

    ``endpoint`` is where they reach it, ``secured`` whether they show certificates. Raises ``RunFailed`` if there is no
    place for a socket.
    """

    def __init__(self, way: Way, run: str) -> None:
        self._run, self._listen, self._security = run, way.listen, way.security
        self.own = not way.endpoint
        self.secured = way.security is not None
        self._sockets = SocketFolder() if self.own and not way.security else None
        own = self._sockets.endpoint if self._sockets else _secured_endpoint()
        self.endpoint = way.endpoint or own
        self.folder = str(self._sockets.path) if self._sockets else ""

    def settings(self, name: str, timeout_s: float = 60.0) -> str:
        """The settings of a session of the process of this name."""
        return client_settings(self.endpoint, self._run, timeout_s, self._credentials(name))

    def session(self, name: str, timeout_s: float) -> zenoh.Session:
        """A session of the process of this name. Raises ``RunFailed`` if no router answers."""
        return session_by(self.endpoint, self.settings(name, timeout_s), self._credentials(name))

    def router(self) -> str:
        """The settings of the run's own router, whose socket is free now."""
        if self._sockets:
            self._sockets.clear()
        more = self._security.settings if self._security else {}
        return router_settings([self.endpoint, *self._listen], self._credentials(ROUTER), more=more)

    def _credentials(self, name: str) -> Credentials | None:
        return self._security.credentials(name) if self._security else None

    def close(self) -> None:
        """Remove what is left of it."""
        if self._sockets:
            self._sockets.close()


def _secured_endpoint() -> str:
    """A place on this machine alone; a socket in a folder cannot be secured."""
    from launcher.timeline.view import free_port

    return f"tls/127.0.0.1:{free_port()}"


def session_by(endpoint: str, settings: str, credentials: Credentials | None = None) -> zenoh.Session:
    """A session with these settings, by the router at ``endpoint``. Raises ``RunFailed`` if none answers."""
    try:
        return open_session(settings)
    except zenoh.ZError as error:
        why = refusal(endpoint, credentials) or str(error).partition(" at /")[0]
        raise RunFailed(f"no Zenoh router answers at {endpoint}: {why}") from None


def patiently(opened: Callable[[], zenoh.Session], look: Callable[[], None]) -> zenoh.Session:
    """A session by a router that is being started; after each attempt, ``look`` sees whether it still is.

    Raises what that raises, or ``RunFailed`` if the router is not ready in time.
    """
    deadline = time.monotonic() + patience.READY_TIMEOUT_S
    while True:
        try:
            return opened()
        except RunFailed:
            look()
            if time.monotonic() > deadline:
                raise


def serve(
    endpoints: Sequence[str], credentials: Credentials | None = None, more: Mapping[str, Any] | None = None
) -> None:
    """Be the router at these endpoints, with ``more`` settings by their paths, until it is told to end.

    Raises ``RunFailed`` if it cannot listen there.
    """
    done = Event()
    router = guarded(router_settings(endpoints, credentials, more=more), say=True)
    setproctitle("trackfield router")
    with handling(lambda _: done.set()):
        print(f"router at {', '.join(endpoints)}", file=sys.stderr)
        wait_for(done)
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
            lock = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)
