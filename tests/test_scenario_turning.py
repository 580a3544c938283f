"""What else a ``drifting`` target may do: hold its acceleration for a step, begin anywhere, turn.

Each comparison of drawn numbers fails for correct code in one of ten thousand seeds at most; they draw by key.
"""

from __future__ import annotations

import json
from dataclasses import replace
from math import atan2, degrees, hypot, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from launcher.reproduce.papers.yu import truth as yu
from launcher.reproduce.papers.zhou import setups as zhou
from trackfield.errors import ScenarioError
from trackfield.models.motion import noise_gain, transition
from trackfield.scenario import Scenario, survey
from trackfield.scenario.survey import target_paths
from trackfield.world.drift import ARC_DEG, Drift

ANYWHERE = 1e7
HELD = Drift(q=0.01, speed_m_s=2.0, heading_deg=90.0, half_width_m=ANYWHERE, held=True)
TURNING = Drift(0.01, hypot(5, 5), 45.0, ANYWHERE, (550.0, 100.0), turns=yu.TURNS)
"""As the target of Yu et al."""
STILL = replace(TURNING, q=0.0)


def states(path: Any) -> np.ndarray:
    """(T + 1, 4), with x, y, vx, vy at the knots."""
    return np.array([path.x, path.y, path.vx, path.vy]).T


def at(path: Any, *times: float) -> np.ndarray:
    return np.array([path.at(t) for t in times])


def scenario(**target: Any) -> Scenario:
    sensor = {"kind": "range", "range_m": 30_000.0}
    return Scenario.load({"name": "mine", "target": {"path": "drifting", **target}, "sensor": sensor})


# --- an acceleration that is held -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("q", "step_s"), [(0.01, 1.0), (0.01, 0.1), (144.0, 2.0)])
def test_each_step_has_one_acceleration_on_each_axis(q: float, step_s: float) -> None:
    steps = 3000
    path = states(replace(HELD, q=q).path(3, steps, step_s))
    added = path[1:] - path[:-1] @ np.array(transition(step_s)).T
    gain = np.array(noise_gain(step_s))
    drawn = added[:, 2:] / step_s
    assert added == pytest.approx(drawn @ gain.T, abs=1e-5 * sqrt(q))
    for one in drawn.T / sqrt(q / step_s):
        assert stats.kstest(one, "norm").pvalue > 1e-4
        assert stats.pearsonr(one[1:], one[:-1]).pvalue > 1e-4
    assert stats.pearsonr(*drawn.T).pvalue > 1e-4


def test_in_between_it_is_where_the_acceleration_brings_it() -> None:
    path = HELD.path(1, 4, 2.0)
    for k, (before, after) in enumerate(zip(states(path)[:-1], states(path)[1:], strict=True)):
        a = (after - before)[2:] / 2.0
        expected = [*(before[:2] + 0.6 * before[2:] + 0.18 * a), *(before[2:] + 0.6 * a)]
        assert path.at(2.0 * k + 0.6) == pytest.approx(expected)


@pytest.mark.parametrize("setup", [zhou.WALK, zhou.SHARP, zhou.PAPERLIKE], ids=["walk", "sharp", "paperlike"])
def test_it_moves_as_the_targets_of_zhou_do_in_batches(setup: zhou.Setup) -> None:
    x, y, vx, vy = zhou.X0
    own = Drift(setup.q**2, hypot(vx, vy), degrees(atan2(vx, vy)), ANYWHERE, (x, y), held=True, start_sd=setup.prior_sd)
    batch = zhou.paths(setup, range(400))
    found = np.stack([states(own.path(seed, setup.steps, zhou.DT)) for seed in range(400)])
    assert found.shape == batch.shape
    for k in (0, 1, setup.steps):
        for axis in range(4):
            assert stats.ks_2samp(found[:, k, axis], batch[:, k, axis]).pvalue > 1e-4, (k, axis)


# --- the start --------------------------------------------------------------------------------------------------------


