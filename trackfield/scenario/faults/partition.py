"""The fault ``partition``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import WindowFault


class Partition(WindowFault):
    """Some cannot be reached by all others."""

    kind: Literal["partition"] = Field(
        default="partition", description="no frame passes between these and all others; each side has its own"
    )
    medium: Literal["field", "backbone"] | None = Field(
        default=None, description="on which medium alone; unset: on every one"
    )
