"""The four lines from which ECPA chooses."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes import SOUND, trials
from trackfield.filters.passes.ecpa import candidates
from trackfield.filters.passes.geometry import state
from trackfield.filters.passes.solve import solve_ecpa
from trackfield.filters.passes.types import event_of
from trackfield.filters.types import Array


def turned(a: Array, b: Array) -> Array:
    """The angle (...,) between directions (..., 2), rad."""
    return np.asarray(np.abs(np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=-1))))


@pytest.mark.parametrize("time_sd", [0.0, 0.03])
def test_the_line_that_is_taken_is_one_of_them_unless_the_estimate_holds(time_sd: float) -> None:
    """By its velocity; that is the estimate's where angles are computed badly (figure 4). Without noise one is true."""
    made = trials(200, time_sd=time_sd, strength_sd=0.0 if not time_sd else 0.1)
    with np.errstate(all="ignore"):
        found = candidates(event_of(made.passes), SOUND)
        lines = state(found.lines)
    solved = solve_ecpa(made.passes, sound_m_s=SOUND)
    off = np.linalg.norm(lines[..., 2:] - solved.mean[:, None, 2:], axis=-1)
    taken = np.nanmin(np.where(np.isfinite(off), off, np.inf), axis=-1) < 1e-6
    assert taken.mean() > 0.6
    if not time_sd:
        away = turned(lines[..., 2:], made.truth[:, None, 2:])
        assert np.mean(np.nanmin(np.where(np.isfinite(away), away, np.inf), axis=-1) < 1e-3) > 0.99


def test_the_lone_sensor_is_across_the_true_line_from_three_far_ones_without_noise() -> None:
    made = trials(200, time_sd=0.0, strength_sd=0.0)
    with np.errstate(all="ignore"):
        found = candidates(event_of(made.passes), SOUND)
    numbers = np.concatenate((found.lone[:, None], found.far), axis=-1)
    e = made.truth[:, 2:] / np.linalg.norm(made.truth[:, 2:], axis=-1, keepdims=True)
    n = np.stack((e[:, 1], -e[:, 0]), axis=-1)
    aside = np.einsum("nki,ni->nk", made.true_places - made.truth[:, None, :2], n)
    sides = np.sign(np.take_along_axis(aside, numbers, axis=-1))
    known = np.isfinite(found.lines).all(axis=-1).any(axis=-1)
    assert known.mean() > 0.9
    assert (sides[known, 0] == -sides[known, 1]).mean() > 0.99
    assert (sides[known, 1:] == sides[known, 1:2]).all(axis=-1).mean() > 0.99
