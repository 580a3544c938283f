"""A slice: the router of its host, and the processes of its share of the field, forked, watched and ended with the run.

Its router has one link to that of the run, and all its processes have theirs to this router. It owns no more than that:
when the run starts, what is told to whom and what becomes of it is for the launcher to say.
"""

from __future__ import annotations

import socket
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final

import zenoh
from zenoh.handlers import Callback

from launcher.processes import patience
from launcher.processes.children import WITH_ZYGOTE, ZYGOTES, Children
from launcher.processes.deployment import GOOD_END
from launcher.processes.endpoint import SocketFolder, patiently, session_by
from launcher.processes.preload import REHEARSAL, preload_of
from launcher.processes.together import Together
from launcher.processes.watch import Watch
from launcher.processes.zygote import Child
from launcher.records import ROUTER
from launcher.slices.asking import Asking, Given
from trackfield.drivers.exchange.intake import begun, nanoseconds, opened
from trackfield.drivers.hostclock import HostClock
from trackfield.drivers.joining.ask import JoinError
from trackfield.drivers.joining.clock import keep_clock, set_clock
from trackfield.drivers.session import client_settings, router_settings
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import RunFailed
from trackfield.wire import keys
from trackfield.wire.error import WireError

AWAY_S: Final = 30.0
"""How long the launcher may be out of reach."""
MEMBER: Final = "launcher.slices.member"
"""What its processes run, which the zygotes import for them."""
CLOCK: Final = "clock"
"""The file with the offset of this host's clock, beside the router's socket."""


