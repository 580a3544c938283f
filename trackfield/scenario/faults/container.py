"""The faults of containers: ``container-kill``, ``-restart``, ``-pause`` and ``-disconnect``.

They befall the container in which a process runs, by the engine that runs it, and not the process in emulated time.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.faults.fault import FaultSection, WindowFault, ordered
from trackfield.scenario.faults.restart import MIN_DOWN_S
from trackfield.scenario.quantities import LaterInstant


class ContainerFault(FaultSection):
    """A fault of the container of a process."""


class ContainerKill(ContainerFault):
    """A container is killed, for good."""

    kind: Literal["container-kill"] = Field(
        default="container-kill", description="the container of a process is killed for good"
    )
    at_s: LaterInstant = Field(description="when it happens")


class ContainerRestart(ContainerFault):
    """A container is killed, and started again."""

    kind: Literal["container-restart"] = Field(
        default="container-restart", description="the container of a process is killed and started again later"
    )
    at_s: LaterInstant = Field(description="when it happens")
    until_s: LaterInstant = Field(
        json_schema_extra={"expected": "a number, at least 1 s after at_s"}, description="when it is started again"
    )

    @model_validator(mode="after")
    def _is_down_for_a_while(self) -> Self:
        return ordered(self, self.at_s, self.until_s, MIN_DOWN_S)


class ContainerPause(WindowFault, ContainerFault):
    """A container stands still for a while."""

    kind: Literal["container-pause"] = Field(
        default="container-pause", description="the container of a process stands still, then goes on"
    )


class ContainerDisconnect(WindowFault, ContainerFault):
    """A container is cut off from a network for a while."""

    kind: Literal["container-disconnect"] = Field(
        default="container-disconnect", description="the container of a process is cut off from its network, then back"
    )
    network: Literal["field", "backbone"] | None = Field(
        default=None, description="the only network that it is cut off from; unset: every network that it has"
    )
