"""The emulated camera without a driver: what it is told at which instant, and what it then does."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread

from camera.ptz import Camera, Memory
from trackfield.models.pointing import Direction, Motion
from trackfield.role import NS, Effect, Ignored, Received, Send, SetTimer, Started, State, Tell, Timer
from trackfield.role import Event as RoleEvent
from trackfield.wire import visca
from trackfield.wire.outside import Visca

MS = 1_000_000


class Driven:
    """A camera whose time goes on as it is told; ``heard`` is called with each packet that it sends."""

    def __init__(self, heard: Callable[[bytes], None] = lambda packet: None) -> None:
        self.role = Camera(id="camera", peer="control")
        self.state: Memory = self.role.begin()
        self.now, self.timer = 0, -1
        self.said: list[tuple[int, bytes]] = []
        self.motions: list[tuple[int, Motion]] = []
        self.states: list[tuple[int, str]] = []
        self.ignored: list[str] = []
        self.heard = heard
        self._handle(Started(0))

    def until(self, now: int) -> None:
        """Let time go on until then (ns)."""
        while 0 <= self.timer <= now:
            self.now, self.timer = self.timer, -1
            self._handle(Timer(self.now, "cycle"))
        self.now = now

    def packet(self, packet: bytes, sender: str = "control") -> None:
        """It gets a packet now."""
        self._handle(Received(self.now, Visca(packet), sender, "serial"))

    def tell(self, *commands: visca.Command, address: int = 1) -> None:
        """It is told this now."""
        for command in commands:
            self.packet(visca.command_packet(command, address))

    def look(self) -> Direction:
        """Where it says that it looks now."""
        at, motion = self.motions[-1]
        return motion.at((self.now - at) / NS)

    def replies(self) -> list[visca.Reply]:
        """What it has said since this was asked last."""
        said, self.said = self.said, []
        replied = [visca.reply_of(packet) for _, packet in said]
        assert None not in replied
        return [one.reply for one in replied if one is not None]

    def _handle(self, event: RoleEvent) -> None:
        self.state, effects = self.role.handle(self.state, event)
        for effect in effects:
            self._effect(effect)

    def _effect(self, effect: Effect) -> None:
        match effect:
            case Send(Visca(packet), "control", "serial"):
                self.said.append((self.now, packet))
                self.heard(packet)
            case SetTimer("cycle", at):
                assert at > self.now
                self.timer = at
            case Tell("motion", (pan, tilt, to_pan, to_tilt, pan_s, tilt_s)):
                values = [float(one) for one in (pan, tilt, to_pan, to_tilt)]
                motion = Motion(Direction(*values[:2]), Direction(*values[2:]), float(pan_s), float(tilt_s))
                self.motions.append((self.now, motion))
            case State(name):
                self.states.append((self.now, name))
            case Ignored(reason):
                self.ignored.append(reason)
            case _:
                raise AssertionError(effect)


def obedient(packets: list[tuple[int, bytes]]) -> Driven:
    """A camera that got these packets, each so many ns after the one before, and had the time to carry them out."""
    camera = Driven()
    for after, packet in packets:
        camera.until(camera.now + after)
        camera.packet(packet)
    camera.until(camera.now + 60 * NS)
    return camera


class Served:
    """The emulated camera at a terminal, in real time, until this is closed."""

    def __init__(self, file: int) -> None:
        self.file, self.path, self.over, self.noise, self.sent = file, "", Event(), 0, 0
        self.got: list[bytes] = []
        self.camera = Driven(self._send)
        self._begun, self._began_ns = b"", time.monotonic_ns()
        self._thread = Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """It is gone; its terminal stays open."""
        self.over.set()
        self._thread.join(10)

    def _send(self, packet: bytes) -> None:
        with suppress(OSError):  # nobody is there
            os.write(self.file, packet)
        self.sent += 1

    def _serve(self) -> None:
        while not self.over.is_set():
            wait_ns = self.camera.timer - self._now() if self.camera.timer >= 0 else 20 * MS
            found, _, _ = select.select([self.file], [], [], max(0, min(wait_ns, 20 * MS)) / NS)
            self.camera.until(self._now())
            if found:
                try:
                    self._hear(os.read(self.file, 100))
                except OSError:  # nobody is there yet
                    time.sleep(0.01)

    def _hear(self, data: bytes) -> None:
        heard = visca.split(self._begun, data)
        self._begun = heard.begun
        self.noise += heard.noise
        for packet in heard.packets:
            self.camera.packet(packet)
            self.got.append(packet)

    def _now(self) -> int:
        return time.monotonic_ns() - self._began_ns


def most_in_order(some: list[bytes], of: list[bytes]) -> int:
    """How many of these, at most, are some of those in their order: the longest common subsequence."""
    best = [0] * (len(of) + 1)
    for one in some:
        before = best[:]
        for i, other in enumerate(of, 1):
            best[i] = before[i - 1] + 1 if one == other else max(before[i], best[i - 1])
    return best[-1]
