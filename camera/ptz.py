"""The camera: an emulated Sony EVI-D30 at a serial line, which is told by VISCA (docs/visca.md).

Where the manuals leave open what it does, the comment at that place says what was chosen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from camera.head import REST, Head
from camera.sockets import Job, Sockets
from trackfield.models.pointing import AHEAD, EVI_D30, Direction
from trackfield.role import Effect, Event, Ignored, Received, Send, SetTimer, Started, State, Tell, Timer
from trackfield.wire import visca
from trackfield.wire.outside import Visca

VERTICAL_NS: Final = 16_683_333
"""A vertical cycle of NTSC, 1001 / 60000 s. In each the camera looks at one packet, and tells of what is done."""
MOST_WAITING: Final = 8
"""Packets that wait to be looked at; further ones are lost. A line of 9600 baud brings at most five a cycle."""
ALWAYS: Final = ("power", "version")
"""What it says even while it is switched off."""
TOP_SPEEDS: Final = (visca.PAN_SPEEDS[-1], visca.TILT_SPEEDS[-1])


@dataclass(frozen=True, slots=True)
class Memory:
    """Its address, whether it is on, where it looks, what it is doing, and what it has not looked at yet.

    ``said`` is the state that it told last.
    """

    address: int = 1
    on: bool = True
    head: Head = REST
    zoom: int = 0
    sockets: Sockets = Sockets()  # noqa: RUF009  a value
    waiting: tuple[bytes, ...] = ()
    said: str = ""


Done = tuple[Memory, list[Effect]]


class Camera:
    """A role that obeys ``peer``, at the other end of its line."""

    def __init__(self, *, id: str, peer: str) -> None:
        self.id, self.peer = id, peer
        self.kinds = frozenset({"visca"})

    def begin(self) -> Memory:
        """A camera without power: where it looked before does not matter, as it looks ahead when it gets power."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        match event:
            case Started(now):
                effects = [_motion(state.head), self._says(state, visca.Changed())]
                return _shown(state, now, effects)
            case Received(now, Visca(packet), self.peer):
                if len(state.waiting) == MOST_WAITING:
                    return state, (Ignored("more packets than it can look at"),)
                return _shown(replace(state, waiting=(*state.waiting, packet)), now, [])
            case Timer(now):
                return self._cycle(state, now)
        return state, (Ignored("unexpected"),)

    # --- a vertical cycle ------------------------------------------------------------------------------------------

    def _cycle(self, state: Memory, now: int) -> tuple[Memory, tuple[Effect, ...]]:
        """Tell of what is done, then look at one packet."""
        head, due = state.head, state.sockets.due(now)
        effects: list[Effect] = [self._says(state, visca.Completion(job.socket)) for job in due]
        state = _turning(replace(state, sockets=state.sockets.without(*due)), now)
        if state.waiting:
            state, more = self._look(replace(state, waiting=state.waiting[1:]), state.waiting[0], now)
            effects += more
        if state.head != head:
            effects.append(_motion(state.head))
        return _shown(state, now, effects)

    def _look(self, state: Memory, packet: bytes, now: int) -> Done:
        """What a packet makes it do."""
        told = visca.command_of(packet)
        if told is None:
            if visca.is_packet(packet) and packet[0] == 0x80 | state.address:
                return state, [self._says(state, visca.Failure(0, visca.SYNTAX))]
            return state, [Ignored("no packet for it")]
        match told:
            case visca.Told(visca.EVERYBODY, visca.AddressSet(address)):
                mine = address if address in visca.CAMERAS else state.address
                after = min(address + 1, visca.EVERYBODY)
                return replace(state, address=mine), [self._says(state, visca.NextAddress(after))]
            case visca.Told(visca.EVERYBODY, visca.Clear()):
                return _cleared(state, now), [self._says(state, visca.Cleared())]
            case visca.Told(state.address, command):
                return self._obey(state, command, now)
        return state, [Ignored("for another camera")]

    def _obey(self, state: Memory, command: visca.Command, now: int) -> Done:
        """What a command for this camera alone does: some at once, the rest in a socket."""
        match command:
            case visca.Clear():
                return _cleared(state, now), [self._says(state, visca.Completion(0))]
            case visca.Cancel(socket):
                return self._cancel(state, socket, now)
            case visca.Ask(what):
                allowed = state.on or what in ALWAYS
                reply = visca.Answer(_answer(state, what, now)) if allowed else visca.Failure(0, visca.NOT_EXECUTABLE)
                return state, [self._says(state, reply)]
        free = state.sockets.free
        if free is None:
            return state, [self._says(state, visca.Failure(0, visca.FULL))]
        if not state.on and not isinstance(command, visca.Power):
            return state, [self._says(state, visca.Failure(free, visca.NOT_EXECUTABLE))]
        state, effects = self._take(state, command, free, now)
        return state, [*effects, self._says(state, visca.Ack(free))]

    def _take(self, state: Memory, command: visca.Command, socket: int, now: int) -> Done:
        """A command in a socket."""
        soon = Job(socket, now + 1)  # done in the next cycle
        match command:
            case visca.Zoom(position):
                # How fast it zooms is in no manual that was found: it is there at once.
                return replace(state, zoom=position, sockets=state.sockets.taken(soon)), []
            case visca.Power(on=True):
                # It turns home, and has completed the command before it is there, as EVILib (AIST, 2002) found.
                head = state.head if state.on else state.head.turned(now, AHEAD)
                return replace(state, on=True, head=head, sockets=state.sockets.taken(soon)), []
            case visca.Power():
                state, effects = self._given_up(state, now)
                return replace(state, on=False, sockets=state.sockets.taken(soon)), effects
            case visca.Drive():
                # At once, whatever else turns it, or nothing could stop it but a cancel.
                state, effects = self._given_up(state, now)
                head = _turned(state.head, command, now)
                return replace(state, head=head, sockets=state.sockets.taken(soon)), effects
        # A turn while it turns waits: of its two buffers ("up to two commands including the commands currently being
        # executed", EVI-D70 manual, p. 33) that is the use. Player's driver (USC, 2000) cancels both for a third.
        waits = replace(state, sockets=state.sockets.taken(Job(socket, None, command)))
        return _turning(waits, now), []

    def _cancel(self, state: Memory, socket: int, now: int) -> Done:
        job = state.sockets.of(socket)
        if job is None:
            return state, [self._says(state, visca.Failure(socket, visca.NO_SOCKET))]
        turns = job.turn is not None and job.done_ns is not None
        head = state.head.stopped(now) if turns else state.head
        after = replace(state, head=head, sockets=state.sockets.without(job))
        return _turning(after, now), [self._says(state, visca.Failure(socket, visca.CANCELLED))]

    def _given_up(self, state: Memory, now: int) -> Done:
        """At rest, without the commands that turn it."""
        jobs = state.sockets.turns
        told = [self._says(state, visca.Failure(job.socket, visca.CANCELLED)) for job in jobs]
        return replace(state, head=state.head.stopped(now), sockets=state.sockets.without(*jobs)), told

    def _says(self, state: Memory, reply: visca.Reply) -> Effect:
        return Send(Visca(visca.reply_packet(reply, state.address)), self.peer, "serial")


