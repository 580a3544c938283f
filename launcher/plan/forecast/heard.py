"""Which sensors will report which target, and when, by the true paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from launcher.plan.forecast.heads.polled import Polled
from launcher.plan.forecast.masters.scheduled import Scheduled
from launcher.records import Plan
from trackfield.role import NS
from trackfield.world.path import Path

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_REPORTS: Final = 200_000
"""Of a run with more reports, only every n-th step is looked at."""


@dataclass(frozen=True)
class Heard:
    """Reports to come, one a row: of which target (its number), which sensor (its number), and when.

    A sensor reports the nearest target. The instants ``times`` were looked at, one in ``every`` of ``steps``. A report
    leaves ``after_ns`` (n,) after its instant, if sensors have slots. Some are ``own`` (n,) readings of a head, which
    needs no radio for them.
    """

    t_ns: NDArray[np.int64]
    target: Indices
    sensor: Indices
    times: tuple[int, ...]
    every: int
    steps: int
    after_ns: NDArray[np.int64] | None = None
    own: NDArray[np.bool_] | None = None

    @property
    def sent(self) -> NDArray[np.bool_]:
        """(n,) whether a report is sent."""
        return np.ones(len(self.t_ns), bool) if self.own is None else ~self.own

    @classmethod
    def of(cls, plan: Plan, ids: list[str], positions: Array) -> Heard:
        """Those of a plan, by the n sensors of these ``ids`` at ``positions`` (n, 2)."""
        if plan.by_themselves:
            return cls._of_passes(plan, ids, positions)
        reaches = np.array([plan.reaches[id] for id in ids])
        steps = range(plan.origin_ns + plan.step_ns, plan.run.end_ns, plan.step_ns)
        from scipy.spatial import cKDTree

        tree = cKDTree(positions)
        every = -(-_pairs(plan, tree, steps) // MOST_REPORTS) or 1
        times = tuple(steps[::every])
        rows = [_rows(tree, path, number, times, reaches, positions) for number, path in enumerate(plan.paths.values())]
        t_ns, target, sensor, far = (np.concatenate(column) for column in zip(*rows, strict=True))
        order = np.lexsort((far, sensor, t_ns))
        t_ns, target, sensor = t_ns[order], target[order], sensor[order]
        first = np.ones(len(t_ns), bool)
        first[1:] = (t_ns[1:] != t_ns[:-1]) | (sensor[1:] != sensor[:-1])
        return cls(t_ns[first], target[first], sensor[first], times, every, len(steps))

    @classmethod
    def of_turns(cls, field: Scheduled | Polled, ids: list[str]) -> Heard:
        """Those of sensors that are chosen, step by step."""
        plan, number = field.plan, {id: i for i, id in enumerate(ids)}
        rows = sorted(
            (turn.t_ns, number[id], target, turn.slots[id] * field.schedule.slot_ns, id == turn.leader)
            for turn, sensed in field.each
            for id, target in sensed.items()
        )
        t_ns, sensor, target, after_ns, own = np.array(rows, np.int64).reshape(-1, 5).T
        steps = range(plan.origin_ns + plan.step_ns, plan.run.end_ns, plan.step_ns)
        times = tuple(steps[:: field.every])
        return cls(t_ns, target, sensor, times, field.every, len(steps), after_ns, own.astype(bool))

    @classmethod
    def _of_passes(cls, plan: Plan, ids: list[str], positions: Array) -> Heard:
        """Those of sensors that report by themselves."""
        told = sorted(
            (plan.origin_ns + k * plan.step_ns, i, at_ns)
            for i, id in enumerate(ids)
            for k, at_ns in plan.passes[id].items()
        )
        times = tuple(sorted({t for t, _, _ in told}))
        paths = list(plan.paths.values())
        target = np.array([_nearest(paths, at_ns / NS, positions[i]) for _, i, at_ns in told], np.intp)
        t_ns, sensor = np.array([t for t, _, _ in told], np.int64), np.array([i for _, i, _ in told], np.intp)
        return cls(t_ns, target, sensor, times, 1, len(times))


def _nearest(paths: list[Path], t_s: float, position: Array) -> int:
    """The number of the target that is nearest to a position; 0 if nobody knows where targets are."""
    if not paths:
        return 0
    states = [path.at(t_s) for path in paths]
    return int(np.argmin([np.inf if state is None else np.hypot(*(state[:2] - position)) for state in states]))


def _pairs(plan: Plan, tree: cKDTree, steps: range) -> int:
    """About how many reports there will be."""
    some = steps[:: max(len(steps) // 500, 1)]
    points = [state[:2] for path in plan.paths.values() for t in some if (state := path.at(t / NS))]
    counts = tree.query_ball_point(points, plan.reach_m, return_length=True) if points else [0]
    return int(np.sum(counts)) * len(steps) // len(some)


def _rows(
    tree: cKDTree, path: Path, number: int, times: tuple[int, ...], reaches: Array, positions: Array
) -> tuple[NDArray[np.int64], Indices, Indices, Array]:
    """When, which target, which sensor, how far away (m), for all sensors in reach of one target."""
    there = [(t, state[:2]) for t in times if (state := path.at(t / NS)) is not None]
    points = np.reshape([point for _, point in there], (-1, 2))
    near: Any = tree.query_ball_point(points, float(reaches.max())) if len(points) else []
    counts = [len(found) for found in near]
    sensor = np.array([i for found in near for i in found], np.intp)
    far = np.hypot(*(np.repeat(points, counts, axis=0) - positions[sensor]).T)
    t_ns = np.repeat(np.array([t for t, _ in there], np.int64), counts)
    heard = far <= reaches[sensor]
    return t_ns[heard], np.full(int(heard.sum()), number), sensor[heard], far[heard]
