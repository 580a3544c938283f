"""What an operator does to a run from outside: each death and each stop is seen, told, and survived."""

from __future__ import annotations

import errno
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pyarrow.parquet as pq
import pytest

from launcher.plan.prepare import load, planned
from launcher.processes import children, deployment, patience
from launcher.processes.children import ZYGOTE, Children
from launcher.processes.deployment import Deployment
from launcher.processes.patience import MAX_RESTARTS
from launcher.processes.watch import SLICES, STOOD_STILL, Death, Stop, Watch
from launcher.processes.zygote import Child
from launcher.records import RECORDER, ROUTER, Plan
from launcher.run import Outcome, run_processes
from launcher.show import Quiet
from tests.running import until
from trackfield.errors import RunFailed
from trackfield.role import NS


def small(steps: int, *, speed: float = 1.0, **changes: Any) -> Plan:
    """The paper's scenario with few nodes; ``changes`` are of the plan."""
    return replace(planned(load("spcpf", settings=[f"target.steps={steps}"], nodes=16), speed), **changes)


class Operator(Quiet):
    """Does something to a run, each thing as soon as it is so far (emulated s)."""

    def __init__(self, *deeds: tuple[float, str, int]) -> None:
        self.field: Deployment | None = None
        self._deeds = list(deeds)

    def running(self, status: dict[str, Any]) -> None:
        while self.field and status and self._deeds and status["t_s"] >= self._deeds[0][0]:
            _, name, number = self._deeds.pop(0)
            os.kill(self.field.pids()[name], number)


@pytest.fixture
def disturbed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Runs a plan under an operator's hands."""

    def run(plan: Plan, *deeds: tuple[float, str, int]) -> Outcome:
        operator = Operator(*deeds)
        enter = Deployment.__enter__

        def introduced(field: Deployment) -> Deployment:
            operator.field = enter(field)
            return operator.field

        monkeypatch.setattr(Deployment, "__enter__", introduced)
        return run_processes(plan, tmp_path, operator)

    return run


def tracked_steps(folder: Path) -> set[int]:
    return set(pq.read_table(folder / "tracks.parquet")["step"].to_pylist())


def assert_accounted(frames: dict[str, Any]) -> None:
    """Each frame was delivered or lost, one way or another."""
    host = frames["host_lost"] + frames["host_late"]
    assert frames["expected"] == frames["delivered"] + sum(frames["lost"].values()) + host


def lives_heard(folder: Path, src: str) -> set[int]:
    rows = pq.read_table(folder / "messages.parquet").to_pylist()
    return {row["incarnation"] for row in rows if row["src"] == src}


# --- how soon it is seen -----------------------------------------------------------------------------------------


@contextmanager
def going_on(plan: Plan, folder: Path) -> Iterator[Deployment]:
    """A run that is under way, looked after by another thread, and ended with the block."""
    over = False
    with Deployment(plan, folder) as field:
        field.wait_ready(lambda ready, of: False)
        field.begin()
        watcher = Thread(target=field.watch, args=(lambda: over,))
        watcher.start()
        try:
            until(lambda: field.now_ns > NS)
            yield field
        finally:
            over = True
            watcher.join()
        field.finish()


EVERYBODY = ("n003", "n007", ROUTER, RECORDER, "fusion")
NEEDED = {ROUTER, RECORDER, ZYGOTE}


def test_each_death_is_seen_within_a_second(tmp_path: Path) -> None:
    with going_on(small(60), tmp_path) as field:
        for name in EVERYBODY:
            begun = time.monotonic()
            os.kill(field.pids()[name], signal.SIGKILL)
            until(lambda name=name: name in [death.id for death in field.deaths], timeout=5)
            assert time.monotonic() - begun < 1.0
    assert [(death.id, death.why, death.again) for death in field.deaths] == [
        (name, "signal 9", name == ROUTER) for name in EVERYBODY
    ]


