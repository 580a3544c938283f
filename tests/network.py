"""A field of cores whose samples come in any order, late, and more than once, as a test decides."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from trackfield.drivers.engine.conditions import NEVER
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Frame, Output, Sent, TakenBack
from trackfield.drivers.exchange.incoming import Incoming
from trackfield.drivers.exchange.outgoing import Outgoing
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, link_of
from trackfield.wire import keys
from trackfield.wire.envelope import Envelope

LATER = 2**61
"""When all samples arrive: after anything that was sent."""


class Payload(bytes):
    """Bytes as Zenoh gives them."""

    def to_bytes(self, *_: Any, **__: Any) -> bytes:
        return bytes(self)


def sample_of(frame: Frame, version: int | None, cell: str = "c0", put_ns: int = 0) -> Any:
    """A sample as a process puts it."""
    to_all, to_one = (frame.medium, cell, frame.src, frame.kind), (frame.medium, frame.to, frame.src, frame.kind)
    envelope = Envelope(frame.sent_ns, frame.incarnation, frame.copy, 0, put_ns, version)
    return SimpleNamespace(
        key_expr=keys.broadcast(*to_all) if frame.broadcast else keys.unicast(*to_one),
        payload=Payload(frame.payload),
        attachment=Payload(envelope.pack()),
    )


class Peer:
    """One process: its core, what it put, and the samples that have yet to come to it."""

    def __init__(self, run: RunSpec, spec: ProcessSpec, link: Any, field: dict[str, Peer]) -> None:
        self.spec, self.end_ns, self.field = spec, run.end_ns, field
        self.core: Core = build_core(run, spec, link, horizon_ns=NEVER)
        self.incoming = Incoming(spec, link, self.core, lambda t_ns: t_ns)
        self.outgoing = Outgoing(self._put)
        self.to_come: list[Any] = []

    def _put(self, frame: Frame, version: int) -> None:
        for peer in self.field.values():
            if peer.spec.hears(frame.medium, frame.to, frame.src, self.spec.cell):
                peer.to_come.append(sample_of(frame, version, self.spec.cell))

    def come(self, index: int, *, again: bool = False) -> None:
        """One of the samples arrives, and perhaps will do so again."""
        index %= len(self.to_come)
        sample = self.to_come[index] if again else self.to_come.pop(index)
        self.incoming.take(sample, LATER, self.end_ns)

    def due(self) -> bool:
        key = self.core.next_key()
        return key is not None and key[0] < self.end_ns

    def handle(self) -> None:
        self._release(self.core.handle_next())

    def catch_up(self) -> None:
        self._release(self.core.catch_up())

    def _release(self, outputs: Sequence[Output]) -> None:
        for output in outputs:
            if isinstance(output, Sent):
                self.outgoing.send(output.frame, 0, 0)
            elif isinstance(output, TakenBack):
                self.outgoing.take_back(output.frame)


def field_of(run: RunSpec, processes: Sequence[ProcessSpec]) -> dict[str, Peer]:
    """The peers of a run, each of which lives once."""
    field: dict[str, Peer] = {}
    link = link_of(run, processes)
    for spec in processes:
        field[spec.id] = Peer(run, spec, link, field)
    return field


def settle(field: dict[str, Peer], most: int = 100_000) -> None:
    """Let all come and all be handled, in no particular order."""
    for _ in range(most):
        busy = [peer for peer in field.values() if peer.to_come or peer.core.behind or peer.due()]
        if not busy:
            return
        for peer in busy:
            if peer.to_come:
                peer.come(-1)
            peer.catch_up()
            if peer.due():
                peer.handle()
    raise AssertionError("it never settles")
