"""A run of which some roles, or all, start elsewhere, in containers or on other machines: gathered, and watched by
their tokens.

Such a process cannot be watched directly. It has a liveliness token, which Zenoh withdraws when the process ends, or
when nothing was heard from it for the time of a lease.
"""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.processes.children import Children
from launcher.processes.deployment import GOOD_END, Deployment
from launcher.processes.endpoint import Way
from launcher.processes.places.desk import Lost
from launcher.processes.places.open_registry import OpenRegistry
from launcher.processes.places.told import Told
from launcher.processes.watch import Death
from launcher.records import Plan
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


@dataclass(frozen=True, slots=True)
class Guests:
    """The processes that start elsewhere, by their ``ids``, and how long (s) to wait for each of them."""

    ids: Collection[str]
    wait_s: float = GATHER_TIMEOUT_S

    def __bool__(self) -> bool:
        return bool(self.ids)


class Household(Children):
    """Children of the launcher, and guests, which are not: a guest out of reach counts as stopped.

    The ``expected`` children and what to load for them are as in ``Children``.
    """

    def __init__(
        self, registry: OpenRegistry, expected: int, preload: Iterable[str] = (), heavy: Iterable[str] = ()
    ) -> None:
        super().__init__(expected, preload, heavy)
        self._registry = registry
        self._expected: dict[str, None] = {}
        self._left: set[str] = set()
        self._dismissed: set[str] = set()
        self._gone_at: dict[str, float] = {}
        self._ended: list[tuple[str, str]] = []

    def expect(self, name: str) -> None:
        """A guest by this name is to come before emulated time starts; after that, it has come."""
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
            self._gone_at.pop(name, None)
            return False
        if name in self._dismissed:
            if time.monotonic() - self._gone_at.setdefault(name, time.monotonic()) > FINAL_S:
                self._left.add(name)
                self._ended.append((name, UNTOLD))
            return False
        return True

    def pid(self, name: str) -> int | None:
        """The process id of a child; a guest has none here."""
        return None if name in self._expected else super().pid(name)

    def kill(self, name: str) -> None:
        """End a child; give up a guest."""
        if name in self._expected:
            self._ended.append((name, LOST))
        else:
            super().kill(name)


class Gathering(Deployment):
    """A deployment that waits for its guests and starts the others."""

    stopped = "was out of reach"
    _refresh_at = 0.0

    registry: OpenRegistry

    def __init__(self, plan: Plan, folder: Path, way: Way | None, guests: Guests) -> None:
        self._guests, self._told = guests, Told(plan, folder)
        self._security = way.security if way else None
        super().__init__(plan, folder, way)

    def _registry(self) -> OpenRegistry:
        own = (self._security.credentials, self._security.slices) if self._security else ()
        return OpenRegistry(self.plan, self.seal, self.alarms, self._guests.ids, *own)

    def _is_guest(self, name: str) -> bool:
        return keys.id_of(name) in self._guests.ids

    def _token(self) -> bytes:
        """As in the environment, which all processes of the run share; without one, they trust their router."""
        return token_from(os.environ, self.plan.run.run)

    def _make_children(self) -> Children:
        here = sum(not self._is_guest(life.name) for life in self.plan.processes)
        preload = (self._preload.light, self._preload.heavy) if here else ()
        self._household = Household(self.registry, here + 2, *preload)
        return self._household

    def _connect(self) -> None:
        super()._connect()
        final = keys.telemetry_of_all("final")
        self._held.append(self.session.declare_subscriber(final, Callback(self._on_final, indirect=False)))

    def _on_final(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the recorder counts it
            name, _ = keys.parse_telemetry(str(sample.key_expr))
            opened(sample, self.seal)
            if name in self._lives and self._is_guest(name):
                self._household.left(name)

    def _fork_role(self, life: ProcessSpec) -> None:
        if self._is_guest(life.name):
            self._household.expect(life.name)
        else:
            super()._fork_role(life)

    def _which(self, missing: set[str]) -> str:
        slices = self.registry.slices.desk.missing(missing)
        return f": {'; '.join(slices)}" if slices else ""

    def _ready_timeout_s(self) -> float:
        return self._guests.wait_s

    def _stop_timeout_s(self) -> float:
        return STOP_TIMEOUT_S

    def begin(self) -> None:
        """As in any deployment; whoever looks after containers is told."""
        super().begin()
        self._told.look(self.registry.start_ns, self.registry.hosts)

    def _tend(self) -> None:
        if time.monotonic() >= self._refresh_at:
            self._refresh_at = time.monotonic() + REFRESH_S
            self.registry.refresh(self.session)
        while self.registry.slices.replaced:
            self._report(self.registry.slices.replaced.popleft(), again=True)
        self._told.look(self.registry.start_ns, self.registry.hosts)
        while self.registry.births:
            before, life = self.registry.births.popleft()
            self._succeed(before, life)
        super()._tend()

    def _report(self, lost: Lost, *, again: bool) -> None:
        """Report a slice that was gone after the start, while it still had something to do."""
        start_ns, wanted = self.registry.start_ns, set(map(keys.id_of, self._to_the_end()))
        if start_ns is not None and lost.since_ns >= start_ns and wanted & set(lost.ids):
            t_s = ((lost.since_ns - start_ns) * self.plan.run.speed - self.plan.origin_ns) / 1e9
            self.deaths.insert(0, Death(keys.slice_name(lost.number), lost.why, t_s, again))  # it says most

    def _succeed(self, before: str, life: ProcessSpec) -> None:
        """Another process took the place of one that is gone."""
        self._lives[life.name] = life
        self._household.expect(life.name)
        self._orders.give(keys.LIFE, msgpack.packb(life.plain()))
        if before in self._watch.still():
            self._watch.give_up(before, LOST, again=True)
        elif before not in self._watch.gone:
            self._watch.gone.add(before)
            self._watch.died(before, LOST, again=True)

    def _start_again(self, name: str, life: ProcessSpec | None) -> bool:
        return not self._is_guest(name) and super()._start_again(name, life)

    def finish(self) -> None:
        """As in any deployment, but without waiting for processes that never joined."""
        for lost in list(self.registry.slices.lost.values()):
            self._report(lost, again=False)
        self._household.dismiss(self._reached)
        if self.registry.start_ns is None:
            self._watch.gone.update(set(filter(self._is_guest, self._lives)) - self.registry.live)
        self._told.look(self.registry.start_ns, self.registry.hosts, over=True)
        super().finish()

    def _end_still(self, names: set[str]) -> None:
        """Processes that are out of reach at the end are not waited for."""
        if still := set(filter(self._is_guest, names & self._watch.still() & set(self._lives))):
            self.registry.refresh(self.session)
        for name in sorted(still - self.registry.live):
            self._watch.give_up(name, LOST)
        super()._end_still(names - self._watch.gone)

    def host(self, name: str) -> str:
        """The host that it runs on, as it reported."""
        return self.registry.hosts.get(name) or super().host(name)
