"""The passes that a sensor finds in what it hears: heard once, in order of time, no farther than somebody asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

from trackfield.sensing.listening import Hear, Pass
from trackfield.sensing.readings import Window
from trackfield.sensing.sensing import Numbers

AHEAD_NS: Final = 2_000_000_000
"""So far ahead is listened for a pass, at a time; if there is none, the sensor is asked again then."""
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
    A life that begins within a window hears nothing of before.
    """

    def __init__(self, windows: Sequence[Window], listen: Callable[[], Hear], lead_ns: int = 0) -> None:
        self._windows, self._listen, self._lead_ns = windows, listen, lead_ns
        self._hear: Hear | None = None
        self._window: Window | None = None
        self._coming: Iterator[tuple[int, Sequence[Pass]]] = iter(())
        self._until_ns = 0
        self._passes: list[Pass] = []

    def next(self, t_ns: int) -> int | None:
        """When, after this time, the sensor knows of the next pass, or has to be asked again; None after the last."""
        for window in self._windows:
            if window[1] <= t_ns:
                continue
            begin_ns = max(window[0] - self._lead_ns, 0)
            if t_ns < begin_ns:
                return begin_ns
            if window != self._window:
                self._begin(window, t_ns)
            while True:
                known = next((at for at, _ in self._passes if at > t_ns), None)
                if known is not None:
                    return known
                if self._until_ns >= t_ns + AHEAD_NS:
                    return self._until_ns
                if not self._more():
                    break
        return None

    def at(self, t_ns: int) -> Numbers | None:
        """What is reported of the pass that the sensor knows of at this time; None if it knows of none."""
        return next((values for at, values in self._passes if abs(at - t_ns) <= BESIDE_NS), None)

    def _begin(self, window: Window, t_ns: int) -> None:
        self._hear = self._hear or self._listen()
        self._window, self._until_ns = window, t_ns
        self._coming = self._hear(t_ns, window[1])

    def _more(self) -> bool:
        """Hear a piece more; False if there is none."""
        heard = next(self._coming, None)
        if heard is None:
            return False
        self._until_ns, told = heard
        self._passes = [*self._passes, *told][-KEPT:]
        return True
