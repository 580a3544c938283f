"""Unplanned events of the processes of a run: deaths, and stops from outside."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from launcher.processes import patience
from launcher.processes.children import Children

STOOD_STILL: Final = f"stood still for {patience.NEEDED_STILL_S:.0f} s, stopped from outside, and was killed"
SLICES: Final = 10
"""One in so many processes is checked for standing still at each look, which keeps a look cheap."""


@dataclass(frozen=True, slots=True)
class Death:
    """A process that died unplanned, ``t_s`` of emulated time after the first step (None: before the start).

    ``again`` says that another was started in its place.
    """

    id: str
    why: str
    t_s: float | None
    again: bool = False


@dataclass(frozen=True, slots=True)
class Stop:
    """A process that stood still from ``t_s`` on, as of a death, for ``for_s`` of emulated time (None: for good)."""

    id: str
    t_s: float | None
    for_s: float | None = None


@dataclass(slots=True)
class _Still:
    """A process that was seen standing still: ``since`` when (monotonic, s), and whether again at a later look."""

    stop: Stop
    since: float
    sure: bool = False


class Watch:
    """Looks after the children of a run; ``clock`` tells emulated seconds (None: before the start, at ``start_s``).

    ``gone`` are the names of those that ended, planned or not; ``deaths`` are to be reported, and so are ``stops``.
    """

    def __init__(self, children: Children, clock: Callable[[], float | None], start_s: float = 0.0) -> None:
        self.deaths: list[Death] = []
        self.gone: set[str] = set()
        self._children, self._clock, self._start_s = children, clock, start_s
        self._reasons: dict[str, str] = {}
        self._still: dict[str, _Still] = {}
        self._went_on: list[Stop] = []
        self._turn = 0

    @property
    def stops(self) -> list[Stop]:
        """The processes that stood still for longer than from one look to the next."""
        return [*self._went_on, *(still.stop for still in self._still.values() if still.sure)]

    def look(self) -> list[tuple[str, str]]:
        """(name, how) of each that ended since the last look; call it ``SLICES`` times a second.

        A process that is being killed is no longer checked: it does not resume, even if it no longer stands still.
        """
        ended = [(name, self._reasons.pop(name, why)) for name, why in self._children.gone() if name not in self.gone]
        for name, _ in ended:
            self.gone.add(name)
            if (still := self._still.pop(name, None)) and still.sure:
                self._went_on.append(still.stop)
        self._turn = (self._turn + 1) % SLICES
        for name in {*self._children.names()[self._turn :: SLICES], *self._still} - self.gone - self._reasons.keys():
            self._check(name)
        return ended

    def _check(self, name: str) -> None:
        still, before = self._children.stopped(name), self._still.get(name)
        if before is None:
            if still:
                self._still[name] = _Still(Stop(name, self._clock()), time.monotonic())
            return
        before.sure |= still
        if not still:
            del self._still[name]
            if before.sure and (now := self._clock()) is not None:
                since = self._start_s if before.stop.t_s is None else before.stop.t_s
                self._went_on.append(replace(before.stop, for_s=now - since))

    def still(self, at_least_s: float = 0.0) -> set[str]:
        """The processes that have stood still for at least so long (wall time)."""
        latest = time.monotonic() - at_least_s
        return {name for name, still in self._still.items() if still.since <= latest}

    def rouse(self, replaceable: str, others: set[str]) -> None:
        """Of those that all need: end this one if it stands still, continue the others; not at once (wall time)."""
        still = self.still(patience.NEEDED_STILL_S)
        if replaceable in still:
            self.kill(replaceable, STOOD_STILL)
        for name in still & others:
            self._children.resume(name)

    def give_up(self, name: str, why: str, *, again: bool = False) -> None:
        """Report that a process that stands still died when it stopped: it will not resume."""
        stop = self._still.pop(name).stop
        self.gone.add(name)
        self.deaths.append(Death(name, why, stop.t_s, again))

    def died(self, name: str, why: str, *, again: bool = False) -> None:
        """Report a death, now."""
        self.deaths.append(Death(name, why, self._clock(), again))

    def kill(self, name: str, why: str) -> None:
        """Kill a process; ``look`` will give this reason."""
        self._reasons[name] = why
        self._children.kill(name)

    def born(self, name: str) -> None:
        """A process of this name lives again."""
        self.gone.discard(name)
