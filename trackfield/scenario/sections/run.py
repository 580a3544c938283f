"""``[run]``: the run as a whole."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from trackfield.scenario.quantities import MOST_NODES, Exact
from trackfield.scenario.section import Id, Section, wrong

IDLE_S: Final = 120.0
"""Long enough for a field to give up its track, and then to show what it spends without a target."""


class Run(Section):
    """The times of a run, and which of its processes come from outside."""

    setup_s: Annotated[float, Field(ge=0, le=1e6), Exact] | None = Field(
        default=None,
        description="emulated time before the first step, from which all other times count; unset: as the architecture "
        "needs",
    )
    idle_s: Annotated[float, Field(ge=0, le=1e6), Exact] | None = Field(
        default=None,
        description="emulated time that the run goes on for after the last step, without any target; unset: 0, and "
        f"{IDLE_S:g} in a study that varies architecture.kind",
    )
    external: Annotated[tuple[Id, ...], Field(min_length=1, max_length=MOST_NODES)] | None = Field(
        default=None,
        description="the processes that are started by others, by id, and for which a run over processes waits at the "
        "router of --connect or --listen; unset: none",
    )

    @model_validator(mode="after")
    def _waits_for_each_once(self) -> Self:
        for id, times in Counter(self.external).items():
            if times > 1:
                raise wrong(f"{id} is given twice", "each id once", ".external")
        return self
