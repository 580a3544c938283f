"""The fault ``partition``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import WindowFault


class Partition(WindowFault):
    """Some processes cannot be reached by all others."""

    kind: Literal["partition"] = Field(
        default="partition", description="no frame passes between these processes and all others"
    )
    medium: Literal["field", "backbone", "serial"] | None = Field(
        default=None, description="the only medium affected; unset: every medium"
    )
