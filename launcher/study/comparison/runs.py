"""The runs of a comparison, read from their folders: figures, settings, and the paths of their targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from launcher.nested import flat
from launcher.plan.architectures import surveyed
from launcher.record.reading.files import check_run, read_figures, read_scenario, read_settings
from launcher.report.folder import course_of
from launcher.report.tracks import Course
from trackfield.errors import ScenarioError
from trackfield.role import NS

SAME_M: Final = 1e-6
"""Two runs have the same target if its positions differ by no more at any step, m."""


@dataclass(frozen=True)
class Compared:
    """Two or more finished runs; what has an entry for each run is in the order of ``folders``.

    ``names`` are the names of the folders, with as many of their parents as tell them apart.
    """

    folders: tuple[Path, ...]
    names: tuple[str, ...]
    metrics: tuple[Mapping[str, Any], ...]
    scenarios: tuple[Mapping[str, Any], ...]

    @cached_property
    def settings(self) -> dict[str, tuple[Any, ...]]:
        """The value in each run of every key of the scenarios that differs; None where a scenario has no such key."""
        scenarios = [flat(scenario) for scenario in self.scenarios]
        keys = dict.fromkeys(key for one in scenarios for key in one)
        values = {key: tuple(one.get(key) for one in scenarios) for key in keys}
        return {key: found for key, found in values.items() if any(value != found[0] for value in found)}

    @cached_property
    def trackers(self) -> tuple[str, ...]:
        """The trackers of all runs."""
        return tuple(dict.fromkeys(name for metrics in self.metrics for name in metrics["trackers"]))

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The places of runs whose targets were at the same points at the steps that they have in common."""
        found: list[list[int]] = []
        for place, truth in enumerate(self._truths):
            for group in found:
                if _same(self._truths[group[0]], truth):
                    group.append(place)
                    break
            else:
                found.append([place])
        return tuple(map(tuple, found))

    @property
    def same_target(self) -> bool:
        """Whether the targets of all runs take the same paths."""
        return len(self.groups) == 1

    @cached_property
    def lengths_s(self) -> tuple[float, ...]:
        """From the first step of each run to its last at which a target was there, s; who tracked it does not count."""
        return tuple((max(one.at_ns, default=one.origin_ns) - one.origin_ns) / NS for one in self._courses)

    @property
    def same_length(self) -> bool:
        """Whether sums over a run mean the same in all of them."""
        return len(set(self.lengths_s)) == 1

    @property
    def without_truth(self) -> list[str]:
        """The names of the runs of which nobody knows where the target was."""
        return [name for name, one in zip(self.names, self._courses, strict=True) if not one.paths]

    @cached_property
    def _courses(self) -> list[Course]:
        """From the scenarios: tracks.parquet lacks the steps of which nobody told, as those after a centre's death."""
        return [
            course_of(surveyed(read_scenario(folder)[1]), metrics)
            for folder, metrics in zip(self.folders, self.metrics, strict=True)
        ]

    @cached_property
    def _truths(self) -> list[dict[tuple[float, str], tuple[float, float]]]:
        """Of each run the place (m) of each target at each step, by (t in s, target)."""
        return list(map(_truth, self._courses))


def read_runs(folders: Sequence[Path], key: str = "RUN") -> Compared:
    """Read what every comparison needs; ``key`` is how the user knows the argument.

    Raises ``ScenarioError`` for fewer than two runs, for one that is named twice, for a folder that is not one, and for
    figures that are missing.
    """
    if len(folders) < 2:
        raise ScenarioError(f"{len(folders)} given", key=key, expected="two run folders or more")
    seen: dict[Path, Path] = {}
    for folder in folders:
        if other := seen.get(folder.resolve()):
            what = f"{folder} is named twice" if folder == other else f"{folder} is the same run as {other}"
            raise ScenarioError(what, key=key, expected="different runs")
        seen[folder.resolve()] = folder
    for folder in folders:
        check_run(folder)
    return Compared(
        tuple(folders),
        names(folders),
        tuple(read_figures(folder).plain() for folder in folders),
        tuple(map(read_settings, folders)),
    )


def names(folders: Sequence[Path]) -> tuple[str, ...]:
    """The last part of each path, or as many as it takes to tell them apart."""
    parts = [folder.resolve().parts for folder in folders]
    for count in range(1, max(map(len, parts)) + 1):
        found = tuple("/".join(one[-count:]) for one in parts)
        if len(set(found)) == len(found):
            return found
    return tuple(map(str, folders))


def _truth(course: Course) -> dict[tuple[float, str], tuple[float, float]]:
    return {
        (round((at_ns - course.origin_ns) / NS, 6), target): (state[0], state[1])
        for at_ns in course.at_ns
        for target, path in course.paths.items()
        if (state := path.at(at_ns / NS)) is not None
    }


def _same(a: Mapping[Any, tuple[float, float]], b: Mapping[Any, tuple[float, float]]) -> bool:
    common = a.keys() & b.keys()
    known = bool(common) or not (a or b)
    return known and all(abs(p - q) <= SAME_M for key in common for p, q in zip(a[key], b[key], strict=True))
