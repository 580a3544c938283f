"""A caller wakes sleepers by radio, and tells a clerk by wire what they answer: two media, windows, long preambles.

Each sleeper's receiver is open for 5 ms every 200 ms, at an instant of its own clock; now and then one stays awake for
a while, or is off. The caller calls one every 120 ms, half of the time with a preamble as long as the interval, else
with a short one that is mostly missed. Who is called answers at once. The clerk counts what it is told, and says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

from tests.protocols.chains import MS, Chain, acquainted, kept, known, next_step, told
from tests.toys import mix
from trackfield.draw import bits
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NS, Effect, Event, Ignored, Listen, Radio, Received, Send, SetTimer, Started, Timer
from trackfield.wire.registry import kind

EVERY_NS: Final = 200 * MS
OPEN_NS: Final = 5 * MS
CALLS_NS: Final = 120 * MS
LOSS: Final = 0.1


@kind(213, "call")
@dataclass(frozen=True, slots=True)
class Call:
    """Whoever hears it answers."""

    chain: Chain


@kind(214, "reply-to-call")
@dataclass(frozen=True, slots=True)
class Here:
    """The answer to a call, or the clerk's to what it was told."""

    chain: Chain


@kind(215, "news")
@dataclass(frozen=True, slots=True)
class News:
    """What the caller tells the clerk."""

    chain: Chain


@dataclass(frozen=True)
class Mind:
    """A chain, and how many times something was done."""

    chain: int
    times: int = 0


class Chained:
    """What all three do: a step a second, in which the chain is published and kept."""

    kinds = frozenset[str]()

    def __init__(self, *, name: str, number: int, **more: Any) -> None:
        self.name, self.number, self.more = name, number, more

    def begin(self) -> Mind:
        return Mind(self.number)

    def handle(self, state: Mind, event: Event) -> tuple[Mind, tuple[Effect, ...]]:
        match event:
            case Started(now):
                state = Mind(*known(event, state.chain, 0))
                return state, (next_step(now), *self.begun(now))
            case Timer(now, "step"):
                step = told(self.name, now, state.chain), kept(state.chain, state.times), next_step(now)
                return state, (*step, *self.stepped(state, now))
            case Received(now, message, sender):
                state = replace(state, chain=mix(state.chain, message.chain), times=state.times + 1)
                return self.heard(state, message, sender, now)
            case Timer(now):
                return self.due(state, now)
        return state, (Ignored("unexpected"),)

    def begun(self, now: int) -> tuple[Effect, ...]:
        return ()

    def stepped(self, state: Mind, now: int) -> tuple[Effect, ...]:
        return ()

    def heard(self, state: Mind, message: Any, sender: str, now: int) -> tuple[Mind, tuple[Effect, ...]]:
        raise NotImplementedError

    def due(self, state: Mind, now: int) -> tuple[Mind, tuple[Effect, ...]]:
        raise NotImplementedError


class Caller(Chained):
    """Calls the ``sleepers`` and tells the clerk."""

    kinds = frozenset({"reply-to-call"})

    def begun(self, now: int) -> tuple[Effect, ...]:
        return (SetTimer("call", now + CALLS_NS),)

    def due(self, state: Mind, now: int) -> tuple[Mind, tuple[Effect, ...]]:
        sleepers = self.more["sleepers"]
        drawn = bits(self.number, "call", now, state.chain)
        long = EVERY_NS if drawn % 2 else 10 * MS
        call = Send(Call(state.chain), sleepers[drawn // 2 % len(sleepers)], preamble_ns=long)
        return state, (call, SetTimer("call", now + CALLS_NS))

    def heard(self, state: Mind, message: Any, sender: str, now: int) -> tuple[Mind, tuple[Effect, ...]]:
        return state, () if sender == "clerk" else (Send(News(state.chain), "clerk", "backbone"),)


class Sleeper(Chained):
    """Answers when it is called and hears it."""

    kinds = frozenset({"call"})

    def begun(self, now: int) -> tuple[Effect, ...]:
        return (self._doze(now),)

    def stepped(self, state: Mind, now: int) -> tuple[Effect, ...]:
        """Another way to listen, as the chain says."""
        return ((), (self._doze(now + 30 * MS),), (Radio(True),), (Radio(False),))[bits(state.chain, "how", now) % 4]

    def heard(self, state: Mind, message: Any, sender: str, now: int) -> tuple[Mind, tuple[Effect, ...]]:
        return state, (Send(Here(state.chain), sender), self._doze(now))

    def _doze(self, now: int) -> Listen:
        return Listen(EVERY_NS, OPEN_NS, now + self.number * MS, detect_ns=MS)


class Clerk(Chained):
    """Answers by wire."""

    kinds = frozenset({"news"})

    def heard(self, state: Mind, message: Any, sender: str, now: int) -> tuple[Mind, tuple[Effect, ...]]:
        return state, (Send(Here(state.chain), sender, "backbone"),)


def party(
    seed: int, *, speed: float = 1.0, size: int = 6, seconds: int = 10, loss: float = LOSS
) -> tuple[RunSpec, list[ProcessSpec]]:
    """A caller, its sleepers and a clerk, ready to run."""
    sleepers = [f"z{i}" for i in range(size)]
    both = ("field", "backbone")
    caller = _process("caller", "Caller", 0, both, sleepers=sleepers, number=seed)
    clerk = _process("clerk", "Clerk", size + 1, both[1:], number=7)
    others = [_process(id, "Sleeper", i + 1, both[:1], number=i + 1) for i, id in enumerate(sleepers)]
    link = {"model": "csma154", "burst_loss": loss, "burst_s": 0.2} if loss else {"model": "csma154"}
    wire = {"model": "ethernet", "delay_ms": 2.0}
    run = RunSpec(f"dozing-{seed}", seed, seconds * NS, link, speed, media={"backbone": wire})
    return run, acquainted([caller, clerk, *others])


def _process(id: str, role: str, place: int, media: tuple[Any, ...], **config: Any) -> ProcessSpec:
    plain = {"name": id, **config}
    return ProcessSpec(id, role.lower(), f"tests.protocols.dozing:{role}", plain, x=10.0 * place, media=media)
