"""Receivers that listen in windows: what is heard, and for how long they are open, beside a count of every moment."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from trackfield.drivers.engine.receiver import Receiver, Windows, open_ns


@st.composite
def some_windows(draw: st.DrawFn) -> Windows:
    every = draw(st.integers(1, 60))
    opened = draw(st.integers(1, every))
    return Windows(every, opened, draw(st.integers(-50, 200)), draw(st.integers(0, opened)), draw(st.integers(0, 20)))


def is_open(windows: Windows, t: int) -> bool:
    return t >= windows.from_ns and (t - windows.from_ns) % windows.every_ns < windows.open_ns


@given(some_windows(), st.integers(-100, 400), st.integers(0, 300))
def test_how_long_windows_are_open(windows: Windows, begin: int, length: int) -> None:
    counted = sum(is_open(windows, t) for t in range(begin, begin + length))
    assert open_ns(windows, begin, begin + length) == windows.within(begin, begin + length) == counted


@given(some_windows(), st.integers(0, 400), st.integers(0, 100))
def test_a_frame_is_heard_if_a_window_has_enough_of_its_preamble(windows: Windows, begin: int, longer: int) -> None:
    """Each window is looked at: how long it is open while the preamble is on air."""
    ends = begin + windows.detect_ns + windows.spare_ns + longer
    opens = range(windows.from_ns, ends + 1, windows.every_ns)
    heard = [t for t in opens if min(t + windows.open_ns, ends) - max(t, begin) >= windows.detect_ns]
    assert windows.catches(begin, longer, -1000) == (max(*heard, begin) if heard else None)
    late = [t for t in heard if t >= 100]
    assert windows.catches(begin, longer, 100) == (max(*late, begin) if late else None)


@given(some_windows(), st.integers(300, 1000))
def test_a_preamble_as_long_as_the_interval_is_always_heard(windows: Windows, begin: int) -> None:
    assert windows.catches(begin, windows.every_ns, -1000) is not None


def test_on_and_off_count_when_a_frame_is_over() -> None:
    """As for a frame that is due then: a change at t counts after t."""
    receiver = Receiver().changed(False, 100)
    assert receiver.hears_from(100, 30) == 70
    assert receiver.hears_from(101, 30) is None
    again = receiver.changed(True, 100)
    assert again.hears_from(100, 30) == 70
    assert receiver.changed(True, 120).hears_from(121, 30) == 91


def test_who_was_on_when_a_frame_began_hears_it_though_windows_have_begun_since() -> None:
    windows = Windows(1000, 5, 500)
    receiver = Receiver().changed(windows, 100)
    assert receiver.hears_from(120, 30) == 90
    assert receiver.hears_from(140, 30) is None
    assert receiver.hears_from(532, 30) == 502
    assert receiver.hears_from(536, 30) is None
    assert receiver.changed(True, 530).hears_from(536, 30) == 506


def test_windows_of_before_do_not_count_for_those_of_now() -> None:
    old, new = Windows(100, 5, 0), Windows(100, 5, 50)
    receiver = Receiver().changed(old, 0).changed(new, 210)
    assert receiver.hears_from(230, 30) is None  # it began in the window at 200, and is over after the change
    assert receiver.hears_from(210, 10) == 200
    assert receiver.hears_from(280, 30) == 250


@given(some_windows(), st.integers(-100, 300), st.integers(1, 400), st.integers(0, 9), st.integers(0, 9))
def test_when_so_much_is_spent(windows: Windows, since: int, need: int, on: int, off: int) -> None:
    """Moment by moment: the first instant by which it is spent, if that comes within what is counted."""
    spent, t, last = 0, since, max(since, windows.from_ns) + windows.every_ns * (need + 1)
    while spent < need and t < last:
        spent += on if is_open(windows, t) else off
        t += 1
    found = windows.spent_ns(since, need, on, off)
    if spent < need:  # each round spends something, or none ever does
        assert found is None
        assert on == 0
        assert off == 0 or windows.open_ns == windows.every_ns
    else:
        assert found == t
