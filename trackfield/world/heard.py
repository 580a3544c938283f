"""The passes that a sensor finds in what it hears: heard once, in order of time, no farther than somebody asks."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

from trackfield.sensing.listening import Hear, Pass
from trackfield.sensing.readings import Window
from trackfield.sensing.sensing import Numbers

AHEAD_NS: Final = 2_000_000_000
"""A sensor that listens is asked again at whole multiples of this, and hears no farther than to the next."""
BESIDE_NS: Final = 1000
"""A clock that is read in whole nanoseconds may be so much beside the instant at which a pass is known, at most."""

KEPT: Final = 16
"""So many of the latest passes are kept."""


class Sounds(NamedTuple):
    """What a sensor may hear: the samples that each target emits (None: it sounds like a vehicle), or a recording.

    A ``recording`` begins at ``begins_ns``, and then nothing else is heard. Samples are those of ``listening.Audible``.
    """

    targets: tuple[bytes | None, ...] = ()
    recording: bytes | None = None
    begins_ns: int = 0


NO_SOUNDS: Final = Sounds()
"""All targets sound like vehicles."""


class Heard:
    """The passes of a sensor that listens from ``lead_ns`` before each of its windows to the window's end.

    What was heard is forgotten; the latest passes are kept. ``listen`` is called once, when there is something to hear.
    A life that is asked for the first time within a window hears nothing of before.
    """

    def __init__(self, windows: Sequence[Window], listen: Callable[[], Hear], lead_ns: int = 0) -> None:
        self._spans, self._listen = [(max(begin - lead_ns, 0), end) for begin, end in windows], listen
        self._born_ns: int | None = None
        self._hear: Hear | None = None
        self._number = -1
        """Of the latest span in which it listened; where two overlap, the later one counts."""
        self._coming: Iterator[tuple[int, Sequence[Pass]]] = iter(())
        self._until_ns = 0
        self._passes: list[Pass] = []

    def next(self, t_ns: int) -> int | None:
        """When, after this time, the sensor knows of the next pass, or has to be asked again; None after the last.

        That depends on the time alone: a process that goes back is told the same again.
        """
        self._born_ns = t_ns if self._born_ns is None else self._born_ns
        t_ns += BESIDE_NS
        again_ns = (t_ns // AHEAD_NS + 1) * AHEAD_NS
        number = bisect_right(self._spans, t_ns, key=lambda span: span[0]) - 1
        coming = [begin for begin, _ in self._spans[number + 1 : number + 2]]
        if number >= 0:
            if number > self._number:
                self._begin(number, max(self._spans[number][0], self._born_ns))
            while number == self._number and self._until_ns < again_ns and self._more():
                pass
            coming += [at for at, _ in self._passes if t_ns < at <= again_ns]
            if again_ns < self._spans[number][1]:
                coming.append(again_ns)
        return min(coming, default=None)

    def at(self, t_ns: int) -> Numbers | None:
        """What is reported of the pass that the sensor knows of at this time; None if it knows of none."""
        return next((values for at, values in self._passes if abs(at - t_ns) <= BESIDE_NS), None)

    def _begin(self, number: int, from_ns: int) -> None:
        while self._more():  # what is left of the span before
            pass
        self._hear = self._hear or self._listen()
        self._number, self._until_ns = number, from_ns
        self._coming = self._hear(from_ns, self._spans[number][1])

    def _more(self) -> bool:
        """Hear a piece more; False if there is none."""
        heard = next(self._coming, None)
        if heard is None:
            return False
        self._until_ns, told = heard
        self._passes = [*self._passes, *told][-KEPT:]
        return True