def test_each_stop_is_seen_within_two_seconds_and_so_is_its_end(tmp_path: Path) -> None:
    with going_on(small(60), tmp_path) as field:
        for name in (*EVERYBODY, ZYGOTE):
            begun = time.monotonic()
            os.kill(field.pids()[name], signal.SIGSTOP)
            until(lambda name=name: name in [stop.id for stop in field.stops], timeout=5)
            seen = time.monotonic()
            assert seen - begun < 2.0
            os.kill(field.pids()[name], signal.SIGCONT)
            until(lambda: field.stops[-1].for_s is not None, timeout=5)
            assert time.monotonic() - seen < 2.0
    assert [stop.id for stop in field.stops] == [*EVERYBODY, ZYGOTE]
    assert field.deaths == []


# --- who stands still --------------------------------------------------------------------------------------------


def test_a_centre_that_stood_still_catches_up(disturbed: Callable[..., Outcome], tmp_path: Path) -> None:
    """Zenoh keeps its frames for as long as its lease lasts."""
    outcome = disturbed(small(9), (2, "fusion", signal.SIGSTOP), (6, "fusion", signal.SIGCONT))
    [stop] = outcome.metrics["processes"]["stopped"]
    assert stop["id"] == "fusion"
    assert 2 < stop["t"] < 6
    assert 1 < stop["s"] < 6
    assert outcome.metrics["processes"]["died"] == []
    assert outcome.metrics["frames"]["host_lost"] == 0
    assert tracked_steps(tmp_path) == set(range(1, 10))
    assert outcome.exit_code == 1
    assert outcome.complaints[0] == f"fusion was stopped from outside at {stop['t']:.1f} s, for {stop['s']:.1f} s"


def test_who_never_goes_on_does_not_hold_up_the_end(disturbed: Callable[..., Outcome]) -> None:
    outcome = disturbed(small(8, speed=2.0), (2, "n005", signal.SIGSTOP))
    [died], [stopped] = outcome.metrics["processes"]["died"], outcome.metrics["processes"]["stopped"]
    assert (died["id"], died["why"]) == ("n005", "stood still at the end, stopped from outside")
    assert (stopped["id"], stopped["s"]) == ("n005", None)
    assert outcome.exit_code == 1


@pytest.mark.parametrize("name", [RECORDER, ZYGOTE])
def test_who_cannot_be_replaced_is_continued(name: str, disturbed: Callable[..., Outcome], tmp_path: Path) -> None:
    outcome = disturbed(small(12), (2, name, signal.SIGSTOP))
    [stop] = outcome.metrics["processes"]["stopped"]
    assert stop["id"] == name
    assert stop["s"] > patience.NEEDED_STILL_S - 1.0
    assert outcome.complaints == (f"{name} was stopped from outside at {stop['t']:.1f} s, for {stop['s']:.1f} s",)
    assert outcome.exit_code == 1
    assert tracked_steps(tmp_path) == set(range(1, 13))


def test_at_the_end_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are needed once more: the one to write the tables, the other to say how the processes ended."""
    monkeypatch.setattr(patience, "NEEDED_STILL_S", 1.0)
    with Deployment(small(3, speed=2.0), tmp_path) as field:
        field.wait_ready(lambda ready, of: False)
        field.begin()
        field.watch(lambda: False)
        for name in (RECORDER, ZYGOTE):
            os.kill(field.pids()[name], signal.SIGSTOP)
        field.finish()
    assert tracked_steps(tmp_path) == {1, 2, 3}
    assert field.deaths == []


def test_all_end_with_the_zygote_and_the_tables_are_there(disturbed: Callable[..., Outcome], tmp_path: Path) -> None:
    outcome = disturbed(small(60), (3, ZYGOTE, signal.SIGKILL))
    [death] = outcome.metrics["processes"]["died"]
    assert (death["id"], death["why"]) == (ZYGOTE, "signal 9")
    assert outcome.complaints == (f"zygote died at {death['t']:.1f} s: signal 9",)
    assert outcome.exit_code == 1
    assert {1, 2} <= tracked_steps(tmp_path)


# --- who stands still before the start ---------------------------------------------------------------------------


class Hampered(Deployment):
    """Stops one of its processes as soon as it is there."""

    victim = ""

    def _make_children(self) -> Children:
        children = super()._make_children()
        fork = children.fork

        def forked(name: str, *arguments: Any) -> None:
            fork(name, *arguments)
            if name == self.victim:
                self._stop(children)

        children.fork = forked  # type: ignore[method-assign]
        if self.victim == ZYGOTE:
            self._stop(children)
        return children

    def _stop(self, children: Children) -> None:
        pid = children.pid(self.victim)
        assert pid
        os.kill(pid, signal.SIGSTOP)
        self.victim = ""


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little patience with those that stand still."""
    monkeypatch.setattr(patience, "NEEDED_STILL_S", 1.0)
    monkeypatch.setattr(patience, "STILL_S", 3.0)
    monkeypatch.setattr(children, "ASK_S", 1.0)


