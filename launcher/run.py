"""One run from scenario to run folder, under either driver."""

from __future__ import annotations

import json
import shutil
import signal
import statistics
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

import psutil

from launcher.away import as_planned, not_done
from launcher.drawing import write_here
from launcher.files import CONTAINERS, LOG, locked, patiently
from launcher.processes.deployment import Deployment
from launcher.processes.endpoint import Way
from launcher.processes.gathering import Gathering, Guests
from launcher.processes.live import LiveView
from launcher.processes.watch import Death, Stop
from launcher.record.folder import write_manifest
from launcher.record.journal import METRICS, TIMELINE_FAILED, Journal, write_json
from launcher.record.kept.recovery import recovered
from launcher.record.ledger import Ledger
from launcher.record.metrics import INTERRUPTED, RECORDER_DIED, ROUTER_LOST, THE_END, Metrics, ended_because
from launcher.record.outside.filmed import VIDEO_FAILED
from launcher.record.words import attempted, interference
from launcher.records import LIVE, RECORDER, ROUTER, SENSES, Plan
from launcher.security.attempts import totals
from launcher.signals import Interrupted, handling
from trackfield.drivers.virtual import Virtual
from trackfield.errors import RunFailed
from trackfield.role import NS

TICK_S: Final = 0.1
"""How often a run in virtual time reports its time."""
Event = TypeVar("Event", Death, Stop)
PSS_SAMPLE: Final = 20
"""About how many nodes have their memory measured."""


class Observer(Protocol):
    """What shows a run as it goes on: a live table, plain lines, or nothing."""

    def starting(self, missing: Collection[str], of: int) -> object:
        """Processes are starting: those that are ``missing``, and how many there will be."""

    def running(self, status: dict[str, Any]) -> None:
        """The recorder's latest status."""


@dataclass(frozen=True)
class Outcome:
    """A finished run: its folder, its metrics, what went wrong, and the signal that ended it early, if any.

    ``unreported`` says why there is no report; the run itself did not fail.
    """

    folder: Path
    metrics: Metrics
    complaints: tuple[str, ...]
    signal: int | None = None
    unreported: str = ""

    @property
    def complete(self) -> bool:
        """Whether the run reached its end; a signal may have come after it."""
        return bool(self.metrics["complete"])

    @property
    def exit_code(self) -> int:
        """0; 1 if something failed; 128 + signal if it was ended early."""
        if self.complaints:
            return 1
        return 0 if self.signal is None else 128 + self.signal


