"""Gives shares of a field (slices) to the hosts that ask for them, and knows who has which.

As with places, an answer keeps nothing: of two hosts that ask for one slice, the first that shows its token has it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from launcher.blocks import Standing, blocks, number_of, span
from launcher.processes.places.claims import Claims
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.wire import keys

AUTO: Final = "auto"
"""In place of a number: any slice that is free, or the one that this host had."""
TAKEN: Final = "taken"
"""The key of an answer that says why there is no slice now; there may be one later."""
_ROLE: Final = "slice"
KEPT: Final = 4
"""So many divisions of a field are remembered that somebody asked for."""


@dataclass(slots=True)
class Slice:
    """A slice that somebody has or had: by which ticket, on which host, whether it lives, whether it said goodbye."""

    number: int
    ticket: str
    host: str = "another host"
    live: bool = True
    left: bool = False


@dataclass(frozen=True, slots=True)
class Lost:
    """A slice that is gone since then (monotonic, ns), and what became of it, in words; its ``ids``."""

    number: int
    ticket: str
    why: str
    since_ns: int
    ids: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Question:
    """What a slice asks for: a number of so many, or ``auto``; who it is, and of which version."""

    which: str
    of: str
    host: str
    version: str


@dataclass(frozen=True, slots=True)
class _Division:
    """The field in slices: the ids of each, and what is offered."""

    blocks: Mapping[int, tuple[str, ...]]
    claims: Claims


class Desk:
    """The slices of a field with these ``planned`` lives; others than the launcher's own ``version`` are refused.

    In a secured run so many are ``certified``, and there are no others (None: it is not secured). How many there are
    (``of``; 0: not known yet) is settled by the first that lives: whoever only asks decides nothing.

    Methods raise ``LookupError`` for what stays wrong however long one waits.
    """

    def __init__(self, planned: Sequence[ProcessSpec], version: str, certified: int | None = None) -> None:
        self.of = 0
        self.slices: dict[int, Slice] = {}
        self._planned, self._version, self._certified = planned, version, certified
        self._divisions: dict[int, _Division] = {}

    def offer(self, asked: Question, now: float) -> tuple[int, int] | str:
        """The number of the slice that this host may have, and of how many; or why there is none now."""
        if asked.version != self._version:
            raise LookupError(f"this run is of Trackfield {self._version}, the slice of {asked.version}")
        if not self._planned:
            raise LookupError("this run has no processes for slices: it was started without --field external")
        of = _whole(asked.of, "the number of slices")
        claims = self._division(of).claims
        wanted = "" if asked.which == AUTO else str(number_of(_index(asked.which, of), of))
        offered = claims.offer(_ROLE, asked.host, now, wanted)
        if offered is not None:
            return int(offered), of
        return self._taken(int(wanted)) if wanted else f"all {of} slices are taken"

    def lives(self, number: int, of: int, now_ns: int | None) -> list[ProcessSpec]:
        """The planned lives of a slice, without those that are over at this emulated time (None: before the start)."""
        ids = set(self._division(of).blocks[number])
        over_ns = -1 if now_ns is None else now_ns
        return [life for life in self._planned if life.id in ids and not (life.kill_ns or over_ns + 1) <= over_ns]

    def came(self, number: int, of: int, ticket: str, now: float) -> bool:
        """A token with a valid ticket of this slice is there; False if another has the slice, or there is none such."""
        if of != self.of and not self._settle(of):
            return False
        known = self.slices.get(number)
        if known and known.live and known.ticket != ticket:
            return False
        if not known or known.ticket != ticket:
            self.slices[number] = Slice(number, ticket)
        self.slices[number].live = True
        self._division(of).claims.came(str(number), now)
        return True

    def confirm(self, number: int, of: int, ticket: str, host: str) -> str:
        """Note on which host the slice with this ticket is. Why it has no processes, if another has the slice."""
        known = self.slices.get(number)
        if self.of not in (0, of) and self._living():
            return self._other(of)
        if known and known.ticket == ticket:
            known.host = host
            self._division(of).claims.known(str(number), host)
            return ""
        return self._taken(number) if known and known.live else ""

    def lives_there(self, number: int, ticket: str) -> bool:
        """Whether the slice with this ticket was seen."""
        known = self.slices.get(number)
        return known is not None and known.live and known.ticket == ticket

    def went(self, number: int, ticket: str, now: float) -> bool:
        """The token is gone; whether that was the slice's own."""
        known = self.slices.get(number)
        if not known or known.ticket != ticket or not known.live:
            return False
        known.live = False
        self._division(self.of).claims.went(str(number), now)
        return True

    def leaves(self, number: int, ticket: str) -> None:
        """The holder of this slice says that it is about to go."""
        if (known := self.slices.get(number)) and known.ticket == ticket:
            known.left = True

    def lost(self, number: int, now_ns: int) -> Lost:
        """A slice that is gone now."""
        one = self.slices[number]
        how = "left" if one.left else "died, or cannot be reached"
        ids = self._division(self.of).blocks[number]
        return Lost(number, one.ticket, f"{self._text(number)} on {one.host} {how}", now_ns, ids)

    def missing(self, names: Collection[str]) -> list[str]:
        """Of which slices these processes are that are not there, in words; none if there was no slice yet."""
        ids = {keys.id_of(name) for name in names}
        blocks = self._division(self.of).blocks if self.of else {}
        found = [(number, [id for id in block if id in ids]) for number, block in blocks.items()]
        return [f"{self._text(number)} missing: {span(some)}" for number, some in found if some]

    def _text(self, number: int) -> str:
        return f"slice {number}/{self.of}"

    def _taken(self, number: int) -> str:
        return f"{self._text(number)} is taken: {self.slices[number].host} has it"

    def _other(self, of: int) -> str:
        return f"this run has {self.of} slices, not {of}"

    def _living(self) -> bool:
        return any(one.live for one in self.slices.values())

    def _settle(self, of: int) -> bool:
        """Divide the field among so many; False if it is divided among others that live."""
        if self._living():
            return False
        self._division(of)
        self.of, self.slices = of, {}
        return True

    def _division(self, of: int) -> _Division:
        """The field in so many slices."""
        if of != self.of and self._living():
            raise LookupError(self._other(of))
        if self._certified not in (None, of):
            has = f"certificates of {self._certified} slices" if self._certified else "no certificates of slices"
            raise LookupError(f"this run has {has}, not of {of}: trackfield certificates --slices {of} makes them")
        if of not in self._divisions:
            try:
                found = dict(enumerate(blocks(standing(self._planned), of), 1))
            except ScenarioError as error:
                raise LookupError(str(error)) from None
            for other in list(self._divisions)[:-KEPT]:
                if other != self.of:
                    del self._divisions[other]
            self._divisions[of] = _Division(found, Claims(dict.fromkeys(map(str, found), _ROLE)))
        return self._divisions[of]


