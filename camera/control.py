"""Camera control: predicts where a fixed target will be, and has the camera look there (docs/camera.md).

The camera is for one target at a time, until that has left the picture. Of several the one that it meets first wins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from camera.fixes import NoFixError, read
from camera.line import Driver, Out, Phase
from camera.memory import KNOWN, Memory, Step, pack, unpack
from camera.settings import Settings
from camera.watching import Watching
from trackfield.models.pointing import Mount
from trackfield.protocols.timesync import TimeSync
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
)
from trackfield.wire.messages import SyncReply, SyncRequest
from trackfield.wire.outside import Captured, Item, ItemAck, Subscribe, Visca

FUTURE_NS: Final = NS
"""Clocks may differ by so much, at most, once they are set."""
BAUD: Final = 9600


class Control:
    """A role. ``wanted`` are the fields of its ``Subscribe``, ``sync`` is as in ``TimeSync.of``; see ``Settings``."""

    def __init__(
        self,
        *,
        mount: Mapping[str, float],
        wanted: Mapping[str, Any],
        sync: Mapping[str, Any] | None = None,
        baud: int = BAUD,
        **settings: Any,
    ) -> None:
        self.settings = Settings(mount=Mount(**mount), **settings)
        self.wanted, self.sync = dict(wanted), TimeSync.of(sync)
        self.driver = Driver(self.settings.camera, baud)
        self.watching = Watching(self.settings, self.driver)
        self.kinds = frozenset({"item", "visca", "captured"}) | self.sync.kinds

    def begin(self) -> Memory:
        """A process that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        due_ns = after.line.due_ns
        if due_ns != after.due_ns or (isinstance(event, Timer) and event.name == "line" and due_ns is not None):
            effects = (*effects, CancelTimer("line") if due_ns is None else SetTimer("line", due_ns))
        name = _name(after)
        if name != after.said:
            effects = (*effects, State(name))
        return replace(after, due_ns=due_ns, said=name), effects

    def _react(self, memory: Memory, event: Event) -> Step:
        match event:
            case Started():
                return self._start(memory, event)
            case Timer(name="sync") | Received(message=SyncRequest() | SyncReply()):
                time, effects = self.sync.handle(memory.time, event)
                return replace(memory, time=time), effects
            case Timer():
                return self._ring(memory, event)
            case Received():
                return self._received(memory, event)
        return memory, (Ignored("unexpected"),)

    def _ring(self, memory: Memory, event: Timer) -> Step:
        match event:
            case Timer(now, "ask"):
                return self._ask(memory, now)
            case Timer(now, "line"):
                return self._line(memory, now, self.driver.due(memory.line, now))
            case Timer(now, "over"):
                return self.watching.over(memory, now)
            case Timer(now, "captured"):
                return self.watching.uncaptured(memory, now)
        raise IllegalEvent(f"camera control has no timer {event.name!r}")

    def _received(self, memory: Memory, event: Received) -> Step:
        match event:
            case Received(_, Item(), self.settings.gateway):
                return self._item(memory, event)
            case Received(now, Visca(packet), self.settings.camera):
                return self._line(memory, now, self.driver.heard(memory.line, now, packet))
            case Received(_, Captured(number), self.settings.video):
                return self.watching.captured(memory, number)
        return memory, (Ignored("foreign"),)

    def _start(self, memory: Memory, event: Started) -> Step:
        """A life begins: the clock, the line, and what it wants, all anew."""
        notes = tuple[Effect, ...]()
        if event.stored:
            try:
                memory = unpack(event.stored)
            except ValueError as error:
                notes = (Note(f"What an earlier life stored cannot be used: {error}"),)
        time, effects = self.sync.handle(memory.time, event)
        memory, more = self._line(replace(memory, time=time), event.now, self.driver.start(memory.line, event.now))
        return memory, (*notes, *effects, *more, SetTimer("ask", event.now))

    def _ask(self, memory: Memory, now: int) -> Step:
        """Want fixes: at first soon again, as nothing confirms that the gateway heard of it, then each third."""
        third_ns = round(self.wanted["lasts_s"] * NS / 3)
        again_ns = min(NS << min(memory.asks, 16), third_ns)
        send = Send(Subscribe(**self.wanted), self.settings.gateway, "backbone")
        return replace(memory, asks=memory.asks + 1), (send, SetTimer("ask", now + again_ns))

    def _line(self, memory: Memory, now: int, out: Out) -> Step:
        """The line has news."""
        memory, effects = self.watching.news(replace(memory, line=out.line), now, out.news)
        return memory, (*out.effects, *effects)

    def _item(self, memory: Memory, event: Received) -> Step:
        """The gateway hands on what a head tells; it is told that this came, whatever it is."""
        item: Item = event.message
        ack = Send(ItemAck(item.number, item.life), event.sender, "backbone")
        key = (item.life, item.number)
        if key in memory.items:
            return memory, (ack, Ignored("repeated"))
        memory = replace(memory, items=(*memory.items, key)[-KNOWN:])
        now, notes = memory.time.corrected(event.now), tuple[Effect, ...]()
        try:
            target = read(item, self.settings, now)
        except NoFixError as error:
            return memory, (ack, Ignored(str(error)), Store(pack(memory)))
        if target.at_ns > now + FUTURE_NS:
            if memory.time.known or self.sync.rounds is None:
                return memory, (ack, Ignored("from the future"), Store(pack(memory)))
            late_ns = target.at_ns - now
            target = replace(target, at_ns=now, cpa_ns=target.cpa_ns - late_ns)
        if not memory.time.known and self.sync.rounds is not None:
            notes = (Note("a fix comes before its clock is set"),)
        memory, effects = self.watching.fix(memory, event.now, target)
        return memory, (ack, *notes, *effects, Store(pack(memory)))


def _name(memory: Memory) -> str:
    """The state that is told: of the camera if it is lost, else of the target that it is for."""
    if memory.line.phase is Phase.LOST:
        return "lost"
    if memory.watch is None:
        return "waiting"
    there = memory.watch.shot and memory.line.free and memory.line.running is None
    return "watching" if there else "aiming"