def run_virtual(
    plan: Plan,
    folder: Path,
    command: Sequence[str] = (),
    *,
    tick: Callable[[float | None], None] = lambda _: None,
    write: Callable[[Path], None] = write_here,
) -> Outcome:
    """Run in virtual time; ``write`` writes the report of the finished folder.

    ``tick`` is called with the time (s since the first step) now and then, and with None when the run is over.
    """
    with _until_signal() as ended:
        write_manifest(folder, plan, command, None)
        begun, cpu_s = time.monotonic(), time.process_time()
        ledger = Ledger(plan.run, plan.processes)
        journal = Journal(plan, ledger, folder)
        virtual = Virtual(plan.run, plan.processes, ledger)
        due = 0.0

        def stop() -> bool:
            nonlocal due
            if (now := time.monotonic()) >= due:
                due = now + TICK_S
                tick((virtual.now_ns - plan.origin_ns) / NS)
            return bool(ended)

        virtual.run(stop)
        tick(None)
        ledger.end(virtual.end_ns)
        metrics = journal.tables([], messages=ledger.leaving.left)
        metrics["recorder"]["complaints"] += filter(None, [journal.draw()])
        metrics |= {"driver": "virtual", "wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - cpu_s}
        metrics |= ended_because(_why(plan, metrics, ended))
        metrics["timing"]["speed"] = None
        return close_folder(plan, folder, metrics, [], ended, write)


def run_processes(
    plan: Plan,
    folder: Path,
    observer: Observer,
    command: Sequence[str] = (),
    way: Way | None = None,
    *,
    guests: Guests | None = None,
    live: Callable[[str], None] | None = None,
    live_at: str = "",
) -> Outcome:
    """Run as processes over Zenoh, which are started here, but for ``guests``, which start elsewhere.

    ``live``, if given, asks for a live view, by the viewer at ``live_at`` or one of its own, and is called with
    messages about it: its address, or why it failed. Raises ``RunFailed`` if the processes do not start.
    """
    begun, own_cpu_s = time.monotonic(), time.process_time()
    with _going_on(folder), _until_signal() as ended:
        deployed = Gathering(plan, folder, way, guests) if guests else Deployment(plan, folder, way)
        with deployed as field, _viewed(field, live, live_at) if live else nullcontext() as view:
            write_manifest(folder, plan, command, field.door.endpoint)
            ready_at, pss = _from_start_to_end(field, observer, view, ended)
        metrics = _recorded(plan, folder, field.deaths)
        own_cpu_s = time.process_time() - own_cpu_s + field.router_cpu_s
        cpu_s = None if metrics["cpu_s"] is None else metrics["cpu_s"] + own_cpu_s
        metrics |= {"driver": "processes", "wall_s": time.monotonic() - begun, "cpu_s": cpu_s}
        metrics |= ended_because(_why(plan, metrics, ended, field.deaths))
        metrics["processes"] |= {"ready_s": ready_at - begun, "pss_mb_per_node": pss}
        deaths, stops = _unplanned(plan, field.deaths), _unplanned(plan, field.stops)
        _add_seen(metrics, field, deaths, stops)
        complaints = [_complaint(field, d) for d in deaths] + [_remark(field, s) for s in stops]
        complaints += _not_done(plan, folder, metrics["ended_s"])
        return close_folder(plan, folder, metrics, complaints, ended)


def _viewed(field: Deployment, tell: Callable[[str], None], at: str) -> LiveView:
    return LiveView(field.plan, field.folder, field.door.settings(LIVE), field.seal.token, tell, at)


def _from_start_to_end(
    field: Deployment, observer: Observer, view: LiveView | None, ended: list[int]
) -> tuple[float, float | None]:
    """When all processes were ready (monotonic, s), and the memory of a node (MB), if any was measured."""
    field.wait_ready(lambda missing, of: bool(observer.starting(missing, of) or ended))
    ready_at, pss = time.monotonic(), None
    if view:
        view.wait_ready(field.registry.live, lambda: bool(ended))

    def tick() -> bool:
        observer.running(field.status)
        if view:
            view.look()
        return bool(ended)

    if not ended:
        field.begin()
        pss = _pss_mb(field)
        field.watch(tick)
    field.finish()
    return ready_at, pss


def _unplanned(plan: Plan, seen: Sequence[Event]) -> list[Event]:
    """Deaths or stops, without those that planned faults of containers explain."""
    return [one for one in seen if not as_planned(plan.aways, one.id, one.t_s, plan.run.speed)]


def _not_done(plan: Plan, folder: Path, ended_s: float) -> list[str]:
    """The planned faults of containers that nobody brought about, a sentence each."""
    log = folder / CONTAINERS
    said = log.read_text(errors="replace") if plan.aways and log.exists() else ""
    return [f"{one.text} was not brought about (see {CONTAINERS})" for one in not_done(plan.aways, said, ended_s)]


def _add_seen(metrics: Metrics, field: Deployment, deaths: Sequence[Death], stops: Sequence[Stop]) -> None:
    """Add what the launcher saw: processes that died or were stopped, and its own alarms."""
    metrics["processes"] |= {
        "died": [{"id": d.id, "host": field.host(d.id), "why": d.why, "t": d.t_s} for d in deaths],
        "stopped": [{"id": s.id, "host": field.host(s.id), "t": s.t_s, "s": s.for_s} for s in stops],
    }
    metrics["timing"]["unsettled"] = len(field.unsettled)
    counts = field.alarms.counts
    metrics["attempts"] = field.attempts()
    counts = counts + Counter(totals(metrics["attempts"]))
    metrics["interference"] = {kind: (n or 0) + counts[kind] for kind, n in metrics["interference"].items()}


@contextmanager
def _going_on(folder: Path) -> Iterator[None]:
    """Hold the folder's lock, by which ``recover`` sees that the run goes on; go without it if it cannot be had."""
    with ExitStack() as held:
        with suppress(OSError):
            held.enter_context(locked(folder))
        yield


def _recorded(plan: Plan, folder: Path, deaths: Sequence[Death]) -> Metrics:
    """What the recorder wrote, or, if it died before it had, what its log says. Raises ``RunFailed`` if neither is."""
    file, died = folder / METRICS, any(one.id == RECORDER for one in deaths)
    if file.exists() and not (died and (folder / LOG).exists()):
        metrics: Metrics = json.loads(file.read_text())
        return metrics
    try:
        metrics = recovered(plan, folder, [(one.id, one.t_s, one.why) for one in deaths])
    except RunFailed as error:
        again = f"; trackfield recover {folder} makes them from its {LOG}" if (folder / LOG).exists() else ""
        raise RunFailed(f"{error}{again}") from None
    samples, until_s = metrics["recorder"]["messages"], metrics["ended_s"]
    said = f"the recorder did not finish: all was made from its log, {samples} messages until {until_s:.1f} s"
    metrics["recorder"]["complaints"].insert(0, said)
    return metrics


def _why(plan: Plan, metrics: Metrics, ended: list[int], deaths: Sequence[Death] = ()) -> str:
    """Why a run ended; ``ended`` are the signals that came."""
    if metrics["ended_s"] >= plan.info.end_s:
        return THE_END
    lost = {one.id for one in deaths if not one.again}
    for name, why in ((RECORDER, RECORDER_DIED), (ROUTER, ROUTER_LOST)):
        if name in lost:
            return why
    return f"{INTERRUPTED} ({signal.Signals(ended[0]).name})" if ended else RECORDER_DIED


def close_folder(
    plan: Plan,
    folder: Path,
    metrics: Metrics,
    complaints: list[str],
    ended: list[int],
    write: Callable[[Path], None] = write_here,
) -> Outcome:
    """Write metrics and report; ``complaints`` are what went wrong, ``ended`` the signals that ended the run early.

    A signal from now on ends the drawing of the report.
    """
    frames = metrics["frames"]
    if frames["host_lost"]:
        routers = sum(died["id"] == ROUTER for died in metrics["processes"]["died"] or ())
        why = " while there was no router" if routers else ""
        complaints.append(f"{frames['host_lost']} frames were lost by the machine itself{why} (frames.host_lost)")
    if strange := interference(metrics["interference"]):
        complaints.append(f"somebody interfered with the run: {strange}{attempted(metrics['attempts'])} (interference)")
    if dropped := metrics["recorder"]["dropped"]:
        complaints.append(f"{dropped} frames never reached the recorder (recorder.dropped): the tables lack them")
    complaints += metrics["recorder"]["complaints"]
    patiently(lambda: write_json(metrics, folder / METRICS), str(folder / METRICS))
    if not any(one.startswith((TIMELINE_FAILED, VIDEO_FAILED)) for one in complaints):
        (folder / LOG).unlink(missing_ok=True)  # it has nothing that is not elsewhere
    unreported = _report(folder, ended, write)
    return Outcome(folder, metrics, tuple(complaints), ended[0] if ended else None, unreported)


def _report(folder: Path, ended: list[int], write: Callable[[Path], None]) -> str:
    """Write the report, whole or not at all; returns why that failed, or nothing."""
    try:
        with _interruptible(ended):
            write(folder)
    except KeyboardInterrupt:
        why = f"interrupted; trackfield report {folder} draws it"
    except Exception as error:  # noqa: BLE001  whatever it is, the run is over and all its tables are there
        why = f"{type(error).__name__}: {error}"
    else:
        return ""
    (folder / "report.html").unlink(missing_ok=True)
    shutil.rmtree(folder / "plots", ignore_errors=True)
    return why


def _complaint(field: Deployment, death: Death) -> str:
    when = "" if death.t_s is None else f" at {death.t_s:.1f} s"
    again = " (started again)" if death.again else ""
    if death.id == ROUTER:
        again += "; the machine lost the frames that were sent without a router"
    tail, log = field.log_tail(death.id), field.log(death.id)
    ends = f"; its log, {log}, ends:\n{tail}" if tail else f" (log: {log})" if log.exists() else ""
    return f"{death.id} died{when}: {death.why}{again}{ends}"


def _remark(field: Deployment, stop: Stop) -> str:
    when = "before the start" if stop.t_s is None else f"at {stop.t_s:.1f} s"
    how_long = "and never resumed" if stop.for_s is None else f"for {stop.for_s:.1f} s"
    return f"{stop.id} {field.stopped} {when}, {how_long}"


def _pss_mb(field: Deployment) -> float | None:
    pids = field.pids()
    sensors = {place.id for place in field.plan.info.tagged(SENSES)}
    nodes = [pids[p.name] for p in field.plan.processes if p.id in sensors and p.name in pids]
    sizes = []
    for pid in nodes[:: max(len(nodes) // PSS_SAMPLE, 1)]:
        try:
            sizes.append(psutil.Process(pid).memory_full_info().pss / 1e6)
        except psutil.Error:
            continue
    return statistics.fmean(sizes) if sizes else None


@contextmanager
def _until_signal() -> Iterator[list[int]]:
    """A signal that asks the program to end ends the run early instead; the list holds those that came."""
    came: list[int] = []
    with handling(came.append):
        yield came


@contextmanager
def _interruptible(came: list[int]) -> Iterator[None]:
    """A signal that asks the program to end raises ``Interrupted``, and is noted."""

    def interrupt(number: int) -> None:
        came.append(number)
        raise Interrupted

    with handling(interrupt):
        yield
