"""A post that wakes sleepers by LoRa: by clocks that are set, or by preambles as long as the interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from tests.protocols.chains import MS, acquainted
from tests.protocols.dozing import Call
from trackfield.draw import normal
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.link.radios import RADIOS
from trackfield.protocols.timesync import Timekeeping, TimeSync
from trackfield.protocols.wakeup import Wakeup
from trackfield.role import (
    NS,
    Corrected,
    Effect,
    Event,
    Ignored,
    Note,
    Radio,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
)

LORA: Final = RADIOS["lora868"](9)
EVERY_NS: Final = 4 * NS
LISTENS_NS: Final = 10 * MS
SLEEPERS: Final = 4
FIRST_NS: Final = 60 * NS
"""By then all have set their clocks."""
SYNC: Final[dict[str, Any]] = {
    "reference": "post",
    "exchanges": 4,
    "resync_ns": 600 * NS,
    "seed": 1,
}
"""The reply is longer than the request by 41 ms, of which half is the error of a clock that is set by them."""


def wakeup(unsure_ns: int | None, number: int) -> Wakeup:
    """The windows of sleeper ``number``; each has its own instant, so that the post's radio can serve all."""
    spare_ns = LORA.preamble_ns - LORA.detect_ns
    return Wakeup(EVERY_NS, LISTENS_NS, number * NS, LORA.detect_ns, spare_ns, unsure_ns)


class Post:
    """Its clock is the reference; from ``FIRST_NS`` on it calls all sleepers in each of their windows."""

    def __init__(self, *, unsure_ns: int | None, short: bool = False) -> None:
        self.unsure_ns, self.short, self.sync = unsure_ns, short, TimeSync()
        self.kinds = self.sync.kinds

    def begin(self) -> Timekeeping:
        return self.sync.begin()

    def handle(self, state: Timekeeping, event: Event) -> tuple[Timekeeping, tuple[Effect, ...]]:
        match event:
            case Timer(now, name):
                windows = wakeup(self.unsure_ns, int(name))
                preamble_ns = 0 if self.short else windows.preamble_ns
                call = Send(Call(int(name)), f"z{name}", preamble_ns=preamble_ns)
                return state, (call, self._next(int(name), now + NS))
            case Started():
                state, effects = self.sync.handle(state, event)
                return state, (*effects, *(self._next(i, FIRST_NS) for i in range(SLEEPERS)))
        return self.sync.handle(state, event)

    def _next(self, number: int, after_ns: int) -> SetTimer:
        """When sleeper ``number`` is called; one call takes longer than an interval if its preamble does."""
        if self.unsure_ns is None:
            rounds = after_ns // (2 * SLEEPERS * EVERY_NS) + 1
            return SetTimer(str(number), (rounds * SLEEPERS + number) * 2 * EVERY_NS)
        return SetTimer(str(number), wakeup(self.unsure_ns, number).send_at(after_ns))


@dataclass(frozen=True)
class Bed:
    """A sleeper's clock, and how often it was woken."""

    time: Timekeeping = field(default_factory=Timekeeping)
    woken: int = 0


class Dozer:
    """Sets its clock, and then sleeps but for its windows."""

    def __init__(self, *, number: int, unsure_ns: int | None, sync: dict[str, Any] | None) -> None:
        self.sync, self.windows = TimeSync.of(sync), wakeup(unsure_ns, number)
        self.kinds = self.sync.kinds | {"call"}

    def begin(self) -> Bed:
        return Bed()

    def handle(self, state: Bed, event: Event) -> tuple[Bed, tuple[Effect, ...]]:
        if isinstance(event, Received) and isinstance(event.message, Call):
            return replace(state, woken=state.woken + 1), (Note("woken"),)
        if isinstance(event, Received) and self.sync.rounds is None:
            return state, (Ignored("unexpected"),)
        asks = isinstance(event, Timer) and not state.time.in_round
        time, effects = self.sync.handle(state.time, event)
        state = replace(state, time=time)
        begun = isinstance(event, Started) and self.sync.rounds is None
        over = begun or any(isinstance(effect, Corrected) for effect in effects)
        listen = (self.windows.listen(time.correction_ns),) if over else (Radio(on=True),) if asks else ()
        return state, (*effects, *listen)


def party(
    *,
    unsure_ns: int | None,
    short: bool = False,
    clocks: bool = True,
    seconds: int = 180,
    speed: float = 1.0,
    seed: int = 1,
) -> tuple[RunSpec, list[ProcessSpec]]:
    """A post and its sleepers, whose clocks are off by a second and drift by 20 ppm, ready to run."""
    link = {"model": "lognormal_prr", "radio": "lora868", "sf": 9}
    post = ProcessSpec("post", "post", "tests.waking:Post", {"unsure_ns": unsure_ns, "short": short})
    return RunSpec("waking", seed, seconds * NS, link), acquainted([post, *_sleepers(unsure_ns, clocks, seed)])


def _sleepers(unsure_ns: int | None, clocks: bool, seed: int) -> Sequence[ProcessSpec]:
    return [
        ProcessSpec(
            f"z{i}",
            "dozer",
            "tests.waking:Dozer",
            {"number": i, "unsure_ns": unsure_ns, "sync": _sync(i) if clocks else None},
            x=100.0 * (i + 1),
            clock={
                "offset_ns": round(NS * normal(seed, i, "offset")),
                "drift_ppb": round(20_000 * normal(seed, i, "drift")),
                "ramp_ppb_per_h": 0,
            },
            power={"send_uw": 151_200, "receive_uw": 41_640, "listen_uw": 41_640, "sleep_uw": 6_001},
        )
        for i in range(SLEEPERS)
    ]


def _sync(number: int) -> dict[str, Any]:
    """Each asks in slots of its own length, so that they do not wait for each other's replies again and again."""
    return {**SYNC, "timeout_ns": 2 * NS + 370 * MS * number, "id": f"z{number}"}