def standing(field: Iterable[ProcessSpec]) -> list[Standing]:
    """Where these processes stand at the start, each once."""
    return list({life.id: Standing(life.id, life.x, life.y) for life in field}.values())


def facts(lives: Iterable[ProcessSpec]) -> dict[str, Any]:
    """What a slice has to know of these lives, in plain form.

    Of each the name, the role, whether it computes for long, its planned end (ns, None) and the number of its sensor
    in ``sensors`` (None): kind, options, and whether it plays what was recorded.
    """
    sensors: dict[tuple[str, bool], Mapping[str, Any]] = {}
    told = []
    for life in lives:
        which = None
        if life.sound:
            kind = life.sound["kind"], "times" in life.sound
            sensors.setdefault(kind, life.sound["options"])
            which = list(sensors).index(kind)
        told.append((life.name, life.role, life.sink, life.kill_ns, which))
    return {"lives": told, "sensors": [(kind, options, recorded) for (kind, recorded), options in sensors.items()]}


def _index(which: str, of: int) -> int:
    index = _whole(which, "the slice")
    if index > of:
        raise LookupError(f"there is no slice {index} of {of}: they count from 1, or from 0")
    return index


def _whole(text: str, what: str) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 6:
        raise LookupError(f"{what} is {text!r}: expected a whole number")
    return int(text)
