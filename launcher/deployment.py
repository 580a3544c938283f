"""The processes of a run: forked, joined, started, watched, and gone at the end whatever happened."""

from __future__ import annotations

import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Self

import msgpack
import psutil
import zenoh
from zenoh.handlers import Callback

from launcher import zygote
from launcher.records import RECORDER, Plan
from launcher.registry import Registry
from trackfield.drivers.session import open_client
from trackfield.errors import RunFailed
from trackfield.wire import keys

CONNECT_TIMEOUT_S: Final = 10.0
"""For a router that should be there already; one of our own may take as long as any process."""
READY_TIMEOUT_S: Final = 60.0
LEAD_S: Final = 0.5
LEAD_PER_PROCESS_S: Final = 0.001
"""Between an order and what it orders, so that every process has it in time."""
NICENESS: Final = 5
"""Of nodes: router, recorder and fusion centre come first, as all others wait for them."""
LINGER_S: Final = 0.3
"""For frames that are still on their way when all have reached the end."""
OVERDUE_S: Final = 20.0
"""After the end, how long (wall time) a process may take to say that it has reached it."""
POLL_S: Final = 0.1
STOP_TIMEOUT_S: Final = 10.0
WRITE_TIMEOUT_S: Final = 60.0
ROUTER: Final = "router"
LOG_TAIL: Final = 12


@dataclass(frozen=True, slots=True)
class Death:
    """A process that died unplanned, at ``t_s`` of emulated time (None: before the start)."""

    id: str
    why: str
    t_s: float | None