def _cleared(state: Memory, now: int) -> Memory:
    """Without commands, and at rest."""
    return replace(state, head=state.head.stopped(now), sockets=Sockets())


def _turning(state: Memory, now: int) -> Memory:
    """It begins with the turn whose time has come, if there is one."""
    job = next(iter(state.sockets.turns), None)
    if job is None or job.turn is None or job.done_ns is not None:
        return state
    head = _turned(state.head, job.turn, now)
    return replace(state, head=head, sockets=state.sockets.begun(job, max(head.rests_ns, now + 1)))


def _turned(head: Head, command: visca.Command, now: int) -> Head:
    """It begins to turn as it is told."""
    at = head.at(now)
    match command:
        case visca.Absolute(pan_speed, tilt_speed, pan, tilt):
            to = Direction(visca.pan_deg(pan), visca.tilt_deg(tilt))
        case visca.Relative(pan_speed, tilt_speed, pan, tilt):
            to = Direction(at.pan + visca.pan_deg(pan), at.tilt + visca.tilt_deg(tilt))
        case visca.Drive(_, _, 0, 0):
            return head.stopped(now)
        case visca.Drive(pan_speed, tilt_speed, pan, tilt):
            to = Direction(pan * EVI_D30.pan if pan else at.pan, tilt * EVI_D30.tilt if tilt else at.tilt)
        case _:  # how a reset turns is in no manual that was found: as home does
            (pan_speed, tilt_speed), to = TOP_SPEEDS, AHEAD
    return head.turned(now, to, visca.pan_deg_s(pan_speed), visca.tilt_deg_s(tilt_speed))


def _answer(state: Memory, what: str, now: int) -> bytes:
    """The answer to an inquiry."""
    at = state.head.at(now)
    answers = {
        "position": visca.nibbles(visca.pan_steps(at.pan)) + visca.nibbles(visca.tilt_steps(at.tilt)),
        "speeds": bytes(TOP_SPEEDS),
        "zoom": visca.nibbles(state.zoom),
        "power": bytes([2 if state.on else 3]),
        "version": visca.VERSION,
    }
    return answers[what]


def _motion(head: Head) -> Effect:
    """What is told of where it looks, and turns to."""
    (start, to, pan_s, tilt_s) = head.motion
    return Tell("motion", (*start, *to, pan_s, tilt_s))


def _shown(state: Memory, now: int, effects: list[Effect]) -> tuple[Memory, tuple[Effect, ...]]:
    """With its state, if that is another one, and a timer for the next cycle in which there is something to do."""
    name = "moving" if now < state.head.rests_ns else "ready" if state.on else "off"
    if name != state.said:
        effects = [*effects, State(name)]
    times = [job.done_ns for job in state.sockets.jobs if job.done_ns is not None]
    if name == "moving":
        times.append(state.head.rests_ns)
    if state.waiting:
        times.append(now + 1)
    if times:
        effects = [*effects, SetTimer("cycle", -(-min(times) // VERTICAL_NS) * VERTICAL_NS)]
    return replace(state, said=name), tuple(effects)