class FakeClock:
    """A clock that goes on while somebody sleeps."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, for_s: float) -> None:
        self.now += for_s


class Slow(Deployment):
    """A field without processes, whose registry says who is ready."""

    def __init__(self, names: list[str]) -> None:
        self._lives: Any = dict.fromkeys(names)
        self.registry: Any = SimpleNamespace(live=set(), arrivals=0)
        self._orders: Any = SimpleNamespace(look=lambda _: None)
        self._watch: Any = SimpleNamespace(still=lambda _: set())

    def _look_at_start(self) -> None:
        pass

    def failure(self, what: str, name: str) -> RunFailed:
        return RunFailed(what)


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("name", sorted(NEEDED))
def test_who_is_needed_cannot_hold_up_the_start(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Hampered, "victim", name)
    monkeypatch.setattr(patience, "READY_TIMEOUT_S", 40.0)
    with Hampered(small(3, speed=2.0), tmp_path) as field:
        field.wait_ready(lambda ready, of: False)
        field.begin()
        field.watch(lambda: False)
        field.finish()
    assert field.deaths == ([Death(ROUTER, STOOD_STILL, None, again=True)] if name == ROUTER else [])
    assert tracked_steps(tmp_path) == {1, 2, 3}


@pytest.mark.usefixtures("hasty")
def test_any_other_fails_it_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Hampered, "victim", "n005")
    with (
        Hampered(small(3), tmp_path) as field,
        pytest.raises(RunFailed, match="n005 was stopped from outside at start, and not continued"),
    ):
        field.wait_ready(lambda ready, of: False)


@pytest.mark.parametrize(("arriving", "ready"), [(4, True), (3, False)])
def test_those_that_start_slowly_are_waited_for_while_one_after_another_arrives(
    arriving: int, ready: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [RECORDER, "n000", "n001", "n002"]
    field, clock = Slow(names[1:]), FakeClock()
    monkeypatch.setattr(deployment, "time", clock)

    def one_in_forty_seconds(missing: set[str], of: int) -> bool:
        field.registry.live = set(names[: min(arriving, int(clock.now / 40.0))])
        return False

    if ready:
        field.wait_ready(one_in_forty_seconds)
    else:
        with pytest.raises(RunFailed, match="1 of 4 processes were not ready in time"):
            field.wait_ready(one_in_forty_seconds)
    assert clock.now > 160.0


def test_a_zygote_that_cannot_be_is_a_failed_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr(children.subprocess, "Popen", refused)
    with pytest.raises(RunFailed, match="no process could be started: Resource temporarily unavailable"):
        Children(1)


def test_a_zygote_that_does_not_answer_is_not_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is traced, or waits for a disk: to be continued does not help it."""
    monkeypatch.setattr(children, "ASK_S", 0.1)
    monkeypatch.setattr(children, "FORK_S", 0.3)
    monkeypatch.setattr(children, "_ZYGOTE", "import time; time.sleep(60)  # {path} {orders} {preload}")
    some = Children(1)
    for _ in range(2):
        with pytest.raises(RunFailed, match="the zygote has ended or does not answer"):
            some.fork("one", Child("any:thing", "one", os.devnull))
    some.close()