class Deployment:
    """Router, recorder and roles of one run, as a context manager that leaves no process behind.

    ``status`` is what the recorder said of the run last.
    Raises ``RunFailed`` where a process does not come up; processes that die later are listed in ``deaths``.
    """

    def __init__(self, plan: Plan, folder: Path, *, endpoint: str = "") -> None:
        self.plan, self.folder = plan, folder
        self.deaths: list[Death] = []
        self.status: dict[str, Any] = {}
        self.router_cpu_s = 0.0
        self._own_router = not endpoint
        self._sockets = Path(tempfile.mkdtemp(prefix="trackfield-"))
        self.endpoint = endpoint or f"unixsock-stream/{self._sockets / 'router.sock'}"
        self.registry = Registry(plan)
        self._lead_ns = round((LEAD_S + LEAD_PER_PROCESS_S * len(plan.processes)) * 1e9)
        self._children: dict[str, ForkServerProcess] = {}
        self._gone: set[str] = set()
        self._reached: set[str] = set()

    def __enter__(self) -> Self:
        try:
            self._fork_and_connect()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for child in self._children.values():
            if child.is_alive():
                child.kill()
        for child in self._children.values():
            child.join()
        if hasattr(self, "session"):
            self.session.close()  # type: ignore[no-untyped-call]
        shutil.rmtree(self._sockets, ignore_errors=True)

    # --- birth ----------------------------------------------------------------------------------------------------

    def _fork_and_connect(self) -> None:
        _allow_many_files(4 * len(self.plan.processes) + 1024)
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["launcher.zygote"])
        logs = self.folder / "logs"
        logs.mkdir(exist_ok=True)
        run = self.plan.run.run

        def fork(name: str, target: Callable[..., None], *args: Any) -> None:
            child = context.Process(target=target, name=name, args=args)
            child.start()
            # Each start polls all children that multiprocessing knows of; we watch ours ourselves.
            multiprocessing.process._children.discard(child)  # type: ignore[attr-defined]
            self._children[name] = child

        with _no_main_module(), _zygote_environment():
            if self._own_router:
                fork(ROUTER, zygote.run_router, self.endpoint, logs / "router.log")
            self._connect()  # before anyone can ask to join
            log = logs / "recorder.log"
            fork(RECORDER, zygote.run_recorder, self.endpoint, log, (self.plan, self.folder))
            for p in self.plan.processes:
                title = p.id if p.id == p.role else f"{p.role} {p.id}"
                niceness = 0 if p.sink else NICENESS
                fork(p.id, zygote.run_role, self.endpoint, run, p.id, title, logs / f"{p.id}.log", niceness)

    def _connect(self) -> None:
        timeout_s = READY_TIMEOUT_S if self._own_router else CONNECT_TIMEOUT_S
        try:
            self.session = open_client(self.endpoint, self.plan.run.run, timeout_s)
        except zenoh.ZError as error:
            what = f"no Zenoh router answers at {self.endpoint} (or it refuses this one's credentials)"
            raise RunFailed(f"{what}: {str(error).partition(' at /')[0]}") from None
        self.registry.declare(self.session)
        subscribe = self.session.declare_subscriber
        self._held = [
            subscribe(keys.telemetry_of_all("reached"), Callback(self._on_reached, indirect=False)),
            subscribe(keys.telemetry(RECORDER, "status"), Callback(self._on_status, indirect=False)),
        ]

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _on_reached(self, sample: zenoh.Sample) -> None:
        self._reached.add(str(sample.key_expr).split("/")[1])

    def _on_status(self, sample: zenoh.Sample) -> None:
        self.status = msgpack.unpackb(sample.payload.to_bytes())

    # --- life -----------------------------------------------------------------------------------------------------

    def wait_ready(self, tick: Callable[[int, int], bool]) -> None:
        """Wait until all declare themselves alive; ``tick(ready, of)`` returns True to give up.

        Raises ``RunFailed`` for a process that dies first, or is not there in time.
        """
        wanted = {p.id for p in self.plan.processes} | {RECORDER}
        deadline = time.monotonic() + READY_TIMEOUT_S
        while wanted - self.registry.live:
            if tick(len(wanted & self.registry.live), len(wanted)):
                return
            for name in self._newly_gone():
                raise self._failure(f"{name} died at start ({self._why(name)})", name)
            if time.monotonic() > deadline:
                name = min(wanted - self.registry.live)
                raise self._failure(
                    f"{len(wanted - self.registry.live)} of {len(wanted)} processes were not ready in time", name
                )
            time.sleep(POLL_S)

    def begin(self) -> None:
        """Order the start of emulated time."""
        self.registry.start_ns = time.monotonic_ns() + self._lead_ns
        self._order(keys.START, str(self.registry.start_ns))

    def _order(self, key: str, payload: str | bytes) -> None:
        self.session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

    @property
    def now_ns(self) -> int:
        """Emulated time now (negative before the start)."""
        assert self.registry.start_ns is not None
        return round((time.monotonic_ns() - self.registry.start_ns) * self.plan.run.speed)

    def watch(self, tick: Callable[[], bool]) -> None:
        """Follow the run to its end; ``tick()`` returns True to end it early."""
        roles, end_ns, ending = {p.id for p in self.plan.processes}, self.plan.run.end_ns, False
        while missing := roles - self._reached - self._gone:
            self._bury()
            if self._router_is_gone():
                return
            if tick() and not ending:
                ending = True
                end_ns = max(self.now_ns, 0) + round(self._lead_ns * self.plan.run.speed)
                self.registry.end(end_ns)
                self._order(keys.END, str(end_ns))
            if self.now_ns > end_ns + OVERDUE_S * self.plan.run.speed * 1e9:
                self.deaths += [Death(id, "did not reach the end", None) for id in sorted(missing)]
                return
            time.sleep(POLL_S)

    def finish(self) -> None:
        """Stop the roles, let the recorder close its files, and end the router. Without a router, force them."""
        roles, recorder = [self._children[p.id] for p in self.plan.processes], self._children[RECORDER]
        if self._router_is_gone():
            for child in roles:
                child.kill()
            recorder.terminate()  # it closes its files all the same
        else:
            time.sleep(LINGER_S)
            self._order(keys.STOP, b"")
            _join(roles, STOP_TIMEOUT_S)
            self.deaths += [Death(c.name, "did not stop when told", None) for c in roles if c.is_alive()]
            self._order(keys.FINISH, msgpack.packb([d.id for d in self.deaths]))
        _join([recorder], WRITE_TIMEOUT_S)
        if recorder.exitcode != 0 and RECORDER not in self._gone:
            self.deaths.append(Death(RECORDER, self._why(RECORDER), None))
        if self._own_router and not self._router_is_gone():
            times = psutil.Process(self._children[ROUTER].pid).cpu_times()
            self.router_cpu_s = times.user + times.system
            self._children[ROUTER].terminate()
            _join([self._children[ROUTER]], STOP_TIMEOUT_S)

    def _router_is_gone(self) -> bool:
        return self._own_router and not self._children[ROUTER].is_alive()

    def pids(self) -> dict[str, int]:
        """The process ids of the roles."""
        return {p.id: pid for p in self.plan.processes if (pid := self._children[p.id].pid) is not None}

    def log_tail(self, name: str) -> str:
        """The last lines of a process's log."""
        path = self.folder / "logs" / f"{name}.log"
        return "\n".join(path.read_text(errors="replace").splitlines()[-LOG_TAIL:]) if path.exists() else ""

    # --- death ----------------------------------------------------------------------------------------------------

    def _newly_gone(self) -> list[str]:
        alive = {c.sentinel: name for name, c in self._children.items() if name not in self._gone}
        names = [alive[s] for s in wait(list(alive), 0) if isinstance(s, int)]
        self._gone.update(names)
        return names

    def _bury(self) -> None:
        for name in self._newly_gone():
            t = max(self.now_ns, 0) / 1e9
            self.deaths.append(Death(name, self._why(name), t))

    def _why(self, name: str) -> str:
        self._children[name].join(1)
        code = self._children[name].exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def _failure(self, what: str, name: str) -> RunFailed:
        tail, path = self.log_tail(name), self.folder / "logs" / f"{name}.log"
        return RunFailed(f"{what}; its log, {path}, ends:\n{tail}" if tail else what, process=name, log=tail)


def _join(children: list[ForkServerProcess], timeout_s: float) -> None:
    deadline = time.monotonic() + timeout_s
    for child in children:
        child.join(max(deadline - time.monotonic(), 0))


def _allow_many_files(wanted: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < limit:
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


@contextmanager
def _no_main_module() -> Iterator[None]:
    """Keep children from importing the caller's main program."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextmanager
def _zygote_environment() -> Iterator[None]:
    os.environ["TRACKFIELD_ZYGOTE"] = str(os.getpid())
    try:
        yield
    finally:
        del os.environ["TRACKFIELD_ZYGOTE"]
