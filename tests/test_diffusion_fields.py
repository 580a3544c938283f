"""Directed diffusion over random fields (``tests/diffusion.py``): what must arrive, and by how many frames."""

from __future__ import annotations

from itertools import islice

import pytest

from tests.diffusion import KILLED, NODES, REPORTS, SINK, connected, fields, hops_to_sink, places, run

FIELDS = list(islice(fields(), 3))


def test_hops_are_those_of_the_shortest_way() -> None:
    at = {SINK: (0.0, 0.0), "a": (10.0, 0.0), "b": (20.0, 0.0), "c": (0.0, 10.0), "d": (50.0, 0.0)}
    assert hops_to_sink(at, 10.0) == {SINK: 0, "a": 1, "c": 1, "b": 2}
    assert not connected(at, 29.9)
    assert connected(at, 30.0)


def test_at_20_m_hardly_any_field_is_connected_and_at_40_m_nearly_all() -> None:
    """8 and 1922 of 2000 are (docs/architecture.md)."""
    assert sum(connected(places(seed), 20.0) for seed in range(300)) <= 5
    assert sum(connected(places(seed), 40.0) for seed in range(300)) >= 270


@pytest.mark.parametrize("which", range(len(FIELDS)))
def test_without_loss_each_report_arrives_by_its_way(which: int) -> None:
    """Each hop takes data and its acknowledgement; paths and their repair come on top, once for each source."""
    seed, at = FIELDS[which]
    seen = run(seed, at, loss=0.0, killed=0)
    assert len(seen.reports) == (NODES - 1) * REPORTS
    assert all(one.came_ns is not None for one in seen.reports)
    assert seen.floods == 0
    hops = sum(one.hops for one in seen.reports)
    assert 2 * hops <= seen.frames <= 3 * hops


@pytest.mark.parametrize("which", range(len(FIELDS)))
def test_where_relays_die_or_frames_are_lost_nearly_all_arrive(which: int) -> None:
    seed, at = FIELDS[which]
    repaired = run(seed, at, loss=0.0, killed=KILLED)
    assert repaired.reports
    assert all(one.came_ns is not None for one in repaired.reports)
    lossy = run(seed, at, loss=0.1, killed=KILLED)
    assert sum(one.came_ns is None for one in lossy.reports) <= 1
