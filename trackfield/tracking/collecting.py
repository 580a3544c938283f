"""Reports collected by step: until a step is closed at its deadline, and for some time after it.

The piece knows neither trackers nor deadlines: whoever composes it says when the next step is closed.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from immutables import Map

from trackfield.role import Effect, Ignored, Late

Heard = Map[str, Any]
"""The reports of one step, by sensor."""


class Instants(Protocol):
    """When steps are, by the clock of the process; a ``Bank`` knows."""

    def at_ns(self, step: int) -> int:
        """The time (ns) of a step."""
        ...

    def step_at(self, t_ns: int) -> int:
        """The latest step at this time."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Collected:
    """The reports at hand, by step.

    ``closed`` is the last step that is closed, ``ahead`` has the reports of the steps after it, and ``recent`` those of
    the closed steps for which late reports still count; ``stale`` is the oldest of these that got one since its use.
    """

    closed: int = 0
    ahead: Map[int, Heard] = field(default_factory=Map)
    recent: Map[int, Heard] = field(default_factory=Map)
    stale: int | None = None


@dataclass(frozen=True, slots=True)
class Collecting:
    """Collects the reports of ``sensors`` (their ids); one of a closed step counts up to an age of ``max_age_ns``."""

    instants: Instants
    sensors: Container[str]
    max_age_ns: int = 0

    def take(
        self, state: Collected, now: int, step: int, report: Any, sender: str
    ) -> tuple[Collected, tuple[Effect, ...]]:
        """A report on ``step``, received at ``now`` (ns): kept, or ignored for a reason."""
        recent = state.recent.get(step)
        if step <= state.closed and (recent is None or now - self.instants.at_ns(step) > self.max_age_ns):
            return state, (Ignored("late"),)
        if sender not in self.sensors:
            return state, (Ignored("unknown sensor"),)
        if step > self.instants.step_at(now) + 1:
            return state, (Ignored("from the future"),)
        heard = state.ahead.get(step, Map()) if recent is None else recent
        if sender in heard:
            return state, (Ignored("repeated"),)
        heard = heard.set(sender, report)
        if recent is None:
            return replace(state, ahead=state.ahead.set(step, heard)), ()
        stale = step if state.stale is None else min(step, state.stale)
        return replace(state, recent=state.recent.set(step, heard), stale=stale), (Late(),)

    def close(self, state: Collected, now: int) -> tuple[Collected, Heard]:
        """Close the step after the last closed one; also returns its reports. Late ones are then taken as used."""
        step = state.closed + 1
        heard = state.ahead.get(step, Map())
        ahead = state.ahead.delete(step) if step in state.ahead else state.ahead
        recent = state.recent.set(step, heard)
        for old in sorted(recent):
            if now - self.instants.at_ns(old) <= self.max_age_ns:
                break
            recent = recent.delete(old)
        return Collected(step, ahead, recent), heard
