"""All that a scenario file says: its sections, composed.

Units are part of the keys' names. A section that comes in several kinds (a link model, a layout, a kind of path) is
a union told apart by one of its keys. Descriptions become docs/scenarios.md, the schema for editors and the comments
of a written scenario.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.faults import Fault
from trackfield.scenario.layouts import Grid, Layout
from trackfield.scenario.links import Ideal, Link
from trackfield.scenario.paths import Target
from trackfield.scenario.section import Section, wrong
from trackfield.scenario.sections.clocks import Clocks
from trackfield.scenario.sections.energy import Energy
from trackfield.scenario.sections.fusion import Fusion
from trackfield.scenario.sensors import Acoustic, Sensor


class Contents(Section):
    """All that a scenario file says."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
        json_schema_extra={"expected": "letters, digits, and _ . - between them"},
        description="what runs of this scenario are called",
    )
    seed: int = Field(default=1, ge=0, description="of every random draw; another seed, another run")
    restart: Literal["never", "on-death"] = Field(
        default="never", description="what becomes of a process that dies unplanned: nothing, or it is started again"
    )
    field: Layout = Grid()
    sensor: Sensor = Acoustic()
    target: Target
    link: Link = Ideal()
    fusion: Fusion = Fusion()
    clock: Clocks = Clocks()
    energy: Energy = Energy()
    faults: tuple[Fault, ...] = ()

    @model_validator(mode="after")
    def _deadline_within_step(self) -> Self:
        if self.fusion.deadline_s > self.target.step_s:
            raise wrong(
                f"is {self.fusion.deadline_s:g}",
                f"at most target.step_s, which is {self.target.step_s:g}",
                "fusion.deadline_s",
            )
        return self
