"""What all planned faults have in common: the processes they affect, and when."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal, Self, TypeVar

from pydantic import Field, model_validator

from trackfield.scenario.quantities import MOST_NODES, SHORT_S, Instant, LaterInstant, SomeShare
from trackfield.scenario.section import Section, Word, wrong
from trackfield.words import quoted

T = TypeVar("T")
Ids = Annotated[tuple[Word, ...], Field(min_length=1, max_length=MOST_NODES)]


class FaultSection(Section):
    """A fault; ``kind`` is its name, and it happens or begins ``at_s``."""

    kind: str
    nodes: Ids | None = Field(default=None, description="the affected processes, by id; or give a share or a role")
    share: SomeShare | None = Field(
        default=None,
        description="share of the role, or else of the sensor nodes, drawn by seed and fault number; instead of nodes",
    )
    role: Word | None = Field(
        default=None,
        min_length=1,
        description="all processes of this role, like node or fusion; with share, a share of them",
    )
    part: Literal["tracking", "base"] | None = Field(
        default=None,
        description="instead of a role: the processes that fuse reports in the network, or else the centre (tracking), "
        "or those at the base (base), whatever the architecture; with share or nearest, some of them",
    )
    nearest: int | None = Field(
        default=None,
        ge=1,
        le=MOST_NODES,
        description="of the role or the part, or else of the sensor nodes, so many that stand nearest to a target at "
        "at_s; instead of nodes or a share",
    )
    at_s: float

    @model_validator(mode="after")
    def _befalls_someone(self) -> Self:
        others = [name for name in ("share", "role", "part", "nearest") if getattr(self, name) is not None]
        if self.nodes is None and not others:
            raise wrong("affects no process", "nodes (a list of ids), share (from 0 to 1) or role", ".nodes")
        if self.nodes is not None and others:
            raise wrong("is given together with nodes", "one of the two", f".{others[0]}")
        for one, other in (("part", "role"), ("nearest", "share")):
            if one in others and other in others:
                raise wrong(f"is given together with {other}", "one of the two", f".{one}")
        for id, times in Counter(self.nodes).items():
            if times > 1:
                raise wrong(f"{quoted(id)} is given twice", "each id once", ".nodes")
        return self


class WindowFault(FaultSection):
    """A fault that ends."""

    at_s: Instant = Field(description="when it begins")
    until_s: LaterInstant = Field(description="when it ends")

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        return ordered(self, self.at_s, self.until_s)


class SensorFault(FaultSection):
    """A fault of a sensor, which may last to the end of the run."""

    at_s: Instant = Field(description="when it begins")
    until_s: LaterInstant | None = Field(default=None, description="when it ends; unset: never")

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        return ordered(self, self.at_s, self.until_s)


def ordered(fault: T, at_s: float, until_s: float | None, least_s: float = SHORT_S) -> T:
    """The fault; raises an error if it ends too early."""
    if until_s is not None and round(until_s - at_s, 9) < least_s:  # 2.82 is a second after 1.82, but not in binary
        raise wrong(f"is {until_s:g}", f"a time at least {least_s:g} s after at_s, which is {at_s:g}", ".until_s")
    return fault
