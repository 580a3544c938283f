"""The engine of both drivers: one role, its due events in total order, and replay of events that came out of order.

A driver offers frames, asks for ``next_key`` and calls ``handle_next`` when that is due. A frame that arrives after an
event with a larger key was handled, or that was handled and is withdrawn, is dealt with by ``catch_up``: the state
before it is restored and everything since is handled again. What had left and should not have is taken back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from trackfield.drivers.engine.conditions import Conditions, Sense
from trackfield.drivers.engine.due import Due
from trackfield.drivers.engine.frames import RANK_FRAME, RANK_PORT, RANK_TIMER, EventKey, Input, Output
from trackfield.drivers.engine.life import Handled
from trackfield.drivers.engine.living import Living
from trackfield.drivers.engine.meter import NOTHING, Activities, Meter, spent
from trackfield.drivers.engine.undo import Former, History
from trackfield.host import Hosted, counts_of
from trackfield.link.clock import Clock
from trackfield.role import IllegalEvent, Role


class Core(Living):
    """One role and its events.

    ``horizon_ns`` is how far back (true time) events can be undone; 0: never, then all frames must come in order.
    ``inversions`` counts the frames that had to be inserted; ``host_late`` those that came, or were withdrawn, when
    that could no longer be done; ``front`` is the largest key that was ever handled.
    """

    __slots__ = (
        "_doubtful", "_due", "_former", "_history", "_inherited", "_inverted", "_last", "_withdrawn",
        "front", "horizon_ns", "host_late", "inversions",
    )  # fmt: skip

    def __init__(
        self,
        role: Role[Any],
        *,
        owner: str,
        clock: Clock,
        sense: Sense,
        conditions: Conditions = Conditions(),  # noqa: B008  a frozen value
        incarnation: int = 0,
        horizon_ns: int = 0,
    ) -> None:
        super().__init__(role, owner, clock, sense, conditions, incarnation)
        self.horizon_ns = horizon_ns
        self.inversions = self.host_late = 0
        self._due = Due()
        self._inverted: dict[EventKey, Input] = {}
        self._withdrawn: dict[EventKey, Input] = {}
        self._doubtful: EventKey | None = None  # the first event that is to be handled again
        self._last: EventKey = (conditions.start_ns - 1,)
        self.front = self._last
        self._history, self._former = History(self._last), Former()
        self._inherited: Activities = {}

    def next_key(self) -> EventKey | None:
        """The key of the next event, or None."""
        life = self.life
        if life.over:
            return None
        key = self.own_key()
        if life.started:
            first = self._due.first()
            if first is not None and (key is None or first < key):
                key = first
            alarms = life.alarms
            if alarms:
                timer = min((a.fires_ns, RANK_TIMER, a.due_ns, name) for name, a in alarms.items())
                key = timer if key is None else min(timer, key)
        return key if key is None or key[0] < self.conditions.kill_ns else None

    @property
    def behind(self) -> bool:
        """Whether ``catch_up`` has something to do."""
        return self._doubtful is not None

    @property
    def forgotten_ns(self) -> int:
        """The time (true, ns) up to which nothing can be undone."""
        return int(self._history.forgotten[0])

    @property
    def doubtful_ns(self) -> int:
        """The time (true, ns) from which ``catch_up`` handles events again."""
        return int(self._doubtful[0]) if self._doubtful else int(self._last[0])

    def waiting(self) -> Iterator[Input]:
        """What was offered and has not been handled."""
        yield from self._due
        yield from self._inverted.values()

    def owns(self, due_ns: int) -> bool:
        """Whether a frame due then belongs to this life."""
        return self.conditions.start_ns <= due_ns < self.conditions.kill_ns

    def offer(self, one: Input) -> bool:
        """Accept what is due here; what belongs before handled events waits for ``catch_up``.

        False if that is too long ago: it is counted, and nothing else happens.
        """
        key = one.key
        if key < self._history.forgotten:
            self.host_late += 1
            return False
        if key < self._last:
            self._inverted[key] = one
            self._doubt(key)
        else:
            self._due.add(key, one)
        return True

    def withdraw(self, one: Input) -> bool:
        """Take back what was offered; if it was handled, ``catch_up`` undoes that.

        False if that was too long ago: it is counted, and nothing else happens.
        """
        key = one.key
        if self._inverted.pop(key, None) is not None:
            return True
        if self._due.remove(key):
            if self._former:  # it may have been handled before, and never will again
                self._doubt(key)
            return True
        if key <= self._history.forgotten:
            self.host_late += 1
            return False
        self._withdrawn[key] = one
        self._doubt(key)
        return True

    def handle_next(self, key: EventKey | None = None) -> list[Output]:
        """Handle the next event, whose ``key`` is looked up unless it is given, and return its outputs, as far as they
        are not out already.
        """
        outputs = self._step(key or self.next_key())
        if not self._former:
            return outputs
        return self._former.compared(outputs, self._history) + self._passed()

    def catch_up(self) -> list[Output]:
        """Go back to before the first event that came out of order or was withdrawn; returns the resulting outputs.

        All since then is due again. What it had put out is taken back only if it turns out not to be put out again.
        """
        since, self._doubtful = self._doubtful, None
        if since is None:
            return []
        self.inversions += len(self._inverted)
        undone = self._history.since(since)
        if undone:
            self.life, self._last = undone[0].before, undone[0].last
        back = [h.input for h in undone if h.input is not None and self._withdrawn.get(h.key) != h.input]
        for one in (*back, *self._inverted.values()):
            self._due.add(one.key, one)
        self._inverted.clear()
        self._withdrawn.clear()
        self._former.add(undone)
        return self._passed()

    def _passed(self) -> list[Output]:
        key = self.next_key()
        return self._former.passed(None if key is None else key[0], self._history)

    def _doubt(self, key: EventKey) -> None:
        self._doubtful = key if self._doubtful is None else min(key, self._doubtful)

    def inherit(self, stored: bytes, before: Activities | None = None) -> None:
        """Take over what an earlier life stored and its use of the battery; to be called before this life starts."""
        self._inherited = {m: spent for m, spent in (before or {}).items() if m in self.conditions.powers}
        meter = Meter.new(self.conditions.powers, self.life.meter.since_ns, self._inherited)
        self.life = self.life._replace(stored=stored, meter=meter)

    def spent(self, until_ns: int) -> dict[str, list[int]] | None:
        """What this life and those before it took from its battery up to a true time, by medium; None on mains."""
        if self.life.meter.left_fj(self.conditions.powers) is None:
            return None
        return {medium: list(activity) for medium, activity in spent(self.record(until_ns)).items()}

    def record(self, until_ns: int) -> dict[str, Any]:
        """The counters of this life, up to a true time or its own end."""
        life = self.life
        end = max(min(until_ns, self.conditions.kill_ns), life.meter.since_ns)
        meter = life.meter if life.over or not life.started else life.meter.at(end)
        state = life.state
        while not isinstance(state, Hosted) and (inside := getattr(state, "role", None)) is not None:
            state = inside  # of what surrounds it: ``Collected``, ``Carried``, ``Managed``
        return {
            **life.tally,
            "incarnation": self.incarnation,
            "stored": life.stored,
            "inversions": self.inversions,
            "host_late": self.host_late,
            "activity": {m: list(a.minus(self._inherited.get(m, NOTHING))) for m, a in meter.activities.items()},
            "inherited": {medium: list(activity) for medium, activity in self._inherited.items()},
            "metered_ns": meter.since_ns - self.conditions.start_ns,
            **({"roles": counts_of(state)} if isinstance(state, Hosted) else {}),
        }

    # --- one event ---------------------------------------------------------------------------------------------

    def _step(self, key: EventKey | None) -> list[Output]:
        if key is None:
            raise IllegalEvent("nothing is due")
        before, last = self.life, self._last
        came = self._due.pop() if key[1] in (RANK_FRAME, RANK_PORT) else None
        outputs = self.live(key, came)
        # A timer set for this same instant may have a smaller key than the event that set it.
        self._last = max(last, key)
        self.front = max(self.front, key)
        self._history.add(Handled(key, before, last, came, outputs), key[0] - self.horizon_ns, self._doubtful)
        return outputs
