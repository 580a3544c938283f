"""When processes are away as planned, since their containers are killed, stand still or are cut off."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Final

from trackfield.wire.keys import id_of

NOTICE_S: Final = 30.0
"""How long (wall time) after its end a fault of a container may still explain that a process is not there: the engine
is asked, Zenoh's lease passes, and the process has to join."""


@dataclass(frozen=True, slots=True)
class Away:
    """A fault of the container of the process ``id``: number ``fault`` of the scenario, of this ``kind``.

    It lasts from ``at_s`` until ``until_s`` (None: to the end of the run), seconds since the first step. ``network`` is
    the one that it is cut off from (empty: all).
    """

    fault: int
    kind: str
    id: str
    at_s: float
    until_s: float | None = None
    network: str = ""

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)

    @property
    def text(self) -> str:
        """As the log of what was done to containers names it."""
        return f"{self.kind} of {self.id} at {self.at_s:g} s"


def not_done(aways: Iterable[Away], log: str, until_s: float) -> list[Away]:
    """Those before ``until_s`` that the ``log`` does not say were brought about."""
    done = {line.partition(": ")[0] for line in log.splitlines() if ": failed: " not in line}
    return [one for one in aways if one.at_s < until_s and one.text not in done]


def as_planned(aways: Iterable[Away], name: str, since_s: float | None, speed: float) -> bool:
    """Whether one of them explains that the life ``name`` is not there from ``since_s`` on (None: before the start).

    The run goes at ``speed`` emulated seconds per second.
    """
    late_s = NOTICE_S * speed
    return since_s is not None and any(
        one.id == id_of(name) and one.at_s <= since_s and (one.until_s is None or since_s <= one.until_s + late_s)
        for one in aways
    )
