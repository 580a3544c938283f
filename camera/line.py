"""The line to the camera: what was sent and not answered yet, what the camera is doing, and where it looks.

A packet that is not answered in time is sent twice more; then the camera is lost, and asked for its address once a
second. Before it is told where to look it is given an address, its commands are cleared, and it says where it looks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from statistics import median
from typing import Final, NamedTuple

from trackfield.models.pointing import AHEAD, EVI_D30, Direction, Motion
from trackfield.role import NS, Effect, Ignored, Note, Send, Tell
from trackfield.wire import visca
from trackfield.wire.outside import Visca

MS: Final = NS // 1000
PATIENCE_NS: Final = 100 * MS
"""A packet is answered in so long, or it is lost (Yang et al., section 4.2.2, gives none; the manual 16.7 ms)."""
TRIES: Final = 3
PROBE_NS: Final = NS
BUSY_NS: Final = 50 * MS
"""After so long a command is sent again that found no socket, or could not be carried out."""
MOST_BUSY: Final = 20
MOST_REFUSED: Final = 3
GRACE_NS: Final = NS
"""A turn may take so much longer than by the speeds of the axes, which a real one first has to reach."""
NEAR_DEG: Final = 1.0
"""The camera has arrived if it is as near as this."""
FIRST_ACK_NS: Final = 16_683_333
"""The time that a camera takes to answer, until one was measured: a vertical cycle (EVI-D30/D31 Command List)."""
MEASURED: Final = 5
BEGUN: Final = "begun"
BITS: Final = 10
ACK_BYTES: Final = 3
CANCEL_BYTES: Final = 3
TURN_BYTES: Final = 15
FULL_SPEED: Final = (visca.PAN_SPEEDS[-1], visca.TILT_SPEEDS[-1])


class Phase(Enum):
    """How far the line is; commands are sent when it is ``READY``."""

    OFF = "off"
    ADDRESSING = "addressing"
    CLEARING = "clearing"
    ASKING = "asking"
    READY = "ready"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class Pending:
    """A command without its answer: when its last byte had left, how often it was sent, and how often refused.

    At ``due_ns`` it is sent again; ``refused_last`` if that is because it was refused.
    """

    command: visca.Command
    left_ns: int
    due_ns: int
    tries: int = 1
    refused: int = 0
    refused_last: bool = False


def rests(at: Direction) -> Motion:
    """A camera that does not turn."""
    return Motion(at, at, EVI_D30.pan_s, EVI_D30.tilt_s)


@dataclass(frozen=True, slots=True)
class Line:
    """The state of the line. All times are local.

    The command to turn has the socket ``running``, or none; if that is in ``doubt``, as it was sent more than once, the
    other socket may have it, too. ``cancelled`` are sockets of which that is not confirmed.
    The camera began its ``motion`` at ``since_ns``. ``acks_ns`` are the last times that it took to answer. All that was
    given to the line has left at ``free_ns``.
    """

    phase: Phase = Phase.OFF
    pending: Pending | None = None
    running: int | None = None
    doubt: bool = False
    cancelled: tuple[int, ...] = ()
    motion: Motion = rests(AHEAD)  # noqa: RUF009  a value
    since_ns: int = 0
    acks_ns: tuple[int, ...] = ()
    free_ns: int = 0
    probe_ns: int = 0

    @property
    def free(self) -> bool:
        """Whether a command may be sent now."""
        return self.phase is Phase.READY and self.pending is None

    @property
    def due_ns(self) -> int | None:
        """When it has to be looked at again, if nothing comes."""
        if self.phase is Phase.LOST:
            return self.probe_ns
        if self.pending is not None:
            return self.pending.due_ns
        return None if self.running is None else self.rests_ns + GRACE_NS

    @property
    def taken(self) -> tuple[int, ...]:
        """The sockets that may have to be cancelled before another turn."""
        if self.doubt:
            return visca.SOCKETS
        return () if self.running is None else (self.running,)

    @property
    def rests_ns(self) -> int:
        """When the camera should have turned."""
        return self.since_ns + round(self.motion.lasts_s * NS)

    @property
    def ack_ns(self) -> int:
        """How long the camera takes to answer, and to begin: the median of the last answers."""
        return round(median(self.acks_ns)) if self.acks_ns else FIRST_ACK_NS

    def look(self, now: int) -> Direction:
        """Where the camera looks, as far as is known."""
        return self.motion.at((now - self.since_ns) / NS)


class Out(NamedTuple):
    """The line after something, what it asks for, and what is new of the camera: a word of ``Tell("camera")``.

    ``BEGUN``, which is not told, if it has forgotten where to turn.
    """

    line: Line
    effects: tuple[Effect, ...] = ()
    news: str = ""


@dataclass(frozen=True, slots=True)
class Driver:
    """Talks to ``camera`` at ``baud`` bits a second, ten for a byte."""

    camera: str
    baud: int

    def takes_ns(self, count: int) -> int:
        """How long so many bytes take."""
        return count * BITS * NS // self.baud

    def lead_ns(self, line: Line, now: int) -> int:
        """How long after ``now`` the camera begins to turn if it is told now."""
        count = CANCEL_BYTES * len(line.taken) + TURN_BYTES
        return max(line.free_ns - now, 0) + self.takes_ns(count) + line.ack_ns

    def look(self, line: Line, now: int) -> Direction:
        """Where it looks when it begins to turn: a turn that goes on is cancelled first."""
        ends = max(line.free_ns, now) + self.takes_ns(CANCEL_BYTES) + line.ack_ns
        return line.look(now if line.running is None else ends)

    # --- what it is told -------------------------------------------------------------------------------------------

    def start(self, line: Line, now: int) -> Out:
        """Begin anew: whatever the camera was told before, it forgets."""
        after = replace(line, phase=Phase.ADDRESSING, pending=None, running=None, doubt=False, cancelled=())
        return self._ask(after, now, visca.AddressSet())

    def turn(self, line: Line, now: int, to: Direction) -> Out:
        """Turn the camera; the line must be free. A turn that goes on is cancelled."""
        lead_ns, look = self.lead_ns(line, now), self.look(line, now)
        line, effects = self._cancel(line, now, line.taken)
        command = visca.Absolute(*FULL_SPEED, visca.pan_steps(to.pan), visca.tilt_steps(to.tilt))
        reached = Direction(visca.pan_deg(command.pan), visca.tilt_deg(command.tilt))
        motion = Motion(look, reached, EVI_D30.pan_s, EVI_D30.tilt_s)
        out = self._ask(replace(line, motion=motion, since_ns=now + lead_ns), now, command)
        return out._replace(effects=(*effects, *out.effects))

    def due(self, line: Line, now: int) -> Out:
        """Nothing came in time."""
        pending = line.pending
        if line.phase is Phase.LOST:
            line, effects = self._send(line, now, visca.AddressSet())
            return Out(replace(line, probe_ns=now + PROBE_NS), effects)
        if pending is None:  # a turn without its end
            return self._ask(replace(line, phase=Phase.ASKING), now, visca.Ask("position"))
        if pending.refused_last:
            return self._again(line, now, replace(pending, tries=1))
        if pending.tries >= TRIES:
            return self._lost(line, now)
        return self._again(line, now, replace(pending, tries=pending.tries + 1))

    def heard(self, line: Line, now: int, packet: bytes) -> Out:
        """The camera says something, or noise does."""
        replied = visca.reply_of(packet)
        reply = replied.reply if replied else None
        if isinstance(reply, visca.Ack | visca.Completion | visca.Failure):
            return self._of_command(line, now, reply)
        match reply:
            case visca.Changed():
                return self.start(line, now)._replace(news=BEGUN)
            case visca.NextAddress(address) if address > 1 and line.phase in (Phase.ADDRESSING, Phase.LOST):
                return self._ask(replace(line, phase=Phase.CLEARING), now, visca.Clear())
            case visca.Cleared() if line.phase is Phase.CLEARING:
                return self._ask(replace(line, phase=Phase.ASKING), now, visca.Ask("position"))
            case visca.Answer(data) if line.phase is Phase.ASKING:
                return self._located(line, now, data)
        return Out(line, (Ignored("out of nowhere"),))

    def _of_command(self, line: Line, now: int, reply: visca.Ack | visca.Completion | visca.Failure) -> Out:
        match reply:
            case visca.Ack(socket) if line.pending is not None and line.phase is Phase.READY:
                return self._taken(line, now, line.pending, socket)
            case visca.Completion(socket):
                return self._completed(line, socket)
            case visca.Failure(socket, why):
                return self._failed(line, now, socket, why)
        return Out(line, (Ignored("out of nowhere"),))

    # --- what it says ----------------------------------------------------------------------------------------------

    def _located(self, line: Line, now: int, data: bytes) -> Out:
        """Where the camera looks: after a turn that did not end, or at the start."""
        pan, tilt = visca.signed(data[:4]), visca.signed(data[4:])
        if pan is None or tilt is None:
            return Out(line, (Ignored("out of nowhere"),))
        at, to = Direction(visca.pan_deg(pan), visca.tilt_deg(tilt)), line.motion.to
        after = replace(
            line, phase=Phase.READY, pending=None, running=None, doubt=False, motion=rests(at), since_ns=now
        )
        if line.running is None:
            return _told(after, "ready")
        return _told(after, "there" if max(abs(at.pan - to.pan), abs(at.tilt - to.tilt)) <= NEAR_DEG else "failed")

    def _taken(self, line: Line, now: int, pending: Pending, socket: int) -> Out:
        """The camera begins to turn. What it cancels it says before; if it has not, it may not have heard of that."""
        begun_ns = now - self.takes_ns(ACK_BYTES)
        acks = line.acks_ns
        if pending.tries == 1 and not pending.refused:
            acks = (*acks, max(begun_ns - pending.left_ns, 0))[-MEASURED:]
        unheard = tuple(one for one in line.cancelled if one != socket)
        after = replace(
            line,
            pending=None,
            running=socket,
            doubt=pending.tries > 1,
            cancelled=(),
            since_ns=begun_ns,
            acks_ns=acks,
        )
        after, effects = self._cancel(after, now, unheard)
        if unheard:
            after = replace(after, running=socket, since_ns=after.free_ns + after.ack_ns)
        told = _told(after, "moving")
        return told._replace(effects=(*effects, *told.effects))

    def _completed(self, line: Line, socket: int) -> Out:
        """A turn is over; if its acknowledgement was lost, that came first."""
        if socket in line.cancelled:
            return Out(_without(line, socket))
        pending = line.pending if line.phase is Phase.READY and socket in visca.SOCKETS else None
        if socket != line.running and pending is None:
            return Out(line, (Ignored("out of nowhere"),))
        phase = Phase.READY if line.phase is Phase.ASKING else line.phase
        doubt = pending is not None and pending.tries > 1  # the camera may do it a second time
        after = replace(line, phase=phase, pending=None, running=None, doubt=doubt, motion=rests(line.motion.to))
        return _told(after, "there")

    def _failed(self, line: Line, now: int, socket: int, why: int) -> Out:
        """An error: of the turn, of a command that was cancelled, or of the last packet."""
        if socket in line.cancelled and why in (visca.CANCELLED, visca.NO_SOCKET):
            return Out(_without(line, socket))
        if socket and socket == line.running and why in (visca.CANCELLED, visca.NO_SOCKET, visca.NOT_EXECUTABLE):
            return self._gave_up(line, now, why)
        if line.pending is None or line.phase is Phase.LOST or why in (visca.CANCELLED, visca.NO_SOCKET):
            return Out(line, (Ignored("out of nowhere"),))
        pending = replace(line.pending, refused=line.pending.refused + 1, refused_last=True, due_ns=now + BUSY_NS)
        most = MOST_BUSY if why == visca.FULL else MOST_REFUSED
        if pending.refused < most:
            line = replace(line, pending=pending)
            return Out(*self._cancel(line, now, visca.SOCKETS)) if why == visca.FULL else Out(line)
        return self._gave_up(line, now, why) if line.phase is Phase.READY else self._lost(line, now)

    def _gave_up(self, line: Line, now: int, why: int) -> Out:
        """The camera will not turn as it was told: where does it look?"""
        out = self._ask(replace(line, phase=Phase.ASKING, running=None, doubt=False), now, visca.Ask("position"))
        note = Note(f"the camera failed: {visca.WORDS.get(why, f'error {why:02x}')}")
        return Out(out.line, (note, Tell("camera", ("failed",)), *out.effects), "failed")

    def _lost(self, line: Line, now: int) -> Out:
        after = replace(
            line, phase=Phase.LOST, pending=None, running=None, doubt=False, cancelled=(), probe_ns=now + PROBE_NS
        )
        told = _told(replace(after, motion=rests(line.look(now)), since_ns=now), "lost")
        return told._replace(effects=(Note("camera lost: it does not answer"), *told.effects))

    # --- sending ---------------------------------------------------------------------------------------------------

    def _cancel(self, line: Line, now: int, sockets: Sequence[int]) -> tuple[Line, tuple[Effect, ...]]:
        """Give up what these sockets do."""
        effects = list[Effect]()
        for socket in sockets:
            line, more = self._send(line, now, visca.Cancel(socket))
            effects += more
        if sockets:
            line = replace(line, running=None, doubt=False, cancelled=tuple(sorted({*line.cancelled, *sockets})))
        return line, tuple(effects)

    def _ask(self, line: Line, now: int, command: visca.Command) -> Out:
        line, effects = self._send(line, now, command)
        return Out(replace(line, pending=Pending(command, line.free_ns, line.free_ns + PATIENCE_NS)), effects)

    def _again(self, line: Line, now: int, pending: Pending) -> Out:
        line, effects = self._send(line, now, pending.command)
        again = replace(pending, left_ns=line.free_ns, due_ns=line.free_ns + PATIENCE_NS, refused_last=False)
        return Out(replace(line, pending=again), effects)

    def _send(self, line: Line, now: int, command: visca.Command) -> tuple[Line, tuple[Effect, ...]]:
        address = visca.EVERYBODY if isinstance(command, visca.Clear) else 1
        packet = visca.command_packet(command, address)
        left_ns = max(line.free_ns, now) + self.takes_ns(len(packet))
        return replace(line, free_ns=left_ns), (Send(Visca(packet), self.camera, "serial"),)


def _told(line: Line, news: str) -> Out:
    return Out(line, (Tell("camera", (news,)),), news)


def _without(line: Line, socket: int) -> Line:
    return replace(line, cancelled=tuple(one for one in line.cancelled if one != socket))
