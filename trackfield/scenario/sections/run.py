"""``[run]``: the run as a whole."""

from __future__ import annotations

from pydantic import Field

from trackfield.scenario.section import Section


class Run(Section):
    """The times of a run."""

    setup_s: float = Field(
        default=0.0, ge=0, le=1e6, description="emulated time before the first step, from which all other times count"
    )
