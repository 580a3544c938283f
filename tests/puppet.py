"""A role on strings, which writes down all that happens to it and asks for what a test wants; an engine to run it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from tests.toys import Feedback, Reply, Request
from trackfield.drivers.engine.conditions import Conditions, Sense
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, Frame, Output, Sent
from trackfield.link.clock import Clock
from trackfield.role import NS, Effect, Event, Role
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.keys import Medium

MS = 1_000_000

Log = tuple[Event, ...]


class Puppet:
    """Its state is the events so far; ``react`` says what each of them makes it ask for."""

    def __init__(
        self,
        react: Callable[[Event], Iterable[Effect]] = lambda _: (),
        *,
        kinds: Iterable[str] = (),
        follows: bool = False,
    ) -> None:
        self.react, self.kinds, self.follows = react, frozenset(kinds), follows

    def begin(self) -> Log:
        return ()

    def handle(self, state: Log, event: Event) -> tuple[Log, tuple[Effect, ...]]:
        return (*state, event), tuple(self.react(event))


def script(answers: Mapping[Event, Iterable[Effect]], *, kinds: Iterable[str] = (), follows: bool = False) -> Puppet:
    """A puppet that asks for something when exactly these events happen."""
    return Puppet(lambda event: answers.get(event, ()), kinds=kinds, follows=follows)


def blind(name: str, t_ns: int) -> Any:
    raise LookupError(f"no sensor {name} at {t_ns}")


def core_of(
    role: Role[Any],
    *,
    clock: Clock | None = None,
    sense: Sense = blind,
    horizon_ns: int = 10 * NS,
    conditions: Conditions = Conditions(),  # noqa: B008  a frozen value
) -> Core:
    return Core(role, owner="me", clock=clock or Clock(), sense=sense, horizon_ns=horizon_ns, conditions=conditions)


def arrival(
    due_ns: int,
    message: Request | Reply | Feedback | bytes = b"",
    *,
    src: str = "peer",
    copy: int = 0,
    medium: Medium = "field",
) -> Arrival:
    """A frame to ``me`` that is due then; bytes are the payload of what pretends to be a request."""
    raw = isinstance(message, bytes)
    kind, payload = ("request", message) if raw else (kind_name(message), encode(message))
    return Arrival(due_ns, Frame(src, 0, kind, due_ns - MS, copy, "me", medium, payload))


def run(core: Core, until_ns: int) -> list[Output]:
    """Handle all that is due up to and including this time; what leaves."""
    outputs: list[Output] = []
    while (key := core.next_key()) is not None and key[0] <= until_ns:
        outputs += core.handle_next()
    return outputs


def caught_up(core: Core, *late: Arrival) -> list[Output]:
    """Offer these frames, and go back and handle all again that was handled before; what leaves."""
    for frame in late:
        core.offer(frame)
    outputs = core.catch_up()
    while (key := core.next_key()) is not None and key <= core.front:
        outputs += core.handle_next()
    assert not core.behind
    return outputs


def frames(outputs: Iterable[Output]) -> list[Frame]:
    return [o.frame for o in outputs if isinstance(o, Sent)]
