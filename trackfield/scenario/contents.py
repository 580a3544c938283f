"""The contents of a scenario file: its sections, composed.

Units are part of the keys' names. A section that comes in several kinds (a link model, a layout, a kind of path) is
a union told apart by one of its keys. Descriptions become docs/scenarios.md, the schema for editors and the comments
of a written scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from trackfield.scenario.architectures import Architecture, Centralised
from trackfield.scenario.faults import Fault
from trackfield.scenario.layouts import Grid, Layout
from trackfield.scenario.links import Ideal, Link, Serial
from trackfield.scenario.paths import PathSection, Recorded, Target
from trackfield.scenario.quantities import Seed
from trackfield.scenario.radios import EXPECTED, Radios
from trackfield.scenario.section import ID_WORDS, Section, wrong
from trackfield.scenario.sections.camera import Camera, NoCamera
from trackfield.scenario.sections.clocks import Clocks
from trackfield.scenario.sections.energy import Energy
from trackfield.scenario.sections.fusion import Fusion
from trackfield.scenario.sections.run import Run
from trackfield.scenario.sections.score import Score
from trackfield.scenario.sensors import OF_GROUPS, DoaSensor, Sensor, SensorSection

MOST_TARGETS: Final = 1000
MOST_FAULTS: Final = 10_000
MOST_KINDS: Final = 20
"""Groups of sensors of one kind each."""


class Contents(Section):
    """The contents of a scenario file."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,99}$",
        json_schema_extra={"expected": "up to 100 letters, digits, and _ . - between them"},
        description="the scenario's name; its run folders begin with it",
    )
    seed: Seed = Field(default=1, description="seed of every random draw; another gives another run")
    restart: Literal["never", "on-death"] = Field(
        default="never", description="whether a process that dies unplanned is started again"
    )
    radio: Radios = Field(
        default=(),
        json_schema_extra={"expected": EXPECTED},
        description="transmission power (tx_dbm) and power figures (device) of the radios of a role or of one process, "
        "where they differ from the others'",
    )
    field: Layout = Grid()
    sensor: Sensor = DoaSensor()
    sensors: tuple[Sensor, ...] = Field(default=(), max_length=MOST_KINDS, validate_default=True)
    target: Target | None = None
    targets: tuple[Target, ...] = Field(default=(), max_length=MOST_TARGETS, validate_default=True)
    link: Link = Ideal()
    backbone: Link | None = None
    serial: Serial | None = None
    architecture: Architecture = Centralised()
    camera: Camera = NoCamera()
    fusion: Fusion = Fusion()
    clock: Clocks = Clocks()
    energy: Energy = Energy()
    run: Run = Run()
    score: Score = Score()
    faults: tuple[Fault, ...] = Field(default=(), max_length=MOST_FAULTS)

    @field_validator("sensors")
    @classmethod
    def _some_of_each(cls, sensors: tuple[SensorSection, ...], info: ValidationInfo) -> tuple[SensorSection, ...]:
        """Each group says which sensors are of its kind; the others are as ``[sensor]`` says."""
        alone = info.data.get("sensor")
        for name in OF_GROUPS:
            if getattr(alone, name, None) is not None:
                raise wrong("is for some of the sensors, in [[sensors]]", "[sensor] for the others", f"sensor.{name}")
        for i, one in enumerate(sensors):
            if one.nodes is not None and one.share is not None:
                raise wrong("is given together with nodes", "one of the two", f"sensors[{i}].share")
            if one.nodes is None and one.share is None:
                raise wrong("says not which sensors it is about", "nodes (ids) or share (from 0 to 1)", f"sensors[{i}]")
        return sensors

    @field_validator("targets")
    @classmethod
    def _go_together(cls, targets: tuple[PathSection, ...], info: ValidationInfo) -> tuple[PathSection, ...]:
        """At least one target, each with its own id, all with the steps of the first."""
        if "target" not in info.data:  # its own error is reported already
            return targets
        every = _keyed(info.data["target"], targets, _plays(info.data))
        if not every:
            raise wrong("missing", "a section [target], or sections [[targets]]", "target")
        (first_key, first), seen = every[0], set[str]()
        for key, one in every:
            if key != "target" and "id" not in one.model_fields_set:
                raise wrong("missing", ID_WORDS, f"{key}.id")
            if one.id in seen:
                raise wrong(f"{one.id!r} is given twice", "a different id for each target", f"{key}.id")
            seen.add(one.id)
            for name in ("step_s", "steps"):
                own, right = getattr(one, name), getattr(first, name)
                if name in one.model_fields_set and own != right:
                    what = f"is {own:g}, and {first_key}.{name} is {'unset' if right is None else format(right, 'g')}"
                    raise wrong(what, "the same as for the first target, or left out", f"{key}.{name}")
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
    def keyed_sensors(self) -> tuple[tuple[str, SensorSection], ...]:
        """The kinds of sensors in order, each with its key: ``sensor``, ``sensors[0]``, ..."""
        return (("sensor", self.sensor), *((f"sensors[{i}]", one) for i, one in enumerate(self.sensors)))

    @property
    def keyed_targets(self) -> tuple[tuple[str, PathSection], ...]:
        """The targets in order, each with its key: ``target``, ``targets[0]``, ..."""
        return _keyed(self.target, self.targets, any(section.recording for _, section in self.keyed_sensors))

    @property
    def every_target(self) -> tuple[PathSection, ...]:
        """The targets in order, that of ``[target]`` first."""
        return tuple(target for _, target in self.keyed_targets)

    @property
    def step_s(self) -> float:
        """Length of a step (s)."""
        return self.every_target[0].step_s

    @property
    def steps(self) -> int | None:
        """Number of steps of the run; None: until its longest path ends."""
        return self.every_target[0].steps

    @property
    def lost_beyond_m(self) -> float:
        """Position error (m) above which a track counts as lost in a step."""
        beyond_m = self.score.lost.beyond_m
        return self.fusion.lost_m if beyond_m is None else beyond_m


def _plays(data: Mapping[str, Any]) -> bool:
    """Whether sensors play a recording, by the sections that are valid."""
    sections: list[SensorSection | None] = [data.get("sensor"), *data.get("sensors", ())]
    return any(section.recording for section in sections if section)


def _keyed(
    target: PathSection | None, targets: Sequence[PathSection], plays: bool
) -> tuple[tuple[str, PathSection], ...]:
    """Each target with its key; that of a recording, where none is given and sensors play one."""
    if target is None and not targets and plays:
        target = Recorded()
    alone = () if target is None else (("target", target),)
    return (*alone, *((f"targets[{i}]", one) for i, one in enumerate(targets)))
