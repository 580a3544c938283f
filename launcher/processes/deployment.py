"""The processes of a run: forked, joined, started, watched, and ended with the run whatever happens."""

from __future__ import annotations

import platform
import time
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from secrets import token_bytes
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.processes import bodies, patience
from launcher.processes.alarms import Alarms
from launcher.processes.children import KILL_TIMEOUT_S, WITH_ZYGOTE, ZYGOTES, Children
from launcher.processes.endpoint import Door, Way, patiently
from launcher.processes.orders import Orders
from launcher.processes.preload import preload_of
from launcher.processes.registry import Registry
from launcher.processes.settling import Settling, answer_of
from launcher.processes.together import Together
from launcher.processes.watch import STOOD_STILL, Stop, Watch
from launcher.processes.zygote import Child
from launcher.record.samples import status_of
from launcher.records import LAUNCHER, RECORDER, ROUTER, Plan
from launcher.security.attempts import Asking, Attempts
from trackfield.drivers.exchange.intake import opened
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import RunFailed
from trackfield.wire import keys
from trackfield.wire.error import WireError

GOOD_END: Final = "exit code 0"
CANNOT_LISTEN: Final = f"exit code {bodies.CANNOT_LISTEN}"


class Deployment(Together):
    """Router, recorder and roles of one run, as a context manager that leaves no process behind.

    ``status`` is the latest status from the recorder, ``unsettled`` are the processes that were still correcting what
    they sent when the run was ended. Raises ``RunFailed`` if a process does not start; later failures
    are in ``deaths`` and ``stops``.
    """

    stopped = "was stopped from outside"
    """What is said of a process that stood still."""

    def __init__(self, plan: Plan, folder: Path, way: Way | None = None) -> None:
        self.plan, self.folder = plan, folder
        self.seal, self.alarms = Seal(self._token()), Alarms()
        self.registry = self._registry()
        self.status: dict[str, Any] = {}
        self.router_cpu_s = 0.0
        self.door = Door(way or Way(), plan.run.run)
        self._lead_ns = round((patience.LEAD_S + patience.LEAD_PER_PROCESS_S * len(plan.processes)) * 1e9)
        self._end_ns = plan.run.end_ns
        self._preload = preload_of(plan.processes)
        self._lives = {p.name: p for p in plan.processes}
        self._restarts: Counter[str] = Counter()
        self._reached: set[str] = set()
        self._settling = Settling(self._lives)
        self.unsettled: set[str] = set()
        self._tend_at = 0.0
        self._router_seen = 0.0
        self._stopping = False

    def _start(self) -> None:
        self._children = self._make_children()
        self._watch = Watch(self._children, self._clock, -self.plan.origin_ns / 1e9)
        self.deaths = self._watch.deaths
        self._fork_and_connect()

    def _clear(self) -> None:
        self.door.close()

    def _token(self) -> bytes:
        """The run's secret: processes that are forked here have it from the launcher."""
        return token_bytes()

    def _registry(self) -> Registry:
        return Registry(self.plan, self.seal, self.alarms)

    def _make_children(self) -> Children:
        return Children(len(self.plan.processes) + 2, self._preload.light, self._preload.heavy)

    @property
    def stops(self) -> list[Stop]:
        """The processes that were stopped from outside."""
        return self._watch.stops

    # --- birth ----------------------------------------------------------------------------------------------------

    def _fork_and_connect(self) -> None:
        (self.folder / "logs").mkdir(exist_ok=True)
        if self.door.own:
            self._fork_router()
        self._connect()  # before anyone can ask to join
        recorder = Child("launcher.record.recorder:record", RECORDER, str(self.log(RECORDER)), graceful=True)
        own = self.plan, self.folder, self.seal.token, self.door.folder
        self._children.fork(RECORDER, recorder, self.door.settings(RECORDER), *own)
        for life in sorted(self.plan.processes, key=self._is_heavy):  # while the others start, the heavy zygote loads
            self._fork_role(life)

    def _fork_router(self) -> None:
        router = Child("launcher.processes.bodies:router", ROUTER, str(self.log(ROUTER)))
        self._children.fork(ROUTER, router, self.door.router())

    def _fork_role(self, life: ProcessSpec) -> None:
        title = life.name if life.id == life.role else f"{life.role} {life.name}"
        niceness = 0 if life.sink else patience.NICENESS
        body = Child("launcher.processes.bodies:role", title, str(self.log(life.name)), heavy=self._is_heavy(life))
        own = (life.factory, dict(self.plan.own_places), self.seal.token)
        self._children.fork(life.name, body, self.door.settings(life.id), life.name, niceness, *own)

    def _is_heavy(self, life: ProcessSpec) -> bool:
        return self._preload.is_heavy(life)

    def _connect(self) -> None:
        if self.door.own:
            self.session = patiently(lambda: self._session(patience.NEEDED_STILL_S), self._look_for_router)
        else:
            self.session = self._session(patience.CONNECT_TIMEOUT_S)
        self._orders = Orders(self.session, self.seal, self.alarms)
        self._asking = Asking(self.session) if self.door.secured else None
        self.registry.declare(self.session)
        subscribe = self.session.declare_subscriber
        self._held = [
            subscribe(keys.telemetry_of_all("reached"), Callback(self._on_reached, indirect=False)),
            subscribe(keys.telemetry(RECORDER, "status"), Callback(self._on_status, indirect=False)),
        ]

    def _session(self, timeout_s: float) -> zenoh.Session:
        return self.door.session(LAUNCHER, timeout_s)

    def _look_for_router(self) -> None:
        if self._children.stopped(ROUTER):
            self._watch.kill(ROUTER, STOOD_STILL)
            self._children.wait([ROUTER], KILL_TIMEOUT_S)
        self._look_at_start()

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _on_reached(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the recorder counts it
            name, _ = keys.parse_telemetry(str(sample.key_expr))
            answer = answer_of(opened(sample, self.seal))
            if name in self._lives:
                self._settling.take(name, answer)
                if self.now_ns >= self._end_ns:
                    self._reached.add(name)

    def _on_status(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the same
            self.status = status_of(opened(sample, self.seal))

    # --- life -----------------------------------------------------------------------------------------------------

    def wait_ready(self, tick: Callable[[set[str], int], bool]) -> None:
        """Wait until all declare themselves alive; ``tick(missing, of)`` returns True to give up.

        Raises ``RunFailed`` for a process that dies first, or if none became ready for so long.
        """
        wanted = {*self._lives, RECORDER}
        fewest, deadline = len(wanted) + 1, 0.0
        while missing := wanted - self.registry.live:
            if tick(missing, len(wanted)):
                return
            if len(missing) < fewest:
                fewest, deadline = len(missing), time.monotonic() + self._ready_timeout_s()
            self._look_at_start()
            self._orders.look(self.registry.arrivals)
            for name in sorted(missing & self._watch.still(patience.STILL_S)):
                raise self.failure(f"{name} was stopped from outside at start, and not continued", name)
            if time.monotonic() > deadline:
                what = f"{len(missing)} of {len(wanted)} processes were not ready in time"
                raise self.failure(what + self._which(missing), min(missing))
            time.sleep(patience.POLL_S)

    def _look_at_start(self) -> None:
        """Replace a router that is gone. Raises ``RunFailed`` if it is another process."""
        for name, why in self._watch.look():
            if name == ROUTER and why == CANNOT_LISTEN:
                raise RunFailed(self.log_tail(ROUTER))
            if name != ROUTER or not self._start_again(ROUTER, None):
                raise self.failure(f"{name} died at start ({why})", name)
            self._watch.died(name, why, again=True)
        self._watch.rouse(ROUTER, {RECORDER, *ZYGOTES})

    def _which(self, missing: set[str]) -> str:
        """Which processes those are, besides the one whose log is quoted."""
        return ""

    def _ready_timeout_s(self) -> float:
        return patience.READY_TIMEOUT_S + patience.READY_PER_PROCESS_S * len(self._lives)

    def begin(self) -> None:
        """Order the start of emulated time."""
        self.registry.start_ns = time.monotonic_ns() + self._lead_ns
        self._orders.give(keys.START, str(self.registry.start_ns).encode())

    @property
    def now_ns(self) -> int:
        """Emulated time now (negative, or 0, before the start)."""
        now_ns = time.monotonic_ns()
        return round((now_ns - (self.registry.start_ns or now_ns)) * self.plan.run.speed)

    def _clock(self) -> float | None:
        """Seconds since the first step (None: before the start)."""
        if self.registry.start_ns is None:
            return None
        return (min(max(self.now_ns, 0), self._end_ns) - self.plan.origin_ns) / 1e9

    def watch(self, tick: Callable[[], bool]) -> None:
        """Follow the run to its end; ``tick()`` returns True to end it early."""
        ending = False
        while (missing := self._to_the_end() - self._reached - self._watch.gone) or self._to_be_killed():
            self._tend()
            if self._router_is_gone():
                if not self.door.own:
                    self._watch.died(ROUTER, f"it was away for {patience.ROUTER_AWAY_S:.0f} s")
                return
            if tick() and not ending:
                ending = True
                self._end_early()
            over_s = (self.now_ns - self._end_ns) / 1e9 / self.plan.run.speed
            if over_s > patience.STILL_S:
                self._end_still(missing)
            if over_s > patience.OVERDUE_S:
                for name in sorted(missing):
                    self._watch.died(name, "did not reach the end")
                return
            time.sleep(patience.POLL_S)
        self.unsettled = self._settling.wait(self._living, lambda wave: self._orders.give(keys.SETTLE, b"%d" % wave))

    def _living(self) -> dict[str, ProcessSpec]:
        """The processes that have reached the end and are there, after looking after all."""
        if time.monotonic() > self._tend_at:  # more often, and what stalls for a moment would count as stopped
            self._tend_at = time.monotonic() + patience.POLL_S
            self._tend()
        gone = self._watch.gone
        return {} if self._router_is_gone() else {name: self._lives[name] for name in self._to_the_end() - gone}

    def _to_the_end(self) -> set[str]:
        """The processes that should report that they have reached the end."""
        return {name for name, life in self._lives.items() if life.kill_ns is None or life.kill_ns >= self._end_ns}

    def _to_be_killed(self) -> bool:
        """Whether a planned kill is still to come."""
        left = [life.kill_ns or 0 for name, life in self._lives.items() if name not in self._watch.gone]
        return any(self.now_ns < kill_ns < self._end_ns for kill_ns in left)

    def _end_early(self) -> None:
        soon_ns = max(self.now_ns, 0) + round(self._lead_ns * self.plan.run.speed)
        self._end_ns = min(soon_ns, self._end_ns)
        self.registry.end(self._end_ns)
        self._orders.give(keys.END, str(self._end_ns).encode())

    def finish(self) -> None:
        """Stop the roles, let the recorder close its files, and end the router. Without a router, force them."""
        self._stopping = True
        if self._router_is_gone():
            self._watch.gone.update(self._lives)
            for name in self._lives:
                self._children.kill(name)
            self._children.terminate(RECORDER)  # it closes its files all the same
        else:
            if self._asking:
                self._asking.finish()
            self._orders.give(keys.STOP, b"")
            self._await(self._lives, self._stop_timeout_s(), "did not stop when told")
            self._orders.give(keys.FINISH, msgpack.packb([(d.id, d.t_s, d.why) for d in self.deaths]))
        self._await([RECORDER], patience.WRITE_TIMEOUT_S, "did not close its files in time")
        if self.door.own and self._children.alive(ROUTER):
            self.router_cpu_s = self._children.cpu_s(ROUTER)
            self._children.terminate(ROUTER)
            self._children.wait([ROUTER], patience.STOP_TIMEOUT_S)

    def _stop_timeout_s(self) -> float:
        return patience.STOP_TIMEOUT_S + patience.STOP_PER_PROCESS_S * len(self._lives)

    def _await(self, names: Iterable[str], timeout_s: float, why: str) -> None:
        """Wait until these have ended; kill and report those that do not."""
        deadline = time.monotonic() + timeout_s
        while left := set(names) - self._watch.gone:
            over_s = time.monotonic() - deadline
            if over_s > KILL_TIMEOUT_S:
                return
            if over_s > 0:
                for name in left:
                    self._watch.kill(name, why)
            self._end_still(left)
            time.sleep(patience.POLL_S / 2)
            self._tend()

    def _end_still(self, names: set[str]) -> None:
        for name in names & self._watch.still(patience.STILL_S):
            self._watch.kill(name, "stood still at the end, stopped from outside")

    # --- death ----------------------------------------------------------------------------------------------------

    def _tend(self) -> None:
        """Handle processes that died or stand still, and repeat orders."""
        for name, why in self._watch.look():
            self._bury(name, why)
        self._watch.rouse(ROUTER, {RECORDER, *ZYGOTES})
        self._orders.look(self.registry.arrivals)
        if self._asking:
            self._asking.look()

    def _bury(self, name: str, why: str) -> None:
        life = self._lives.get(name)
        if life is not None and life.kill_ns is not None and self.now_ns >= life.kill_ns:
            return  # as planned
        if (self._stopping and name != ROUTER and why == GOOD_END) or why == WITH_ZYGOTE:
            return  # as told, or with one whose death is reported
        try:
            again = self._start_again(name, life)
        except RunFailed as error:
            again, why = False, f"{why}; {error}"
        if not again and self._restarts[keys.id_of(name)] == patience.MAX_RESTARTS:
            why += f"; {patience.MAX_RESTARTS} restarts are enough"
        self._watch.died(name, why, again=again)

    def _start_again(self, name: str, life: ProcessSpec | None) -> bool:
        """Start another in the place of one that died, if that is wanted and has not happened too often."""
        start_ns = max(self.now_ns, 0) + round(self._lead_ns * self.plan.run.speed)
        wanted = name == ROUTER if life is None else self.plan.restart and start_ns < self._end_ns
        if not wanted or self._restarts[keys.id_of(name)] >= patience.MAX_RESTARTS:
            return False
        self._restarts[keys.id_of(name)] += 1
        if life is None:
            self._fork_router()
            self._watch.born(ROUTER)
        else:
            following = self.registry.next_life(name, start_ns)
            self._fork_role(following)
            self._lives[following.name] = following
            self._orders.give(keys.LIFE, msgpack.packb(following.plain()))
        return True

    def _router_is_gone(self) -> bool:
        """Whether there is no router, and none will be started."""
        if self.door.own:
            return ROUTER in self._watch.gone
        now = time.monotonic()
        if self.session.info.routers_zid() or not self._router_seen:
            self._router_seen = now
        return now - self._router_seen > patience.ROUTER_AWAY_S

    # --- what others ask ------------------------------------------------------------------------------------------

    def attempts(self) -> Attempts:
        """What the router of a secured run refused."""
        return self._asking.attempts if self._asking else {}

    def pids(self) -> dict[str, int]:
        """The process ids of all that run here, by name."""
        return {name: pid for name in self._children.names() if (pid := self._children.pid(name)) is not None}

    def host(self, name: str) -> str:
        """The host that it runs on."""
        return platform.node()
