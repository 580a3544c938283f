"""``[run]``: the run as a whole."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from trackfield.scenario.quantities import Exact
from trackfield.scenario.section import Section


class Run(Section):
    """The times of a run."""

    setup_s: Annotated[float, Field(ge=0, le=1e6), Exact] | None = Field(
        default=None,
        description="emulated time before the first step, from which all other times count; unset: as the architecture "
        "needs",
    )
