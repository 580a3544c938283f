"""Video: exposes the frames of a shot when camera control asks for it (``capture``), and says when that is over.

What is in a frame depends on where the camera looks and on the targets, of which this process knows nothing: it tells
when each is exposed, and the recorder draws it (docs/video.md). One shot is captured at a time; a new one ends the one
before. The same shot asked for again, as its ``captured`` was lost, is answered, and not captured twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
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

FRAME: Final = "frame"
MOST_FRAMES: Final = 65535
"""A shot has so many at most: they are counted in two bytes."""
NONE: Final = -1


@dataclass(frozen=True, slots=True)
class Memory:
    """The last ``shot`` (``NONE``: there was none), its frames so far, and when it ends (local time, ns).

    It is ``over`` once that was said.
    """

    shot: int = NONE
    frames: int = 0
    until_ns: int = 0
    over: bool = True


Step = tuple[Memory, tuple[Effect, ...]]


class Video:
    """Process ``id``, which takes orders of the process ``control``; a frame is exposed every ``frame_ns``."""

    def __init__(self, *, id: str, control: str, frame_ns: int) -> None:
        self.id, self.control, self.frame_ns = id, control, frame_ns
        self.kinds = frozenset({"capture"})

    def begin(self) -> Memory:
        """A process that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> Step:
        """See ``trackfield.role.Role``. Raises ``IllegalEvent`` for a timer that it did not set."""
        match event:
            case Started():
                return state, (State("waiting"),)
            case Received(now, Capture() as asked, self.control):
                return self._asked(state, now, asked)
            case Received():
                return state, (Ignored("unexpected"),)
            case Timer(now, "frame") if not state.over:
                return self._expose(state, now)
        raise IllegalEvent(f"video cannot handle {event}")

    def _asked(self, memory: Memory, now: int, asked: Capture) -> Step:
        """Camera control wants a shot; 0 s: no more of it."""
        if asked.number == memory.shot and memory.over:
            return memory, (self._captured(memory),)
        if asked.number == memory.shot and asked.lasts_s:
            return memory, (Ignored("repeated"),)
        if not asked.lasts_s:
            return self._ended(memory) if asked.number == memory.shot else (memory, (Ignored("no such shot"),))
        after = Memory(asked.number, 0, now + round(asked.lasts_s * NS), over=False)
        begins = (State("capturing"),) if memory.over else ()
        return after, (*begins, SetTimer(FRAME, now))

    def _expose(self, memory: Memory, now: int) -> Step:
        if now >= memory.until_ns or memory.frames == MOST_FRAMES:
            return self._ended(memory)
        after = replace(memory, frames=memory.frames + 1)
        return after, (Tell("exposed", (memory.shot, memory.frames)), SetTimer(FRAME, now + self.frame_ns))

    def _ended(self, memory: Memory) -> Step:
        return replace(memory, over=True), (CancelTimer(FRAME), self._captured(memory), State("waiting"))

    def _captured(self, memory: Memory) -> Send:
        return Send(Captured(memory.shot, memory.frames), self.control, "backbone")
