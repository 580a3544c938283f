"""The fault ``freeze``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from trackfield.scenario.faults.fault import WindowFault


class Freeze(WindowFault):
    """A process does nothing for a while."""

    kind: Literal["freeze"] = Field(default="freeze", description="a process does nothing for a while, then goes on")
