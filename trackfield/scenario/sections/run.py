"""``[run]``: the run as a whole."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from trackfield.scenario.quantities import Exact
from trackfield.scenario.section import Section

IDLE_S: Final = 120.0
"""Long enough for a field to give up its track, and then to show what it spends without a target."""


class Run(Section):
    """The times of a run."""

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