# --- a router that goes and comes back ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "why"),
    [
        (signal.SIGKILL, "signal 9"),
        (signal.SIGSTOP, "stood still for 3 s, stopped from outside, and was killed"),
    ],
)
def test_the_run_goes_on_with_another_router(
    number: int, why: str, disturbed: Callable[..., Outcome], tmp_path: Path
) -> None:
    outcome = disturbed(small(24, speed=2.0), (2, ROUTER, number))
    [death] = outcome.metrics["processes"]["died"]
    assert (death["id"], death["why"]) == (ROUTER, why)
    assert outcome.exit_code == 1
    assert "started again" in outcome.complaints[0]
    assert {21, 22, 23, 24} <= tracked_steps(tmp_path)
    assert_accounted(outcome.metrics["frames"])


def test_an_order_that_was_lost_with_the_router_is_given_again(tmp_path: Path) -> None:
    with Deployment(small(5, speed=2.0), tmp_path) as field:
        field.wait_ready(lambda ready, of: False)
        os.kill(field.pids()[ROUTER], signal.SIGKILL)
        until(lambda: not field.session.info.routers_zid())
        field.begin()
        field.watch(lambda: False)
        field.finish()
    assert field.deaths == [Death(ROUTER, "signal 9", field.deaths[0].t_s, again=True)]


# --- who takes its place again -----------------------------------------------------------------------------------


def test_the_dead_are_started_again_and_take_their_places(disturbed: Callable[..., Outcome], tmp_path: Path) -> None:
    """A second centre that the machine starts late misses what comes before it is there, which is said."""
    outcome = disturbed(small(24, restart=True), (2, "n010", signal.SIGKILL), (4, "fusion", signal.SIGKILL))
    died = [(death["id"], death["why"]) for death in outcome.metrics["processes"]["died"]]
    assert died == [("n010", "signal 9"), ("fusion", "signal 9")]
    node, fusion, *late = outcome.complaints
    assert "(started again)" in node
    assert "(started again)" in fusion
    frames = outcome.metrics["frames"]
    assert all("(frames.host_lost)" in complaint for complaint in late)
    assert len(late) == bool(frames["host_lost"])
    assert outcome.exit_code == 1
    assert lives_heard(tmp_path, "n010") == {0, 1}
    assert max(tracked_steps(tmp_path)) == 24  # by the second centre
    assert_accounted(frames)
    assert frames["lost"]["dead"] + frames["host_lost"] < frames["expected"] / 4


def test_nothing_is_started_again_unless_that_was_asked_for(disturbed: Callable[..., Outcome], tmp_path: Path) -> None:
    outcome = disturbed(small(6, speed=2.0), (2, "n005", signal.SIGKILL))
    assert [death["id"] for death in outcome.metrics["processes"]["died"]] == ["n005"]
    assert not (tmp_path / "logs" / "n005~1.log").exists()


def test_what_dies_again_and_again_is_left_dead(tmp_path: Path) -> None:
    with going_on(small(60, restart=True), tmp_path) as field:
        for life in range(MAX_RESTARTS + 1):
            name = f"n005~{life}" if life else "n005"
            until(lambda name=name: name in field.registry.live)
            os.kill(field.pids()[name], signal.SIGKILL)
            until(lambda name=name: name in [death.id for death in field.deaths])
    assert [death.again for death in field.deaths] == [True] * MAX_RESTARTS + [False]
    assert field.deaths[-1].why == f"signal 9; {MAX_RESTARTS} restarts are enough"


# --- what was planned is no failure ------------------------------------------------------------------------------