def test_a_start_that_is_drawn_has_the_mean_and_the_sds_that_it_is_told() -> None:
    sds = (3.0, 0.5, 0.2, 0.0)
    one = replace(HELD, heading_deg=0.0, start=(10.0, -5.0), start_sd=sds)
    starts = np.stack([states(one.path(seed, 1, 1.0))[0] for seed in range(1000)])
    off = starts - (10.0, -5.0, 0.0, 2.0)
    assert (off[:, 3] == 0.0).all()
    for column, sd in zip(off.T[:3], sds, strict=False):
        assert stats.kstest(column / sd, "norm").pvalue > 1e-4
    assert all(stats.pearsonr(off[:, i], off[:, j]).pvalue > 1e-4 for i, j in ((0, 1), (0, 2), (1, 2)))


def test_without_a_spread_it_starts_where_it_did_and_moves_the_same() -> None:
    spread = replace(HELD, start_sd=(3.0, 0.0, 0.0, 0.0))
    one, other = (states(drift.path(2, 20, 1.0)) for drift in (HELD, spread))
    assert one[0].tolist()[:2] == [0.0, 0.0]
    assert other - one == pytest.approx(np.tile([other[0, 0], 0.0, 0.0, 0.0], (21, 1)), abs=1e-9)
    assert other[0, 0] != 0.0


def test_one_that_would_start_outside_of_its_square_is_drawn_again() -> None:
    narrow = replace(HELD, q=0.0, speed_m_s=0.0, half_width_m=1.0, start_sd=(2.0, 2.0, 0.0, 0.0))
    starts = np.stack([states(narrow.path(seed, 3, 1.0))[0] for seed in range(100)])
    assert np.abs(starts[:, :2]).max() <= 1.0
    assert len(np.unique(starts[:, 0])) == 100


# --- turns ------------------------------------------------------------------------------------------------------------


def test_without_noise_it_turns_as_the_target_of_yu_does() -> None:
    expected = yu.paths(np.zeros((1, yu.STEPS, 2, 2)))[0]
    assert states(STILL.path(1, yu.STEPS, yu.T)) == pytest.approx(expected, abs=1e-9)


def test_with_noise_it_moves_as_the_targets_of_yu_do_in_batches() -> None:
    rng = np.random.default_rng(1)
    batch = yu.paths(rng.standard_normal((400, yu.STEPS, 2, 2)))
    own = np.stack([states(TURNING.path(seed, yu.STEPS, yu.T)) for seed in range(400)])
    assert own.shape == batch.shape
    for k in (31, 32, 69, 100):
        for axis in range(4):
            assert stats.ks_2samp(own[:, k, axis], batch[:, k, axis]).pvalue > 1e-4, (k, axis)


def test_a_turn_to_the_left_is_one_against_the_clock() -> None:
    left = replace(STILL, heading_deg=0.0, turns=((0.0, 2.0, 45.0),)).path(1, 2, 1.0)
    vx, vy = left.at(2.0)[2:]
    assert (vx, vy) == pytest.approx((-hypot(5, 5), 0.0), abs=1e-9)  # from north to west


@pytest.mark.parametrize("step_s", [0.1, 0.7, 1.0, 3.0, 20.0])
def test_a_turn_is_the_same_whatever_the_steps(step_s: float) -> None:
    """It begins and ends within steps, and turns by more than a whole circle in one of them."""
    turns = ((1.3, 4.55, 30.0), (4.55, 7.0, -200.0), (12.5, 19.0, 90.0))
    path = replace(STILL, turns=turns).path(1, round(42 / step_s), step_s)
    z, v = complex(550, 100), complex(5, 5)
    t, rates = 0.0, {1.3: 0.0, 4.55: 30.0, 7.0: -200.0, 12.5: 0.0, 19.0: 90.0, 40.0: 0.0}
    for until, rate in rates.items():
        w, dt = np.radians(rate), until - t
        z, v = (z + (np.exp(1j * w * dt) - 1) / (1j * w) * v, v * np.exp(1j * w * dt)) if rate else (z + v * dt, v)
        assert path.at(until) == pytest.approx((z.real, z.imag, v.real, v.imag), abs=1e-6)
        t = until


