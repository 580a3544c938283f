"""All that a scenario file says: its sections, composed.

Units are part of the keys' names. A section that comes in several kinds (a link model, a layout, a kind of path) is
a union told apart by one of its keys. Descriptions become docs/scenarios.md, the schema for editors and the comments
of a written scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from trackfield.scenario.architectures import Architecture, Centralised
from trackfield.scenario.faults import Fault
from trackfield.scenario.layouts import Grid, Layout
from trackfield.scenario.links import Ideal, Link
from trackfield.scenario.paths import PathSection, Target
from trackfield.scenario.section import ID_WORDS, Section, wrong
from trackfield.scenario.sections.clocks import Clocks
from trackfield.scenario.sections.energy import Energy
from trackfield.scenario.sections.fusion import Fusion
from trackfield.scenario.sections.run import Run
from trackfield.scenario.sections.score import Score
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
    target: Target | None = None
    targets: tuple[Target, ...] = Field(default=(), validate_default=True)
    link: Link = Ideal()
    architecture: Architecture = Centralised()
    fusion: Fusion = Fusion()
    clock: Clocks = Clocks()
    energy: Energy = Energy()
    run: Run = Run()
    score: Score = Score()
    faults: tuple[Fault, ...] = ()

    @field_validator("targets")
    @classmethod
    def _go_together(cls, targets: tuple[PathSection, ...], info: ValidationInfo) -> tuple[PathSection, ...]:
        """One target at least, each with an id of its own, all with the steps of the first."""
        if "target" not in info.data:  # what is wrong with it is told already
            return targets
        every = _keyed(info.data["target"], targets)
        if not every:
            raise wrong("missing", "a section [target], or sections [[targets]]", "target")
        (first_key, first), seen = every[0], set[str]()
        for key, one in every:
            if key != "target" and "id" not in one.model_fields_set:
                raise wrong("missing", ID_WORDS, f"{key}.id")
            if one.id in seen:
                raise wrong(f"{one.id!r} is there twice", "another id for each target", f"{key}.id")
            seen.add(one.id)
            for name in ("step_s", "steps"):
                own, right = getattr(one, name), getattr(first, name)
                if name in one.model_fields_set and own != right:
                    what = f"is {own:g}, and {first_key}.{name} is {'unset' if right is None else format(right, 'g')}"
                    raise wrong(what, "the same as of the first target, or left out", f"{key}.{name}")
        return targets

    @model_validator(mode="after")
    def _deadline_within_step(self) -> Self:
        if self.fusion.deadline_s > self.step_s:
            raise wrong(
                f"is {self.fusion.deadline_s:g}",
                f"at most {self.keyed_targets[0][0]}.step_s, which is {self.step_s:g}",
                "fusion.deadline_s",
            )
        return self

    @property
    def keyed_targets(self) -> tuple[tuple[str, PathSection], ...]:
        """The targets in their order, each with its key: ``target``, ``targets[0]``, ..."""
        return _keyed(self.target, self.targets)

    @property
    def every_target(self) -> tuple[PathSection, ...]:
        """The targets in their order; that of ``[target]`` is the first."""
        return tuple(target for _, target in self.keyed_targets)

    @property
    def step_s(self) -> float:
        """How long a step takes (s)."""
        return self.every_target[0].step_s

    @property
    def steps(self) -> int | None:
        """How many steps the run has; None: as many as its longest path."""
        return self.every_target[0].steps

    @property
    def lost_beyond_m(self) -> float:
        """In a step in which a track is further off than that (m), it counts as lost."""
        beyond_m = self.score.lost.beyond_m
        return self.fusion.lost_m if beyond_m is None else beyond_m


def _keyed(target: PathSection | None, targets: Sequence[PathSection]) -> tuple[tuple[str, PathSection], ...]:
    alone = () if target is None else (("target", target),)
    return (*alone, *((f"targets[{i}]", one) for i, one in enumerate(targets)))
