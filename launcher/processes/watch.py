"""What befalls the processes of a run that nobody planned: deaths, and standing still."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from launcher.processes.children import Children

SLICES: Final = 10
"""A look asks this share of all whether they stand still, so that it costs little however many there are."""


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
    """Who was seen to stand still: ``since`` (monotonic, s) the first time, and whether at another look too."""

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
        """Who stood still for longer than from one look to the next."""
        return [*self._went_on, *(still.stop for still in self._still.values() if still.sure)]

    def look(self) -> list[tuple[str, str]]:
        """Who ended since the last look, and how; call it ``SLICES`` times a second.

        Who is being killed is not asked any more: it does not go on, even if it does not stand still any longer.
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
        """Who has been standing still for so long (wall time) now."""
        latest = time.monotonic() - at_least_s
        return {name for name, still in self._still.items() if still.since <= latest}

    def give_up(self, name: str, why: str, *, again: bool = False) -> None:
        """One that stands still will not go on: report that it died when it stopped."""
        stop = self._still.pop(name).stop
        self.gone.add(name)
        self.deaths.append(Death(name, why, stop.t_s, again))

    def died(self, name: str, why: str, *, again: bool = False) -> None:
        """Report a death, now."""
        self.deaths.append(Death(name, why, self._clock(), again))

    def kill(self, name: str, why: str) -> None:
        """End one that is of no use any more; ``look`` will give this reason."""
        self._reasons[name] = why
        self._children.kill(name)

    def born(self, name: str) -> None:
        """One by this name lives again."""
        self.gone.discard(name)
