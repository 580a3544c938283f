"""``[[faults]]``: planned faults of processes and sensors. A kind of fault is a class here and a line in the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trackfield.scenario.faults.babble import Babble
from trackfield.scenario.faults.bias import Bias
from trackfield.scenario.faults.clock_jump import ClockJump
from trackfield.scenario.faults.container import (
    ContainerDisconnect,
    ContainerFault,
    ContainerKill,
    ContainerPause,
    ContainerRestart,
)
from trackfield.scenario.faults.deaf import Deaf
from trackfield.scenario.faults.fault import FaultSection, SensorFault
from trackfield.scenario.faults.freeze import Freeze
from trackfield.scenario.faults.kill import Kill
from trackfield.scenario.faults.partition import Partition
from trackfield.scenario.faults.restart import Restart
from trackfield.scenario.faults.stuck import Stuck
from trackfield.scenario.section import one_of

__all__ = [
    "FAULTS",
    "Babble",
    "Bias",
    "ClockJump",
    "ContainerDisconnect",
    "ContainerFault",
    "ContainerKill",
    "ContainerPause",
    "ContainerRestart",
    "Deaf",
    "Fault",
    "FaultSection",
    "Freeze",
    "Kill",
    "Partition",
    "Restart",
    "SensorFault",
    "Stuck",
]

FAULTS: Final[tuple[type[FaultSection], ...]] = (
    Kill,
    Freeze,
    Partition,
    Restart,
    Stuck,
    Bias,
    Deaf,
    Babble,
    ClockJump,
    ContainerKill,
    ContainerRestart,
    ContainerPause,
    ContainerDisconnect,
)

if TYPE_CHECKING:
    Fault = FaultSection
else:
    Fault = one_of(FAULTS, "kind")
