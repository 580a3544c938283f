"""Tracks smoothed with a fixed lag: exact where all is linear, better than live, and the same when replayed."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pyarrow.parquet as pq
import pytest

from fusion.role import Fusion
from launcher.plan.prepare import load, planned, remarks
from launcher.run import run_virtual
from tests import kalman
from tests.rrd import entities, read
from tests.sensing import bearings_model
from tests.simulated import simulated, spcpf
from tests.smoothing import rms_errors
from tests.test_fusion_late import last_words, run, told
from tests.test_fusion_restart import lived, place
from tests.test_fusion_role import DEADLINE, PRIOR, SENSORS, centre, deadline, play, points, report, started
from trackfield.errors import ScenarioError
from trackfield.filters.gaussian import constant_velocity
from trackfield.filters.single_model import Ekf
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Array, Gaussian
from trackfield.role import NS, Received, Started, TrackPoint
from trackfield.tracking.following import Following
from trackfield.tracking.smoothing import Smoothing, lagged_name
from trackfield.tracking.stored import unpack

NAME = "imm-ukf+lag2"


# --- the numbers --------------------------------------------------------------------------------------------------


def given_all(prior: Gaussian, z: Array, sd: float, sigma_v: float) -> tuple[Array, Array]:
    """Exactly: mean and covariance (T, 4), (T, 4, 4) of the states of steps 1 to T, given all positions ``z`` (T, 2).

    All states are one Gaussian, x = A (x_0, v_1, ..., v_T), of which the measurements are a part.
    """
    T = len(z)
    F, gain = np.array(constant_velocity(1.0, sigma_v).F), np.array([[0.5, 0], [0, 0.5], [1, 0], [0, 1]])
    A = np.zeros((T, 4, 4 + 2 * T))
    for t in range(T):
        A[t] = F @ (A[t - 1] if t else np.eye(4, 4 + 2 * T))
        A[t, :, 4 + 2 * t : 6 + 2 * t] += gain
    A = A.reshape(4 * T, -1)
    covariance = np.zeros((4 + 2 * T, 4 + 2 * T))
    covariance[:4, :4], covariance[4:, 4:] = prior.covariance, sigma_v**2 * np.eye(2 * T)
    mean, P = A[:, :4] @ prior.mean, A @ covariance @ A.T
    H = np.kron(np.eye(T), np.eye(2, 4))
    exact = kalman.update(Gaussian(mean, P), z.ravel(), H, sd**2 * np.eye(2 * T))
    blocks = exact.covariance.reshape(T, 4, T, 4)
    return exact.mean.reshape(T, 4), np.array([blocks[t, :, t] for t in range(T)])


@pytest.mark.parametrize("lag", [1, 4])
def test_in_the_linear_case_a_point_is_the_state_given_the_reports_so_far(lag: int) -> None:
    """An EKF and sensors so far away that bearings measure x and y."""
    rng, sd, prior = np.random.default_rng(lag), 2.0, Gaussian(np.zeros(4), np.diag([9.0, 16.0, 4.0, 1.0]))
    one = Smoothing(Following(Ekf(), bearings_model(sd / kalman.FAR, 0.5)), lag)
    state, z, found = one.begin(prior), rng.normal(0.0, 5.0, (7, 2)), []
    for step in range(1, 8):
        state, _, earlier = one.step(state, kalman.far_reports(z[step - 1]), 1.0, rng)
        assert (earlier is not None) == (step > lag)
        if earlier is not None:
            mean, covariance = (part[step - lag - 1] for part in given_all(prior, z[:step], sd, 0.5))
            assert earlier.estimate.mean == pytest.approx(mean, abs=1e-3)
            assert earlier.estimate.covariance == pytest.approx(covariance, abs=1e-3)
            found.append(earlier)
    assert len(found) == 7 - lag


@pytest.mark.parametrize(("scenario", "share"), [("s1", 0.7), ("s2", 0.75), ("s3", 0.75)])
def test_the_smoothed_error_is_clearly_below_the_live_one(scenario: str, share: float) -> None:
    live, smoothed = rms_errors(make_tracker("imm-ukf"), scenario, range(8), 3)
    assert smoothed < share * live


# --- the centre ---------------------------------------------------------------------------------------------------


def played(fusion: Fusion, steps: int, *, silent: range = range(0)) -> list[TrackPoint]:
    memory, found = started(fusion), list[TrackPoint]()
    for step in range(1, steps + 1):
        x, y = place(step)
        heard = [] if step in silent else [report(step, id, x=x, y=y) for id, _, _ in SENSORS]
        memory, effects = play(fusion, memory, [*heard, deadline(step)])
        found += points(effects)
    return found


def test_each_step_is_published_again_as_many_steps_later_as_the_lag() -> None:
    found = played(centre("imm-ukf", prior=PRIOR, smooth_lag=2), 6, silent=range(3, 4))
    assert [(point.tracker, point.step, point.lag) for point in found] == [
        ("imm-ukf", 1, 0), ("imm-ukf", 2, 0),
        ("imm-ukf", 3, 0), (NAME, 1, 2), ("imm-ukf", 4, 0), (NAME, 2, 2),
        ("imm-ukf", 5, 0), (NAME, 3, 2), ("imm-ukf", 6, 0), (NAME, 4, 2),
    ]  # fmt: skip
    smoothed = [point for point in found if point.lag]
    assert [(point.status, point.reports) for point in smoothed] == [
        ("tracking", 4), ("tracking", 4), ("coasting", 0), ("tracking", 4),
    ]  # fmt: skip
    live = {point.step: point for point in found if not point.lag}
    assert all(point.covariance[0] < live[point.step].covariance[0] for point in smoothed)


def test_live_tracks_are_none_the_different_and_only_they_are_stored() -> None:
    trackers = ("imm-ukf", "spcpf", "bootstrap")
    with_lag = centre(*trackers, prior=PRIOR, smooth_lag=2)
    found = played(with_lag, 5)
    assert [point for point in found if not point.lag] == played(centre(*trackers, prior=PRIOR), 5)
    assert {point.tracker for point in found} == {*trackers, NAME, lagged_name("bootstrap", 2)}  # spcpf cannot be
    assert set(unpack(lived(with_lag, 3)).beliefs) == set(trackers)


def test_a_late_report_is_in_every_smoothed_point_that_it_belongs_to() -> None:
    """The last word on each step is what it would have been, had all been on time."""
    fusion = centre("imm-ukf", "spcpf", prior=PRIOR, max_age_ns=3 * NS, smooth_lag=2)
    on_time = [told(step, id) for step in range(1, 11) for id, _, _ in SENSORS]
    late = [told(4, id, 2 * NS + 1) if (step, id) == (4, "n1") else told(step, id) for step in range(1, 11)
            for id, _, _ in SENSORS]  # fmt: skip
    deadlines = [deadline(step) for step in range(1, 13)]
    _, before = run(fusion, [*on_time, *deadlines])
    _, after = run(fusion, [*late, *deadlines])
    assert last_words(after) == last_words(before)
    again = [point.step for point in points(after) if point.tracker == NAME]
    assert [step for step in range(1, 11) if again.count(step) == 2] == [
        2,
        3,
    ]  # told by steps 4 and 5


def test_a_step_handled_twice_gives_the_same() -> None:
    """States are values: going back to one, as drivers do, finds it as it was."""
    fusion = centre("imm-ukf", prior=PRIOR, smooth_lag=2)
    memory = started(fusion)
    for step in range(1, 5):
        memory, _ = play(fusion, memory, [*(report(step, id) for id, _, _ in SENSORS), deadline(step)])
    assert fusion.handle(memory, deadline(5))[1] == fusion.handle(memory, deadline(5))[1]


def test_a_centre_that_comes_back_smooths_what_it_saw_itself() -> None:
    fusion = centre("imm-ukf", prior=PRIOR, smooth_lag=2)
    kept, found = lived(fusion, 5), list[TrackPoint]()
    memory, effects = fusion.handle(fusion.begin(), Started(6 * NS + DEADLINE + 1, kept))
    found += points(effects)
    for step in range(7, 11):
        x, y = place(step)
        memory, effects = play(fusion, memory, [*(report(step, id, x=x, y=y) for id, _, _ in SENSORS), deadline(step)])
        found += points(effects)
    assert [point.step for point in found if not point.lag] == [6, 7, 8, 9, 10]
    assert [point.step for point in found if point.lag] == [6, 7, 8]


def test_a_track_that_starts_anew_knows_nothing_of_the_one_before() -> None:
    """The target is suddenly elsewhere: the steps since count, and none is smoothed over the jump."""
    fusion = centre("imm-ukf", smooth_lag=2)
    memory, found = started(fusion), list[TrackPoint]()
    for step in range(1, 16):
        x, y = (20.0, 20.0) if step < 8 else (90.0, 60.0)
        events: list[Received] = [report(step, id, x=x, y=y) for id, _, _ in SENSORS]
        memory, effects = play(fusion, memory, [*events, deadline(step)])
        found += points(effects)
    for point in found:
        if point.lag and point.step not in (6, 7, 8, 9):
            x, y = (20.0, 20.0) if point.step < 8 else (90.0, 60.0)
            assert np.hypot(point.mean[0] - x, point.mean[1] - y) < 5.0
    assert found[-1].step == 13


# --- the run ------------------------------------------------------------------------------------------------------


def test_a_smoothed_track_is_one_of_the_runs_tracks(tmp_path: FilePath) -> None:
    (tmp_path / "logs").mkdir()
    plan = spcpf(1, ["target.steps=12", "fusion.smooth_lag=2"])
    metrics = run_virtual(plan, tmp_path).metrics
    assert list(metrics["trackers"]) == ["imm-ukf", "spcpf", NAME]
    assert metrics["trackers"]["imm-ukf"]["steps"] == 12
    assert (metrics["trackers"][NAME]["steps"], metrics["trackers"][NAME]["lost"]) == (10, False)
    assert metrics["trackers"][NAME]["rmse"]["position"] < metrics["trackers"]["imm-ukf"]["rmse"]["position"]
    assert metrics["latency_ms"]["to_track"]["max"] == 300.0  # of live tracks
    rows = pq.read_table(tmp_path / "tracks.parquet").to_pylist()
    smoothed = [row for row in rows if row["tracker"] == NAME]
    assert [row["told_s"] - row["t_s"] for row in smoothed] == pytest.approx([2.3] * len(smoothed))
    assert {row["bound_m"] for row in smoothed} == {None}
    assert any(row["bound_m"] for row in rows)
    drawn = {path for path in entities(tmp_path / "run.rrd") if NAME.replace("+", "\\+") in path}
    assert {path.rpartition("/")[2] for path in drawn if path.startswith("/field/")} >= {"track"}
    line = next(path for path in drawn if path.startswith("/plots/error/"))
    assert len([t for t, _ in read(tmp_path / "run.rrd", line, "Scalars:scalars") if t is not None]) == 10


def test_without_a_lag_there_is_nothing_more() -> None:
    plan = spcpf(1, ["target.steps=5"])
    _, tracks = simulated(plan)
    assert {row.point.tracker for row in tracks} == set(plan.info.trackers) == {"imm-ukf", "spcpf"}


def test_who_cannot_be_smoothed_is_named() -> None:
    settings = ["fusion.smooth_lag=3"]
    assert [remark for remark in remarks(spcpf(1, settings)) if "smoothed" in remark] == [
        "spcpf does not report its motion model, so its track is not smoothed"
    ]
    plan = planned(load("spcpf", settings=settings, trackers=["spcpf"]))
    assert plan.info.trackers == ("spcpf",)


@pytest.mark.parametrize("lag", ["-1", "101", "2.5"])
def test_a_lag_is_a_whole_number_of_steps(lag: str) -> None:
    with pytest.raises(ScenarioError, match=r"fusion\.smooth_lag.*a whole number from 0 to 100"):
        load("spcpf", settings=[f"fusion.smooth_lag={lag}"])
