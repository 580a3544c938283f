"""What a hostile peer sends: values, so that they can be put on a router as well as given to a parser."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum, Flag, auto
from random import Random
from typing import Any, Final, TypeVar

T = TypeVar("T")


class Means(Enum):
    """How a sample is brought in."""

    PUT = auto()
    DELETE = auto()
    QUERY = auto()
    TOKEN = auto()
    """A liveliness token, declared and given up again."""


class Follows(Flag):
    """What a bad sample must lead to. Of one that has neither flag, at least one of both must be true."""

    EITHER = 0
    REFUSED = auto()
    """Tracks and frames of the field stay as they would have been, bit for bit."""
    ALARM = auto()
    """The run says that it was interfered with, and ends with exit code 1."""


EITHER, REFUSED, ALARM = Follows.EITHER, Follows.REFUSED, Follows.ALARM


@dataclass(frozen=True)
class Sample:
    """Something at a key; ``plane`` and ``what`` say what is bad about it (a genuine one has neither)."""

    key: str
    payload: bytes = b""
    attachment: bytes | None = None
    means: Means = Means.PUT
    plane: str = ""
    what: str = ""
    follows: Follows = EITHER


@dataclass
class Known:
    """What a stranger can find out about a run.

    ``lives`` are the names of all planned lives, ``now_ns`` is emulated time, ``heard`` are the latest samples of the
    run's own processes.
    """

    nodes: tuple[str, ...]
    centre: str
    lives: tuple[str, ...]
    trackers: tuple[str, ...]
    now_ns: int = 0
    heard: deque[Sample] = field(default_factory=lambda: deque(maxlen=500))

    def heard_below(self, prefix: str) -> list[Sample]:
        """What was heard at keys that begin like this."""
        return [sample for sample in list(self.heard) if sample.key.startswith(prefix)]


class Draw(Random):
    """The draws of one attack on a run of which this is known."""

    known: Known

    def node(self) -> str:
        return self.choice(self.known.nodes)

    def anyone(self) -> str:
        return self.choice([*self.known.nodes, self.known.centre])

    def stranger(self) -> str:
        """An id that nobody in the field has."""
        return self.choice(["ghost", "n999", "fusion2", "_", "a" * 32, f"x{self.randrange(10**6)}"])

    def junk(self, most: int = 300) -> bytes:
        return self.randbytes(self.randint(0, most))

    def value(self, depth: int = 3) -> Any:
        """Anything that MessagePack can hold."""
        kinds: list[Callable[[], Any]] = [
            lambda: None,
            lambda: self.random() < 0.5,
            lambda: self.choice([0, 1, -1, 5, 2**31, -(2**63), 2**64 - 1, 10**9]),
            lambda: self.choice([0.0, -1.5, 1e308, float("inf"), float("nan")]),
            lambda: self.choice(["", "n001", "\x1b[2J\x1b[31mred", "a" * 5000, "\u202edemon", "\x00", "delivered"]),
            lambda: self.junk(40),
        ]
        if depth:
            kinds.append(lambda: [self.value(depth - 1) for _ in range(self.randint(0, 5))])
            kinds.append(lambda: {str(self.value(0)): self.value(depth - 1) for _ in range(self.randint(0, 5))})
            kinds.append(lambda: {self.randint(-3, 3): self.value(depth - 1) for _ in range(self.randint(0, 3))})
        return self.choice(kinds)()

    def mutated(self, data: bytes) -> bytes:
        """These bytes with one to four of them changed, lost, doubled or added."""
        new = bytearray(data)
        for _ in range(self.randint(1, 4)):
            at = self.randrange(len(new) + 1)
            match self.randrange(4):
                case 0 if at < len(new):
                    new[at] ^= 1 << self.randrange(8)
                case 1 if at < len(new):
                    del new[at : at + self.randint(1, 8)]
                case 2:
                    new[at:at] = new[at : at + self.randint(1, 8)]
                case _:
                    new[at:at] = self.randbytes(self.randint(1, 3))
        return bytes(new)


Make = Callable[[Draw], Sample | None]
"""Makes a bad sample; None where too little was heard of the run so far."""


@dataclass(frozen=True)
class Bad:
    """One thing that can be bad about a sample."""

    what: str
    plane: str
    follows: Follows
    make: Make

    def sample(self, draw: Draw) -> Sample | None:
        made = self.make(draw)
        return made and replace(made, plane=self.plane, what=self.what, follows=self.follows)


ALL: Final[dict[str, Bad]] = {}
"""All that is tried, by what is bad about it."""


def bad(plane: str, follows: Follows) -> Callable[[Make], Make]:
    """Enter a function into ``ALL``; its name says what is bad."""

    def enter(make: Make) -> Make:
        what = make.__name__.replace("_", " ")
        ALL[what] = Bad(what, plane, follows, make)
        return make

    return enter
