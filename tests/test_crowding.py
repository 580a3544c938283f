"""What is counted afterwards against a simulation in which frames do collide (``tests/crowding.py``)."""

from __future__ import annotations

import pytest

from tests.crowding import CASES, Case, Point, exceeds, of_load, of_number

LORA, CLOSE, HIDDEN, REPEATED = CASES


@pytest.mark.parametrize("load", [0.05, 0.2])
def test_of_radios_that_do_not_listen_both_agree(load: float) -> None:
    """The same transmissions overlap; what is spared is what the simulation loses more: off by two standard errors of
    1500 losses at most, as only the draws of weak signals differ.
    """
    found = of_load(LORA, load, fields=2)
    assert found.overlapped == pytest.approx(found.met, abs=0.002)
    assert found.spared == pytest.approx(found.model - found.simulated, abs=0.005)


@pytest.mark.parametrize("case", [CLOSE, HIDDEN])
def test_of_radios_that_listen_what_is_spared_is_about_what_is_lost(case: Case) -> None:
    """At low loads, where nobody waits for long; five standard errors of 3000 reports are 1.5 %."""
    found = of_load(case, 0.05, fields=2)
    assert found.spared == pytest.approx(found.model - found.simulated, abs=0.015)
    assert found.met < found.overlapped / 2  # listening keeps most of them apart


@pytest.mark.parametrize(("case", "nodes"), [(CLOSE, 2), (CLOSE, 4), (REPEATED, 3)])
def test_a_few_that_report_at_once_lose_about_what_is_spared(case: Case, nodes: int) -> None:
    found = of_number(case, nodes, fields=4)
    assert found.model - found.simulated == pytest.approx(found.spared, rel=0.35, abs=0.03)


def test_from_where_on_they_differ_is_between_two_points() -> None:
    points = [Point(1.0, simulated, 0.0, 0.0, 0.0) for simulated in (0.98, 0.9)]
    assert exceeds((1.0, 2.0), points, 0.05) == pytest.approx(1.375)
    assert exceeds((1.0, 2.0), points, 0.5) is None
    assert exceeds((1.0, 2.0), points, 0.01) == 1.0
