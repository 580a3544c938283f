"""Trackfield emulates field deployments that track moving targets with networks of small sensors.

The names of the Python API are imported on first use, so that a node's process stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from launcher.api import Comparison, Result, compare, open, replay, run, study
    from launcher.plan.architectures import Arranged, Field, Hosted, Process, register_architecture
    from launcher.study.studies import Study
    from trackfield.drivers.ports import Port
    from trackfield.errors import RunFailed, ScenarioError, TrackfieldError
    from trackfield.filters.trackers import register_tracker
    from trackfield.filters.types import Estimate, Gaussian, Model, Reports
    from trackfield.models.noise import Colour
    from trackfield.models.unknowns import Unknown
    from trackfield.scenario import Scenario
    from trackfield.sensing.kinds import register_sensor

__version__: str
_HOMES: Final = {
    "Arranged": "launcher.plan.architectures",
    "Colour": "trackfield.models.noise",
    "Comparison": "launcher.api",
    "Estimate": "trackfield.filters.types",
    "Field": "launcher.plan.architectures",
    "Gaussian": "trackfield.filters.types",
    "Hosted": "launcher.plan.architectures",
    "Model": "trackfield.filters.types",
    "Port": "trackfield.drivers.ports",
    "Process": "launcher.plan.architectures",
    "Reports": "trackfield.filters.types",
    "Result": "launcher.api",
    "RunFailed": "trackfield.errors",
    "Scenario": "trackfield.scenario",
    "ScenarioError": "trackfield.errors",
    "Study": "launcher.study.studies",
    "TrackfieldError": "trackfield.errors",
    "Unknown": "trackfield.models.unknowns",
    "compare": "launcher.api",
    "open": "launcher.api",
    "register_architecture": "launcher.plan.architectures",
    "register_sensor": "trackfield.sensing.kinds",
    "register_tracker": "trackfield.filters.trackers",
    "replay": "launcher.api",
    "run": "launcher.api",
    "study": "launcher.api",
}

__all__ = [
    "Arranged",
    "Colour",
    "Comparison",
    "Estimate",
    "Field",
    "Gaussian",
    "Hosted",
    "Model",
    "Port",
    "Process",
    "Reports",
    "Result",
    "RunFailed",
    "Scenario",
    "ScenarioError",
    "Study",
    "TrackfieldError",
    "Unknown",
    "compare",
    "open",
    "register_architecture",
    "register_sensor",
    "register_tracker",
    "replay",
    "run",
    "study",
]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("trackfield")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'trackfield' has no attribute {name!r}")
