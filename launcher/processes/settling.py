"""Whether the processes of a run have settled: no put is under way, and nobody is behind.

The launcher asks all of them at a time, again and again (waves). Each answers, once it has reached the end of the run
and is not behind, how many samples came to it and how many it has put, by receiver. Puts of one wave that are no more
than what had come by the wave before can have no effect any more, so nothing is under way (Mattern 1987, the
four-counter method).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from launcher.processes import patience
from trackfield.drivers.exchange.intake import read, unpacked
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.fate import FIELD
from trackfield.role import NEIGHBOURHOOD
from trackfield.wire.error import WireError


class Answer(NamedTuple):
    """What a life has said: as an answer to which wave, how many samples came, and how many it put by receiver.

    One that is ``behind`` still has something to do.
    """

    wave: int
    came: int
    puts: Mapping[str, int]
    behind: bool = False


def answer_of(payload: bytes) -> Answer:
    """A life's answer. Raises ``WireError`` (``malformed``)."""
    return read(_answer, unpacked(payload))


def _answer(told: Any) -> Answer:
    wave, came, puts, behind = told
    whole = (type(wave), type(came), type(puts), type(behind)) == (int, int, dict, bool)
    if not (whole and all(type(to) is str and type(count) is int for to, count in puts.items())):
        raise WireError("malformed", "no answer to how much was put")
    return Answer(wave, came, puts, behind)


class Settling:
    """The latest answer of each life, and what had come to each when the wave before was over.

    ``lives`` are all that there are and were: what a dead one has put counts as well.
    """

    def __init__(self, lives: Mapping[str, ProcessSpec]) -> None:
        self.wave = 0
        self._lives = lives
        self._answers: dict[str, Answer] = {}
        self._came: dict[str, int] = {}

    def take(self, name: str, answer: Answer) -> None:
        """A life answers."""
        self._answers[name] = answer

    def wait(self, lives: Callable[[], Mapping[str, ProcessSpec]], ask: Callable[[int], None]) -> set[str]:
        """Wait until all ``lives`` have settled, but not for ever; returns those that have not.

        ``ask`` begins a wave of this number. ``lives`` is asked often, and also looks after them.
        """
        begun, pause_s = time.monotonic(), patience.WAVE_S
        while True:
            self._next_wave(lives())
            ask(self.wave)
            while self._missing(living := lives()) and time.monotonic() - begun < patience.OVERDUE_S:
                time.sleep(patience.WAVE_S)
            late = self._missing(living)
            behind = late | {name for name in living.keys() - late if self._answers[name].behind}
            unsettled = behind | self._unsettled(living)
            if not unsettled or time.monotonic() - begun > (patience.OVERDUE_S if behind else patience.SETTLE_S):
                return unsettled
            time.sleep(pause_s)
            pause_s = min(2 * pause_s, patience.PAUSE_S)

    def _next_wave(self, lives: Collection[str]) -> None:
        self._came = {name: self._answers[name].came for name in lives if name in self._answers}
        self.wave += 1

    def _missing(self, lives: Iterable[str]) -> set[str]:
        """The lives that have not answered the present wave."""
        return {name for name in lives if name not in self._answers or self._answers[name].wave < self.wave}

    def _unsettled(self, lives: Mapping[str, ProcessSpec]) -> set[str]:
        """Those of these lives to which something is still under way."""
        unicast: Counter[str] = Counter()
        broadcast: Counter[tuple[str, str]] = Counter()
        own: Counter[tuple[str, str, str]] = Counter()
        for name, answer in list(self._answers.items()):
            sender = self._lives[name]
            for to, count in answer.puts.items():
                if to.startswith(NEIGHBOURHOOD):
                    medium = to.removeprefix(NEIGHBOURHOOD) or FIELD
                    at = medium, sender.cell_in(medium)
                    broadcast[at] += count
                    own[sender.id, *at] += count
                else:
                    unicast[to] += count
        return {
            name
            for name, life in lives.items()
            if self._came.get(name, -1)
            < unicast[life.id] + sum(broadcast[at] - own[life.id, *at] for at in _listens(life))
        }


def _listens(life: ProcessSpec) -> Iterator[tuple[str, str]]:
    """The media and cells to which it listens."""
    return ((medium, cell) for medium in life.media for cell in life.cells_in(medium))