def test_a_planned_death_and_rebirth_is_nothing_to_report(disturbed: Callable[..., Outcome], tmp_path: Path) -> None:
    plan = small(12, speed=2.0)
    one = next(p for p in plan.processes if p.role == "node" and p.sound)
    lives = (replace(one, kill_ns=4 * NS), replace(one, incarnation=1, start_ns=7 * NS, kill_ns=10 * NS))
    others = tuple(p for p in plan.processes if p is not one)
    outcome = disturbed(replace(plan, processes=(*others, *lives)))
    assert outcome.metrics["processes"]["died"] == []
    assert outcome.exit_code == 0, outcome.complaints
    assert (tmp_path / "logs" / f"{one.id}~1.log").exists()


def test_one_that_dies_before_its_planned_death_is_reported(disturbed: Callable[..., Outcome]) -> None:
    plan = small(12, speed=3.0)
    doomed = [replace(p, kill_ns=12 * NS) if p.id == "n005" else p for p in plan.processes]
    outcome = disturbed(replace(plan, processes=tuple(doomed)), (2, "n005", signal.SIGKILL))
    assert [death["id"] for death in outcome.metrics["processes"]["died"]] == ["n005"]


# --- the watch by itself -----------------------------------------------------------------------------------------


class Ward:
    """Stands in for the children of a run: a test says who is in it, who stands still, and who ended."""

    def __init__(self, count: int) -> None:
        self.all = [f"n{i}" for i in range(count)]
        self.still: set[str] = set()
        self.ended: list[tuple[str, str]] = []
        self.killed: list[str] = []
        self.asked: list[str] = []

    def names(self) -> list[str]:
        return self.all

    def stopped(self, name: str) -> bool:
        self.asked.append(name)
        return name in self.still

    def gone(self) -> list[tuple[str, str]]:
        ended, self.ended = self.ended, []
        return ended

    def kill(self, name: str) -> None:
        self.killed.append(name)


def watching(ward: Ward, clock: Callable[[], float | None]) -> Watch:
    return Watch(ward, clock)  # type: ignore[arg-type]


def test_ten_looks_ask_everybody_once() -> None:
    ward = Ward(37)
    watch = watching(ward, lambda: 0.0)
    for _ in range(SLICES):
        before = len(ward.asked)
        watch.look()
        assert len(ward.asked) - before in (3, 4)
    assert sorted(ward.asked) == sorted(ward.all)


def test_two_stops_of_one_process_are_two() -> None:
    ward, clock = Ward(1), [0.0]
    watch = watching(ward, lambda: clock[0])
    for t_s, still in ((1.0, True), (1.5, True), (4.5, False), (6.0, True), (7.0, True)):
        ward.still, clock[0] = {"n0"} if still else set(), t_s
        for _ in range(SLICES):
            watch.look()
    assert watch.stops == [Stop("n0", 1.0, 3.5), Stop("n0", 6.0)]
    assert watch.still() == {"n0"}


def test_a_stall_that_only_one_look_sees_is_none() -> None:
    """A busy machine, or a debugger that looks at a process, may stop it for an instant."""
    ward = Ward(1)
    watch = watching(ward, lambda: 2.0)
    ward.still = {"n0"}
    while not ward.asked:
        watch.look()
    ward.still = set()
    for _ in range(SLICES):
        watch.look()
    assert (watch.stops, watch.still()) == ([], set())


def test_one_that_was_killed_while_it_stood_still_never_went_on() -> None:
    ward = Ward(2)
    watch = watching(ward, lambda: 2.0)
    ward.still = {"n1"}
    for _ in range(SLICES):
        watch.look()
    watch.kill("n1", "of no use")
    assert (ward.killed, watch.gone) == (["n1"], set())
    ward.still = set()
    assert watch.look() == []  # dying
    ward.ended = [("n1", "signal 9")]
    assert watch.look() == [("n1", "of no use")]
    for _ in range(SLICES):
        assert watch.look() == []
    assert watch.stops == [Stop("n1", 2.0)]
    assert watch.still() == set()
