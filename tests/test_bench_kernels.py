"""The bare loops of the benchmark give what ours give, so that their times may be compared; so do others' filters."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from bench import bare, growth, peers
from bench.data import BEARINGS, STEPS, Track, track
from bench.kernels import (
    BARE,
    OURS,
    alone,
    batched,
    data_error,
    looped,
    measured,
    proposals,
    table,
    take_ekf,
    take_ukf,
    tracked,
    unscented_particle_filters,
    with_peers,
)
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.single_model import Ekf, Ukf
from trackfield.filters.types import Array


def need(package: str) -> None:
    """Skip without this part of the extra ``bench``."""
    if find_spec(package) is None:
        pytest.skip(f"no peer {package}")


@pytest.fixture(scope="module")
def data() -> Track:
    return track()


def test_four_bearings_in_each_step_from_where_the_sensors_stand(data: Track) -> None:
    assert data.sensors.shape == (STEPS, BEARINGS, 2)
    off = data.truth[:, None, :2] - data.sensors
    misses = np.degrees(np.angle(np.exp(1j * (data.bearings - np.arctan2(off[..., 0], off[..., 1])))))
    assert 2.5 < misses.std() < 3.5  # of 240 draws of sd 3: five standard errors are 0.7
    assert np.hypot(off[..., 0], off[..., 1]).max() < 100.0


@pytest.mark.parametrize("n", [200, 1000])
def test_the_bare_bootstrap_draws_the_same_particles(data: Track, n: int) -> None:
    loop = looped(data, lambda: bare.Bootstrap(data, n, np.random.default_rng(1)))
    assert loop() == pytest.approx(tracked(data, Bootstrap(n))(), abs=1e-9)


def test_the_bare_kalman_filters_have_the_same_means(data: Track) -> None:
    assert looped(data, lambda: bare.Ekf(data, 1))() == pytest.approx(tracked(data, Ekf())(), abs=1e-9)
    assert looped(data, lambda: bare.Ukf(data, 1))() == pytest.approx(tracked(data, Ukf())(), abs=1e-9)


def test_the_kernels_alone_are_the_tracker(data: Track) -> None:
    assert alone(data, take_ekf)() == pytest.approx(tracked(data, Ekf())(), abs=1e-9)
    assert alone(data, take_ukf)() == pytest.approx(tracked(data, Ukf())(), abs=1e-9)


def test_many_filters_at_once_do_what_one_does(data: Track) -> None:
    assert batched(data, take_ekf, 3)() == pytest.approx(tracked(data, Ekf())(), abs=1e-9)
    assert batched(data, take_ukf, 3)() == pytest.approx(tracked(data, Ukf())(), abs=1e-9)
    assert looped(data, lambda: bare.Ekf(data, 3))() == pytest.approx(
        looped(data, lambda: bare.Ekf(data, 1))(), abs=1e-9
    )
    assert looped(data, lambda: bare.Ukf(data, 3))() == pytest.approx(
        looped(data, lambda: bare.Ukf(data, 1))(), abs=1e-9
    )


def test_filterpy_has_the_same_filters(data: Track) -> None:
    need("filterpy")
    assert peers.filterpy_ekf(data)() == pytest.approx(tracked(data, Ekf())(), abs=1e-9)
    assert peers.filterpy_ukf(data)() == pytest.approx(tracked(data, Ukf())(), abs=1e-9)


def test_stone_soup_tracks_as_well(data: Track) -> None:
    """One bearing after the other linearises anew, so its means are not the same."""
    need("stonesoup")
    assert data_error(data, peers.stonesoup_kalman(data, "Extended")()) < 2.0
    assert data_error(data, peers.stonesoup_particles(data, 1000)()) < 4.0


def test_a_table_has_times_ratios_and_errors(data: Track) -> None:
    def still() -> Array:
        return data.truth + np.array([3.0, 4.0, 0.0, 0.0])

    rows = measured(data, {BARE: still, OURS: tracked(data, Ekf())}, rounds=1)
    assert (rows[0].who, rows[0].ratio, rows[0].error_m) == (BARE, 1.0, pytest.approx(5.0))
    assert rows[1].us == pytest.approx(rows[1].ratio * rows[0].us)
    assert table("filter", {"a": rows}).splitlines()[2].startswith(f"| a | {BARE} | ")


def test_who_is_not_installed_is_left_out(data: Track, capsys: pytest.CaptureFixture[str]) -> None:
    def missing() -> peers.Contender:
        raise ImportError("No module named 'peer'")

    found = with_peers({OURS: tracked(data, Ekf())}, {"peer": missing, "other": lambda: tracked(data, Ukf())})
    assert list(found) == [OURS, "other"]
    assert capsys.readouterr().err == "left out: peer is not installed (No module named 'peer')\n"


@pytest.mark.rendered
def test_growth_is_drawn(tmp_path: Path) -> None:
    nodes = [{"nodes": n, "all": n / 100, "run": 1.0} for n in (100, 1000)]
    particles = [{"particles": n, "bootstrap": n / 10, "spcpf": n / 5} for n in (100, 1000)]
    growth.draw(nodes, particles, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_unscented_particle_filters_track(data: Track) -> None:
    """Ours below the 20 m that the prior alone allows; those of others, if there, give numbers, the same again."""
    for who, run in {**unscented_particle_filters(data), **proposals(data)}.items():
        means = run()
        if who == "Stone Soup":
            assert np.array_equal(means, run())
            assert np.isfinite(means).all()
        else:
            assert data_error(data.first(len(means)), means) < 8.0, who
