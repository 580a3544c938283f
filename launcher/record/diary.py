"""What one life of a process reported, in the order of its events, and its clock."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

from trackfield.drivers.engine.frames import RANK_FRAME, Died, EventKey, Refused, Telling, Told, Undone
from trackfield.drivers.engine.receiver import Opening, Receiver, Windows
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.clock import Clock
from trackfield.role import Corrected, Listen, Radio


@dataclass(frozen=True, slots=True)
class Event:
    """Settled telemetry: what a process reported at true time ``t_ns``."""

    t_ns: int
    process: str
    effect: Telling


@dataclass(slots=True)
class Diary:
    """One life; ``told`` is all of it, ``radio`` and ``corrections`` what is looked up in it by time.

    What is settled stays, whatever is undone later; ``late`` counts how often that was.
    """

    spec: ProcessSpec
    told: list[Told] = field(default_factory=list)
    radio: list[tuple[EventKey, Radio | Listen]] = field(default_factory=list)
    corrections: list[tuple[EventKey, int]] = field(default_factory=list)
    refused: dict[EventKey, str] = field(default_factory=dict)
    died: EventKey | None = None
    passed: int = 0  # how many of ``told`` were handed on as settled
    late: int = 0
    clock: Clock | None = None  # made when it is needed first
    latest_ns: int = -1  # the last event that was told
    kept_ns: int = -1  # what is told again up to here was settled when it was undone

    def write(self, output: Told | Refused | Undone, settled_ns: int = -1) -> None:
        """Add telemetry of the process; what it said of events up to ``settled_ns`` cannot be undone any more."""
        if isinstance(output, Undone):
            self._undo(output.key, min(settled_ns, self.latest_ns))
        elif output.key[0] > self.kept_ns:
            self.kept_ns = -1  # nothing before this is told again
            self.latest_ns = max(self.latest_ns, output.key[0])
            self._add(output)

    def _add(self, output: Told | Refused) -> None:
        if isinstance(output, Refused):
            self.refused[output.key] = output.reason
        elif isinstance(output.effect, Radio | Listen):
            self.radio.append((output.key, output.effect))
        else:
            self.told.append(output)
            if isinstance(output.effect, Died):
                self.died = output.key
            elif isinstance(output.effect, Corrected):
                self.corrections.append((output.key, output.effect.correction_ns))

    def _undo(self, since: EventKey, settled_ns: int) -> None:
        """Forget what it reported from this event on, as far as that is not settled."""
        if since[0] <= settled_ns:
            self.late += 1
            since, self.kept_ns = (settled_ns + 1,), settled_ns
        self.latest_ns = min(self.latest_ns, since[0] - 1)
        while self.told and self.told[-1].key >= since:
            self.told.pop()
        for tail in (self.radio, self.corrections):
            while tail and tail[-1][0] >= since:
                tail.pop()
        self.passed = min(self.passed, len(self.told))
        for key in [k for k in self.refused if k >= since]:
            del self.refused[key]
        if self.died is not None and self.died >= since:
            self.died = None

    def owns(self, due_ns: int) -> bool:
        """Whether a frame due then belongs to this life, as planned."""
        return self.spec.start_ns <= due_ns and (self.spec.kill_ns is None or due_ns < self.spec.kill_ns)

    def misses(self, medium: str, due_ns: int, span_ns: int = 0, preamble_ns: int = 0) -> str | None:
        """Why a frame due then, after so long on air, does not reach it: dead, frozen, asleep; None if it does."""
        if (cause := self._absent(due_ns)) is not None:
            return cause
        heard = self.receiver(medium, due_ns).hears_from(due_ns, span_ns, preamble_ns)
        return "asleep" if heard is None else None

    def _absent(self, due_ns: int) -> str | None:
        """Why nothing that is due then reaches it."""
        if self.died is not None and (due_ns, RANK_FRAME) > self.died:
            return "dead"
        return "frozen" if any(begin <= due_ns < until for begin, until in self.spec.freezes) else None

    def receiver(self, medium: str, t_ns: int) -> Receiver:
        """How the radio listened to a frame due at ``t_ns``: a change at t counts after t."""
        latest: list[tuple[int, Opening]] = []
        before = bisect_left(self.radio, t_ns, key=lambda told: told[0][0])
        for key, effect in reversed(self.radio[:before]):
            if effect.medium == medium and (not latest or key[0] < latest[-1][0]):
                latest.append((key[0], opening_of(effect)))
                if len(latest) == 2:
                    break
        if not latest:
            return Receiver()
        return Receiver(latest[0][1], latest[0][0], latest[1][1] if len(latest) == 2 else True)

    def awake(self, medium: str) -> list[tuple[int, Opening]]:
        """When frames begin and cease to reach it: (true time in ns, how its receiver is open); a change at t counts
        after t.
        """
        edges = [self.spec.start_ns - 1, *(key[0] for key, _ in self.radio)]
        edges += [edge - 1 for freeze in self.spec.freezes for edge in freeze]
        edges += [self.spec.kill_ns - 1] if self.spec.kill_ns is not None else []
        edges += [self.died[0]] if self.died is not None else []
        return [(t, self._opening(medium, t + 1)) for t in sorted(set(edges))]

    def _opening(self, medium: str, t_ns: int) -> Opening:
        """How its receiver is open at an instant; off where it is not there."""
        there = self.owns(t_ns) and self._absent(t_ns) is None
        return there and self.receiver(medium, t_ns).opening

    def local_ns(self, t_ns: int) -> int:
        """What its clock showed."""
        if self.clock is None:
            self.clock = Clock(**self.spec.clock)
        return self.clock.local(t_ns) + sum(by for at, by in self.spec.jumps if at <= t_ns)

    def clock_error_ns(self, t_ns: int) -> int:
        """By how much its clock was ahead, after its own correction."""
        known = bisect_right(self.corrections, t_ns, key=lambda c: c[0][0])
        return self.local_ns(t_ns) + (self.corrections[known - 1][1] if known else 0) - t_ns

    def settled(self, until_ns: int) -> Iterator[Event]:
        """What it reported up to this time and was not handed on before."""
        while self.passed < len(self.told) and self.told[self.passed].key[0] <= until_ns:
            told = self.told[self.passed]
            self.passed += 1
            yield Event(told.key[0], self.spec.id, told.effect)

    def waiting(self) -> list[Event]:
        """What it reported and was not handed on."""
        return [Event(told.key[0], self.spec.id, told.effect) for told in self.told[self.passed :]]


def opening_of(effect: Radio | Listen) -> Opening:
    """How a receiver is open after this effect, whose times are true."""
    if isinstance(effect, Radio):
        return effect.on
    return Windows(effect.every_ns, effect.open_ns, effect.from_ns, effect.detect_ns, effect.spare_ns)
