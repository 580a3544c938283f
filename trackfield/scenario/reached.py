"""Whether any target comes near enough to a sensor, and whether what it senses arrives in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isinf

import numpy as np

from trackfield.errors import ScenarioError
from trackfield.scenario.places import Place
from trackfield.scenario.sensors import SensorSection
from trackfield.world.path import Path
from trackfield.world.windows import distances


def check(
    sections: Mapping[str, SensorSection],
    kinds: Mapping[str, frozenset[int]],
    sensors: Sequence[Place],
    paths: Sequence[Path],
) -> None:
    """Raise ``ScenarioError`` unless some target comes near enough to some sensor for a report."""
    positions = np.array([place[1:] for place in sensors])
    for name, section in sections.items():
        near = positions[sorted(kinds[name])], section.sensing.report_m
        if any(np.isfinite(distances(near[0], path, near[1])).any() for path in paths):
            return
    far = np.min([distances(positions, path, np.inf) for path in paths], axis=0)
    nearest = f"{far.min():.0f} m from {sensors[int(far.argmin())][0]}, the nearest"
    what = "the target never comes in range: it stays" if len(paths) == 1 else "no target comes in range: they stay"
    radius = max(section.sensing.report_m for section in sections.values())
    expected = f"a path within the {radius:.0f} m in which a sensor hears a target"
    key = f"sensor.{next(iter(sections.values())).reach_key}" if len(sections) == 1 else "sensors"
    raise ScenarioError(f"{what} {nearest}", key=key, expected=expected)


def check_speeds(sections: Mapping[str, SensorSection], paths: Mapping[str, Path]) -> None:
    """Raise ``ScenarioError`` if what a sensor senses is as slow as a target: it would not arrive in order."""
    slowest = min(sections, key=lambda name: sections[name].sensing.speed_m_s)
    speed_m_s = sections[slowest].sensing.speed_m_s
    if isinf(speed_m_s):
        return
    fastest_m_s, target = max((path.fastest_m_s, id) for id, path in paths.items())
    if speed_m_s <= fastest_m_s:
        key = f"sensor.{sections[slowest].speed_key}"
        what = f"'{slowest}' has {speed_m_s:g} m/s, and {target} moves at {fastest_m_s:.3g} m/s"
        raise ScenarioError(what, key=key, expected="more than the speed of any target")
