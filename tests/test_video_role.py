"""Video as a role: frames at their instants, one shot at a time, and answers that are lost."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera.video import Video
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Ignored,
    IllegalEvent,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Tell,
    Timer,
)
from trackfield.wire.outside import Capture, Captured


class Rig:
    """The role with its timer; ``done`` is what it told and sent, and when."""

    def __init__(self) -> None:
        self.video = Video(id="video", control="control", frame_ns=NS // 10)
        self.state, self.due = self.video.begin(), None
        self.done: list[tuple[int, Effect]] = []

    def asked(self, now: int, number: int, lasts_s: float, sender: str = "control") -> list[Effect]:
        return self._handle(Received(now, Capture(number, lasts_s), sender, "backbone"))

    def run(self, until_ns: int) -> None:
        while self.due is not None and self.due <= until_ns:
            due, self.due = self.due, None
            self._handle(Timer(due, "frame"))

    def _handle(self, event: Received | Timer) -> list[Effect]:
        self.state, effects = self.video.handle(self.state, event)
        for effect in effects:
            if isinstance(effect, SetTimer | CancelTimer):
                self.due = effect.at if isinstance(effect, SetTimer) else None
        self.done += [(event.now, one) for one in effects if isinstance(one, Tell | Send)]
        return list(effects)


def captured(number: int, frames: int) -> Send:
    return Send(Captured(number, frames), "control", "backbone")


def test_a_shot_has_its_frames_and_an_end() -> None:
    rig = Rig()
    assert State("capturing") in rig.asked(7, 3, 0.5)
    rig.run(NS)
    frames = [(7 + i * NS // 10, Tell("exposed", (3, i))) for i in range(5)]
    assert rig.done == [*frames, (7 + NS // 2, captured(3, 5))]


def test_a_shot_that_is_asked_for_again_is_not_captured_twice() -> None:
    rig = Rig()
    rig.asked(0, 3, 0.5)
    assert rig.asked(NS // 5, 3, 0.5) == [Ignored("repeated")]
    rig.run(NS)
    assert rig.asked(2 * NS, 3, 0.5) == [captured(3, 5)]
    assert rig.due is None


def test_a_new_shot_ends_the_one_before() -> None:
    rig = Rig()
    rig.asked(0, 3, 5.0)
    rig.run(NS // 2 - 1)
    rig.done.clear()
    rig.asked(NS // 2, 4, 0.2)
    rig.run(9 * NS)
    assert [effect for _, effect in rig.done] == [Tell("exposed", (4, 0)), Tell("exposed", (4, 1)), captured(4, 2)]


def test_no_more_of_a_shot_ends_it() -> None:
    rig = Rig()
    rig.asked(0, 3, 5.0)
    rig.run(NS // 4)
    assert rig.asked(NS // 4, 9, 0.0) == [Ignored("no such shot")]
    assert captured(3, 3) in rig.asked(NS // 4, 3, 0.0)
    assert rig.due is None


def test_strangers_are_ignored_and_no_timer_rings_by_itself() -> None:
    rig = Rig()
    assert rig.video.handle(rig.state, Started(0))[1] == (State("waiting"),)
    assert rig.asked(1, 3, 5.0, sender="stranger") == [Ignored("unexpected")]
    with pytest.raises(IllegalEvent):
        rig.video.handle(rig.state, Timer(1, "frame"))


@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.integers(0, 300).map(lambda n: n / 100), st.integers(0, 2 * NS)), max_size=12
    )
)
def test_frames_of_a_shot_follow_each_other(wanted: list[tuple[int, float, int]]) -> None:
    """Whatever is asked for when: frames go 0, 1, 2, ... at the rate of the camera, and so many are said at the end."""
    rig, now = Rig(), 0
    for number, lasts_s, after_ns in wanted:
        now += after_ns
        rig.run(now)
        rig.asked(now, number, lasts_s)
    rig.run(now + 4 * NS)
    shot, frames, last_ns = None, 0, 0
    for at_ns, effect in rig.done:
        if isinstance(effect, Tell):
            if effect.values[1] == 0:
                shot, frames = effect.values[0], 0
            else:
                assert at_ns == last_ns + NS // 10
            assert effect.values == (shot, frames)
            frames, last_ns = frames + 1, at_ns
        else:
            assert isinstance(effect, Send)
            assert effect.message == Captured(effect.message.number, frames)
    assert rig.due is None
