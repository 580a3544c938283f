"""An architecture in which a desk asks a camera four times a second where it looks, and turns it now and then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import trackfield as tf
from camera.ptz import Camera
from trackfield.role import NS, Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire import visca
from trackfield.wire.keys import Medium
from trackfield.wire.outside import Visca

EVERY_NS = NS // 4
TURN_EVERY = 6
"""Of so many packets one is a command to turn."""


class Watcher:
    """Sends packet after packet, whatever comes back."""

    kinds = frozenset({"visca"})

    def __init__(self, *, to: str) -> None:
        self.to = to

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started(now):
                return state, (SetTimer("next", now + EVERY_NS),)
            case Timer(now):
                packet = visca.command_packet(said(state))
                return state + 1, (Send(Visca(packet), self.to, "serial"), SetTimer("next", now + EVERY_NS))
            case Received(message=Visca()):
                return state, ()
        return state, (Ignored("unexpected"),)


def said(number: int) -> visca.Command:
    """What is sent with this number, from 0."""
    if number % TURN_EVERY:
        return visca.Ask("position")
    return visca.Absolute(0x18, 0x14, 80 * (number // TURN_EVERY + 1), -30)


@dataclass(frozen=True)
class Watched:
    """A centre and its nodes by radio; beside them a desk with a camera, by a line.

    ``framed`` is whether a message with a frame goes by the line, too.
    """

    framed: bool = False

    def arrange(self, field: tf.Field) -> tf.Arranged:
        ids, (x, y) = [id for id, *_ in field.sensors], field.centre
        sends = {"visca": ["camera"], **({"sync-request": ["camera"]} if self.framed else {})}
        wire: Sequence[Medium] = ("serial",)
        over = dict.fromkeys(sends, wire[0])
        desk = tf.Process("desk", "desk", x, y, Watcher, {"to": "camera"}, sends=sends, over=over, media=wire)
        told, back = {"id": "camera", "peer": "desk"}, {"visca": ["desk"]}
        camera = tf.Process("camera", "camera", x, y, Camera, told, sends=back, over={"visca": wire[0]}, media=wire)
        centre = field.fusion_centre("fusion", x, y, ids)
        return tf.Arranged([desk, camera, centre, *field.sensor_nodes("fusion")], {"base": ["fusion"]})
