"""A run whose roles start elsewhere, in containers or on other machines: gathered, and watched by their tokens.

Such a process cannot be watched directly. It has a liveliness token, which Zenoh withdraws when the process ends, or
when nothing was heard from it for the time of a lease.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.processes.children import Children
from launcher.processes.deployment import GOOD_END, Deployment
from launcher.processes.places.open_registry import OpenRegistry
from trackfield.drivers.exchange.intake import opened
from trackfield.drivers.exchange.seal import token_from
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError

GATHER_TIMEOUT_S: Final = 300.0
"""How long to wait for processes that are started elsewhere."""
STOP_TIMEOUT_S: Final = 60.0
"""How long they may take to stop; a container engine that removes a hundred of them leaves the others little time."""
REFRESH_S: Final = 5.0
"""How often to ask which processes are alive, besides being notified."""
LOST: Final = "gone: its token was lost"
UNTOLD: Final = "left without its final record"
FINAL_S: Final = 2.0
"""How long a final record may come after the end of the process that sent it."""


class Guests(Children):
    """The recorder, which is a child process, and guests, which are not: a guest out of reach counts as stopped."""

    def __init__(self, registry: OpenRegistry) -> None:
        super().__init__(1)
        self._registry = registry
        self._expected: dict[str, None] = {}
        self._came: set[str] = set()
        self._left: set[str] = set()
        self._dismissed: set[str] = set()
        self._gone_at: dict[str, float] = {}
        self._ended: list[tuple[str, str]] = []

    def expect(self, name: str) -> None:
        """A guest by this name is to come."""
        self._expected[name] = None

    def left(self, name: str) -> None:
        """This guest sent its final record."""
        if name in self._left:
            return
        self._left.add(name)
        self._ended.append((name, GOOD_END))

    def dismiss(self, names: Iterable[str]) -> None:
        """These have nothing left to do: from now on, those that are gone are not out of reach, but have left."""
        self._dismissed.update(names)

    def names(self) -> list[str]:
        """Children and guests."""
        return super().names() + list(self._expected)

    def gone(self) -> list[tuple[str, str]]:
        """Children that ended and guests that left, since the last call."""
        ended, self._ended = self._ended, []
        return super().gone() + ended

    def stopped(self, name: str) -> bool:
        """Whether a child stands still, or a guest that was there is gone while emulated time runs."""
        if name not in self._expected:
            return super().stopped(name)
        if self._registry.start_ns is None or name in self._left:
            return False
        if name in self._registry.live:
            self._came.add(name)
            self._gone_at.pop(name, None)
            return False
        if name in self._dismissed:
            if time.monotonic() - self._gone_at.setdefault(name, time.monotonic()) > FINAL_S:
                self._left.add(name)
                self._ended.append((name, UNTOLD))
            return False
        return name in self._came

    def kill(self, name: str) -> None:
        """End a child; give up a guest."""
        if name in self._expected:
            self._ended.append((name, LOST))
        else:
            super().kill(name)


class Gathering(Deployment):
    """A deployment that starts only the recorder and waits for the roles; its router runs elsewhere, too."""

    stopped = "was out of reach"
    _refresh_at = 0.0

    registry: OpenRegistry

    def _registry(self) -> OpenRegistry:
        return OpenRegistry(self.plan, self.seal, self.alarms)

    def _token(self) -> bytes:
        """As in the environment, which all processes of the run share; without one, they trust their router."""
        return token_from(os.environ, self.plan.run.run)

    def _make_children(self) -> Children:
        self._guests = Guests(self.registry)
        return self._guests

    def _connect(self) -> None:
        super()._connect()
        final = keys.telemetry_of_all("final")
        self._held.append(self.session.declare_subscriber(final, Callback(self._on_final, indirect=False)))

    def _on_final(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the recorder counts it
            name, _ = keys.parse_telemetry(str(sample.key_expr))
            opened(sample, self.seal)
            if name in self._lives:
                self._guests.left(name)

    def _fork_role(self, life: ProcessSpec) -> None:
        self._guests.expect(life.name)

    def _ready_timeout_s(self) -> float:
        return GATHER_TIMEOUT_S

    def _stop_timeout_s(self) -> float:
        return STOP_TIMEOUT_S

    def _tend(self) -> None:
        if time.monotonic() >= self._refresh_at:
            self._refresh_at = time.monotonic() + REFRESH_S
            self.registry.refresh(self.session)
        while self.registry.births:
            before, life = self.registry.births.popleft()
            self._succeed(before, life)
        super()._tend()

    def _succeed(self, before: str, life: ProcessSpec) -> None:
        """Another process took the place of one that is gone."""
        self._lives[life.name] = life
        self._guests.expect(life.name)
        self._orders.give(keys.LIFE, msgpack.packb(life.plain()))
        if before in self._watch.still():
            self._watch.give_up(before, LOST, again=True)
        elif before not in self._watch.gone:
            self._watch.gone.add(before)
            self._watch.died(before, LOST, again=True)

    def _start_again(self, name: str, life: ProcessSpec | None) -> bool:
        return False

    def finish(self) -> None:
        """As in any deployment, but without waiting for processes that never joined."""
        self._guests.dismiss(self._reached)
        if self.registry.start_ns is None:
            self._watch.gone.update(set(self._lives) - self.registry.live)
        super().finish()

    def _end_still(self, names: set[str]) -> None:
        """Processes that are out of reach at the end are not waited for."""
        if still := names & self._watch.still() & set(self._lives):
            self.registry.refresh(self.session)
        for name in sorted(still - self.registry.live):
            self._watch.give_up(name, LOST)
        super()._end_still(names - self._watch.gone)

    def pids(self) -> dict[str, int]:
        """None: the roles are not processes of this machine."""
        return {}

    def host(self, name: str) -> str:
        """The host that it runs on, as it reported."""
        return self.registry.hosts.get(name) or super().host(name)