class Slice(Together):
    """The processes of a share of a field, as a context manager that leaves none of them behind.

    Logs go to ``folder``; the router's link is to the one at ``upstream``. ``deaths`` are those that were not planned.
    Raises ``RunFailed`` if it cannot be started, ``JoinError`` if another has its place, ``ClockError``.
    """

    def __init__(self, asking: Asking, given: Given, folder: Path, upstream: str) -> None:
        self.given, self.folder = given, folder
        self._asking, self._upstream = asking, upstream
        self._lives = {life.name: life for life in given.lives}
        self._preload = preload_of(given.lives)
        self._start_ns, self._end_ns, self._stopping = given.start_ns, given.end_ns, False
        self._restarts: Counter[str] = Counter()
        self._launchers: set[str] = set()
        self._seen = time.monotonic()
        self._sockets = SocketFolder()

    def _start(self) -> None:
        (self.folder / "logs").mkdir(parents=True, exist_ok=True)
        self._children = Children(len(self._lives) + 1, *self._preloads())
        self._watch = Watch(self._children, self._now_s)
        self.deaths = self._watch.deaths
        self._fork_router()
        self._connect()
        for life in sorted(self._lives.values(), key=self._preload.is_heavy):
            self._fork(life)

    def _clear(self) -> None:
        self._sockets.close()

    def _preloads(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """What the zygotes import, and what the light one does for its children."""
        light, heavy, _ = self._preload
        imported = tuple(one for one in light if one != REHEARSAL)
        once = f"{MEMBER}:rehearse" if REHEARSAL in light else MEMBER
        return (*imported, once), (*heavy, MEMBER) if heavy else ()

    # --- birth ----------------------------------------------------------------------------------------------------

    def _fork_router(self) -> None:
        for left in self._sockets.path.glob("*.sock*"):  # of one that was killed
            left.unlink()
        router = Child("launcher.processes.bodies:router", ROUTER, str(self.log(ROUTER)))
        own, credentials = [self._sockets.endpoint], self.given.credentials
        self._children.fork(ROUTER, router, router_settings(own, credentials, upstream=self._upstream))

    def _connect(self) -> None:
        """Set the clock, show the token, and have it confirmed; then hear the launcher's orders."""
        settings = client_settings(self._sockets.endpoint, self.given.run, patience.NEEDED_STILL_S)
        self.session = patiently(partial(session_by, self._sockets.endpoint, settings), self._look_for_router)
        self._clock = HostClock(self._sockets.path / CLOCK)
        read = set_clock(self.session, self._clock, self._asking.seal, self._asking.refused)
        self._held = [
            self.session.liveliness().declare_token(self._asking.token(self.given)),
            self.session.liveliness().declare_subscriber(
                f"{keys.LAUNCHER}/*", Callback(self._on_launcher, indirect=False), history=True
            ),
            self.session.declare_subscriber(keys.ORDERS, Callback(self._on_order, indirect=False)),
        ]
        self._asking.confirm(self.session, self.given)
        if read:
            keep_clock(self.session, self._clock, self._asking.seal, read)

    def _look_for_router(self) -> None:
        for name, why in self._watch.look():
            raise self.failure(f"{name} died at start ({why})", name)

    def _fork(self, life: ProcessSpec) -> None:
        title = f"{life.role} {life.name}"
        niceness = 0 if life.sink else patience.NICENESS
        heavy = self._preload.is_heavy(life)
        body = Child(f"{MEMBER}:live", title, str(self.log(life.name)), heavy=heavy)
        settings = client_settings(self._sockets.endpoint, self.given.run)
        own = life.factory, dict(self.given.places), self._asking.seal.token, str(self._sockets.path / CLOCK)
        self._children.fork(life.name, body, settings, life.role, life.name, niceness, *own)

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _on_launcher(self, sample: zenoh.Sample) -> None:
        here = sample.kind == zenoh.SampleKind.PUT
        (self._launchers.add if here else self._launchers.discard)(str(sample.key_expr))

    def _on_order(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the processes count it
            key, order = str(sample.key_expr), opened(sample, self._asking.seal)
            if key == keys.START:
                self._start_ns = begun(self._start_ns, order)
            elif key == keys.END:
                self._end_ns = min(self._end_ns, nanoseconds(order))
            elif key == keys.STOP:
                self._stopping = True

    # --- life -----------------------------------------------------------------------------------------------------

    def _now_ns(self) -> int | None:
        """Emulated time (None: before the start)."""
        if self._start_ns is None:
            return None
        return max(round((self._clock.now_ns() - self._start_ns) * self.given.speed), 0)

    def _now_s(self) -> float | None:
        now_ns = self._now_ns()
        return None if now_ns is None else now_ns / 1e9

    def watch(self, tick: Callable[[], bool]) -> None:
        """Look after the processes until they have ended, or until ``tick()`` returns True.

        Raises ``RunFailed`` if the launcher is gone for too long.
        """
        while self._lives.keys() - self._watch.gone and not tick():
            for name, why in self._watch.look():
                self._bury(name, why)
            self._watch.rouse(ROUTER, set(ZYGOTES))
            self._look_for_launcher()
            time.sleep(patience.POLL_S)

    def _look_for_launcher(self) -> None:
        now = time.monotonic()
        if self._launchers:
            self._seen = now
        if now - self._seen > AWAY_S:
            raise RunFailed(f"the launcher is gone: it was out of reach for {AWAY_S:.0f} s")

    def _bury(self, name: str, why: str) -> None:
        life, now_ns = self._lives.get(name), self._now_ns()
        if life is not None and life.kill_ns is not None and now_ns is not None and now_ns >= life.kill_ns:
            return  # as planned
        if (life is not None and why == GOOD_END) or why == WITH_ZYGOTE:
            return  # as told, or with one whose death is reported
        again = self._start_again(name, life)
        self._watch.died(name, why, again=again)
        self._say(name, why, again=again)

    def _start_again(self, name: str, life: ProcessSpec | None) -> bool:
        wanted = name == ROUTER if life is None else self.given.restart and not self._stopping
        if not wanted or self._restarts[name] >= patience.MAX_RESTARTS:
            return False
        self._restarts[name] += 1
        with suppress(RunFailed):
            if life is None:
                self._fork_router()
            else:
                self._fork(life)
            self._watch.born(name)
            return True
        return False

    def _say(self, name: str, why: str, *, again: bool) -> None:
        tail, log = self.log_tail(name), self.log(name)
        restarted = " (started again)" if again else ""
        ends = f"; its log, {log}, ends:\n{tail}" if tail else ""
        print(f"{self.given.text}: {name} died: {why}{restarted}{ends}", file=sys.stderr, flush=True)

    def leave(self) -> None:
        """Tell the launcher that this slice goes, before its processes are done."""
        with suppress(JoinError, zenoh.ZError):
            self._asking.leave(self.session, self.given)


def host() -> str:
    """The name of this host."""
    return socket.gethostname()
