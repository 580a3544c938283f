"""Kinds of sensing for tests: models of one kind, reports that are empty, arrays of microphones at a place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import degrees
from typing import Any

import numpy as np

from trackfield.filters.types import Array, Model, Readings, Reports, of_bearings
from trackfield.sensing.complete import Kind
from trackfield.sensing.doa import Doa as Arrays
from trackfield.sensing.kinds import SENSORS, register_sensor
from trackfield.sensing.readings import Said, Window
from trackfield.wire.messages import Doa
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene


@contextmanager
def registered(**kinds: Any) -> Iterator[None]:
    """These kinds of a user's own are known meanwhile; then those that were before."""
    before = dict(SENSORS.registered)
    for kind, maker in kinds.items():
        register_sensor(kind, maker)
    try:
        yield
    finally:
        SENSORS.registered.clear()
        SENSORS.registered.update(before)


def bearings_model(sigma_w: float, sigma_v: float = 0.1) -> Model:
    """A field of arrays whose bearings have the sd ``sigma_w`` (rad)."""
    return Model({"doa": Kind("doa", Arrays(doa_sd_deg=degrees(sigma_w)))}, sigma_v)


def hearing(level_db: float, bearing_deg: float) -> Said:
    """The reading of an array of microphones."""
    return Said(Doa, (bearing_deg, level_db), level_db)


def arrays(doa_sd_deg: float = 3.0) -> dict[str, dict[str, Any]]:
    """The argument ``sensing`` of a field of arrays."""
    return {"doa": {"kind": "doa", "options": {"doa_sd_deg": doa_sd_deg}}}


def model_of(sensor: Any, sigma_v: float = 0.1) -> Model:
    """A field of sensors of this class, whose kind is called ``own``."""
    return Model({"own": Kind("own", sensor)}, sigma_v)


def reports_of(positions: Array, values: Array, step: int = 1) -> Reports:
    """Readings (K, n) of sensors of the kind ``own`` at ``positions`` (K, 2)."""
    return Reports(step, tuple(f"n{i}" for i in range(len(positions))), positions, (Readings("own", values),))


def silence(step: int = 0) -> Reports:
    """No report at all, in a field of arrays."""
    return of_bearings(step, (), np.empty((0, 2)), np.empty(0), np.empty(0))


def with_bearings(reports: Reports, bearings: Array) -> Reports:
    """The same reports with these bearings (K,) instead of their own."""
    return of_bearings(reports.step, reports.sensors, reports.positions, bearings, reports.levels)


def array_at(
    position: tuple[float, float], paths: Sequence[Path], windows: Sequence[Window], **options: float
) -> Placed:
    """An array that hears 70 dB sources down to 51 dB, 79.4 m far, and reports from 52.5 dB on; seed 1, node n007."""
    options = {"doa_sd_deg": 0.0, "margin_db": 1.5, **options}
    kind = Kind("doa", Arrays(**options))  # type: ignore[arg-type]
    return Placed("n007", position, Scene(tuple(paths)), tuple(windows), kind, options, kind.threshold, seed=1)
