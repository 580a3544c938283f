"""The clock of a run on another host: as right as the fastest exchange says, and shared by the processes there."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from tests.running import until
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.hostclock import DRIFT, Exchange, HostClock, Reading, better, host_id, reading
from trackfield.drivers.joining import clock as joining
from trackfield.drivers.joining.ask import JoinError, answer
from trackfield.drivers.joining.clock import ClockError, keep_clock, set_clock
from trackfield.drivers.session import open_client, open_router
from trackfield.wire import keys

NS = st.integers(0, 10**9)
OFFSETS = st.integers(-(10**15), 10**15)
WAYS = st.lists(st.tuples(NS, NS, NS), min_size=1, max_size=8)


def exchanges(offset_ns: int, ways: list[tuple[int, int, int]]) -> Iterator[Exchange]:
    """Questions and answers that took so long there, at the launcher, and back; its clock is ahead by the offset."""
    for i, (there, inside, back) in enumerate(ways):
        left = 10**16 + i * 10**10
        heard = left + there + offset_ns
        yield Exchange(left, heard, heard + inside, left + there + inside + back)


@given(OFFSETS, WAYS)
def test_an_offset_is_off_by_no_more_than_it_says(offset_ns: int, ways: list[tuple[int, int, int]]) -> None:
    found = reading(exchanges(offset_ns, ways))
    assert abs(found.offset_ns - offset_ns) <= found.uncertainty_ns + 1
    assert found.uncertainty_ns == min(there + back for there, _, back in ways) // 2


@given(OFFSETS, NS, NS)
def test_ways_that_take_as_long_leave_no_error(offset_ns: int, way_ns: int, inside_ns: int) -> None:
    [one] = exchanges(offset_ns, [(way_ns, inside_ns, way_ns)])
    assert (one.offset_ns, one.delay_ns) == (offset_ns, 2 * way_ns)


def test_an_old_reading_is_kept_as_long_as_it_is_better() -> None:
    """With 100 ppm between two clocks, 1 ms is lost in 10 s."""
    old = Reading(5, 1_000_000, 0)
    after_ns = 10 * 10**9
    lost_ns = round(DRIFT * after_ns)
    assert lost_ns == 1_000_000
    worse, as_good = Reading(7, 2_000_001, after_ns), Reading(9, 2_000_000, after_ns)
    assert better(old, worse) is old
    assert better(old, as_good) is as_good


def test_a_clock_goes_as_the_monotonic_one_does() -> None:
    clock = HostClock()
    before, now, after = time.monotonic_ns(), clock.now_ns(), time.monotonic_ns()
    assert before <= now <= after
    clock.set(-(10**12))
    before, now, after = time.monotonic_ns(), clock.now_ns(), time.monotonic_ns()
    assert before <= now + 10**12 <= after


def test_processes_share_an_offset_by_a_file(tmp_path: Path) -> None:
    file = tmp_path / "clock"
    ours, theirs = HostClock(file), HostClock(str(file))
    ours.set(-123_456_789_012_345)
    assert theirs.offset_ns == -123_456_789_012_345
    code = "import sys; from trackfield.drivers.hostclock import HostClock; print(HostClock(sys.argv[1]).offset_ns)"
    told = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=True)
    assert int(told.stdout) == -123_456_789_012_345
    assert file.stat().st_size == 8
    assert file.stat().st_mode & 0o777 == 0o600


# --- asked of a launcher ----------------------------------------------------------------------------------------------


class Launcher:
    """Tells its time, which is ahead, as host ``host``; how often it was asked."""

    def __init__(self, session: zenoh.Session, ahead_ns: int, told: dict[str, Any], seal: Seal) -> None:
        self.ahead_ns, self.asked = ahead_ns, 0
        self._told, self._seal = told, seal
        token = keys.launcher(session.info.zid())
        self._held = [
            session.declare_queryable(keys.CLOCK, self._on_question),
            session.liveliness().declare_token(token),
        ]

    def _on_question(self, query: zenoh.Query) -> None:
        self.asked += 1
        answer(query, keys.CLOCK, {"now_ns": time.monotonic_ns() + self.ahead_ns, **self._told}, self._seal)


Told = Callable[..., tuple[Launcher, zenoh.Session, Seal]]


@pytest.fixture(params=[b"", b"secret"], ids=["without", "with"])
def told(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Told]:
    endpoint = f"unixsock-stream/{tmp_path / 'r'}"
    with open_router(endpoint), open_client(endpoint, "run") as there, open_client(endpoint, "run") as here:

        def call(ahead_ns: int = 0, **told: Any) -> tuple[Launcher, zenoh.Session, Seal]:
            launcher = Launcher(there, ahead_ns, told, Seal(request.param))
            asking = here.declare_querier(keys.CLOCK)
            until(lambda: asking.matching_status.matching)
            return launcher, here, Seal(request.param)

        yield call


def test_on_the_launchers_host_there_is_nothing_to_set(told: Told) -> None:
    assert host_id()
    launcher, session, seal = told(12345, host=host_id(), most_ns=1)
    clock = HostClock()
    clock.set(99)
    assert set_clock(session, clock, seal, Refusals()) is None
    assert (clock.offset_ns, launcher.asked) == (0, 1)


@pytest.mark.parametrize("host", ["another", ""])
def test_on_another_host_the_clock_is_the_launchers(told: Told, host: str) -> None:
    """An empty name is that of a system which does not tell: no two of those are the same host."""
    launcher, session, seal = told(10**15, host=host, most_ns=10**9)
    clock = HostClock()
    read = set_clock(session, clock, seal, Refusals())
    assert read is not None
    assert abs(clock.offset_ns - 10**15) <= read.uncertainty_ns + 1
    assert launcher.asked == 1 + joining.EXCHANGES


def test_a_clock_is_measured_again(told: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    launcher, session, seal = told(10**15, host="another", most_ns=10**9)
    monkeypatch.setattr(joining, "AGAIN_S", 0.05)
    clock = HostClock()
    keep_clock(session, clock, seal, Reading(0, 10**12, time.monotonic_ns()))
    until(lambda: abs(clock.offset_ns - 10**15) < 10**9)
    before = launcher.asked
    until(lambda: launcher.asked > before)


def test_a_clock_that_is_too_uncertain_is_refused(told: Told) -> None:
    _, session, seal = told(10**15, host="another", most_ns=0)
    clock = HostClock()
    with pytest.raises(ClockError, match=r"known to \d+\.\d\d ms only, and this run bears 0\.00 ms: a slower run"):
        set_clock(session, clock, seal, Refusals())
    assert clock.offset_ns == 0


@pytest.mark.parametrize(
    "wrong", [{"most_ns": "1"}, {"most_ns": 1.5}, {}, {"now_ns": -1}, {"now_ns": None}, {"now_ns": 2**63}]
)
def test_what_is_no_time_is_refused(told: Told, wrong: dict[str, Any]) -> None:
    whole = {"host": "another", **({"most_ns": 10**9} if "now_ns" in wrong else {}), **wrong}
    _, session, seal = told(0, **whole)
    with pytest.raises(JoinError, match="the launcher tells no time"):
        set_clock(session, HostClock(), seal, Refusals())