def test_between_its_knots_it_is_on_the_arc() -> None:
    for rate in (45.0, 100.0, 360.0):
        path = replace(STILL, turns=((0.0, 10.0, rate),)).path(1, 10, 1.0)
        radius = hypot(5, 5) / np.radians(rate)
        middle = complex(550, 100) + 1j * complex(5, 5) / np.radians(rate)
        places = at(path, *np.linspace(0, 10, 777))
        off = np.abs(places[:, 0] + 1j * places[:, 1] - middle) - radius
        assert np.abs(off).max() < 0.001 * radius
        assert max(np.diff(path.t)) * rate <= ARC_DEG + 1e-6


def test_a_target_that_turns_in_the_middle_of_a_step_has_the_noise_of_a_whole_one() -> None:
    """A turn of no rate divides steps of a second into 0.25, 0.5 and 0.25 s."""
    odd = replace(TURNING, turns=tuple((k + 0.25, k + 0.75, 0.0) for k in range(100)))
    for held in (False, True):
        path = states_at(replace(odd, held=held, q=1.0), 100)
        added = path[1:] - path[:-1] @ np.array(transition(1.0)).T
        place = sqrt(1 / 4 if held else 1 / 3)
        for column, sd in zip(added.T, (place, place, 1.0, 1.0), strict=True):
            assert stats.kstest(column / sd, "norm").pvalue > 1e-4
        along = stats.pearsonr(added[:, 0], added[:, 2]).statistic
        assert along == pytest.approx(1.0 if held else sqrt(3) / 2, abs=0.12)  # of 100: sd 0.025 if not held


def states_at(drift: Drift, steps: int) -> np.ndarray:
    return at(drift.path(5, steps, 1.0), *range(steps + 1))


# --- the section ------------------------------------------------------------------------------------------------------


def test_a_scenario_says_so() -> None:
    said = {"q": 0.25, "held": True, "start_sd": [0.5, 0.5, 0, 0.1], "turns": [[3, 5, 45.0], [5, 6.5, -22.5]]}
    steps, paths = target_paths(scenario(steps=9, heading_deg=90.0, half_width_m=1e7, **said))
    expected = Drift(
        0.25, 2.0, 90.0, 1e7, held=True, start_sd=(0.5, 0.5, 0.0, 0.1), turns=((3, 5, 45), (5, 6.5, -22.5))
    )
    assert (steps, paths["target"]) == (9, expected.path(1, 9, 1.0))


def test_written_it_reads_back_the_same(tmp_path: Path) -> None:
    one = scenario(held=True, start_sd=[1, 2, 0.5, 0], turns=[[0, 2, 45], [65, 69.5, -22.5]], steps=70)
    (tmp_path / "mine.toml").write_text(one.to_toml())
    assert Scenario.load(tmp_path / "mine.toml").plain() == one.plain()
    assert Scenario.load(json.loads(json.dumps(one.plain()))).plain() == one.plain()
    assert survey(Scenario.load(tmp_path / "mine.toml")).paths == survey(one).paths


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ({"held": 1}, "target.held: is 1; expected true or false"),
        ({"start_sd": [1, 1, 1]}, "target.start_sd: is [1, 1, 1]; expected a list of 4"),
        ({"start_sd": [1, 1, 1, -1]}, "target.start_sd: is -1; expected a list of 4, each a number from 0 to 10000000"),
        ({"turns": [[5, 4, 10]]}, "target.turns: a turn goes from 5 s to 4 s; expected an end 0.001 s later or more"),
        (
            {"turns": [[0, 4, 10], [3, 5, 10]]},
            "target.turns: a turn begins at 3 s, and the one before it ends at 4 s; expected turns in order",
        ),
        (
            {"turns": [[0, 4, 361]]},
            "target.turns: is 361; expected a list of [from_s, until_s, deg_s], one after the other",
        ),
        ({"turns": [[0, 4]]}, "target.turns: is [0, 4]; expected a list of [from_s, until_s, deg_s]"),
        ({"turns": [[0, 1e6, 10]]}, "target.turns: turns by 1e+07 degrees in all; expected at most 1e+06"),
        ({"turns": [[k, k + 1, 1] for k in range(101)]}, "target.turns: has more than 100 entries"),
    ],
)
def test_what_it_cannot_be(target: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(**target)
    assert str(caught.value).startswith(message)
    assert len(str(caught.value).splitlines()) == 1
