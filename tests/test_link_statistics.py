"""What the statistics of docs/links.md say of recordings that are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np
import pytest

from launcher.calibrate.samples import Samples, samples_of
from tests.link_statistics import correlation, logistic, lost_where, statistics
from tests.measured_links import HEARD, heard, square
from tests.recorded import Schedule, recorded
from trackfield.link.k7 import parse_k7

SECTION: Final[dict[str, Any]] = {"model": "lognormal_prr", "radio": "802154-0dbm"}
SCHEDULE: Final = Schedule(rounds=6, channels=4)
NODES: Final = {str(i): (37.0 * (i % 5), 41.0 * (i // 5)) for i in range(20)}


def samples(**keys: Any) -> Samples:
    return samples_of(parse_k7(recorded({**SECTION, **keys}, NODES, 1, SCHEDULE), "x"))


def test_links_that_do_not_change() -> None:
    found = statistics(samples())
    assert found.of_links > 0.98
    assert found.of_time < 0.005
    assert found.moved == 0
    assert found.strong_between == 0
    assert found.width_db == pytest.approx(1.7, abs=0.4)  # of the radio's curve for 106 bytes


def test_bursts_are_variance_over_time_and_no_channel() -> None:
    found = statistics(samples(burst_loss=0.2, burst_s=5.0))
    assert found.of_time > 0.1
    assert found.of_channels < 0.02
    assert abs(found.next_round) < 0.1  # they are over long before


def test_what_differs_by_channel() -> None:
    whole = samples()
    odd = whole.channel % 2 == 1
    found = statistics(replace(whole, pdr=np.where(odd, 0.6 * whole.pdr, whole.pdr)))
    assert found.of_channels > 0.05
    assert found.of_time < 0.01
    assert found.next_round > 0.9
    assert found.next_window < -0.5  # every second channel is better than the mean


def test_symmetric_links_have_no_difference() -> None:
    found = statistics(samples(asymmetry_db=0.0))
    assert (found.level_db, found.very_unequal) == (pytest.approx(0, abs=1e-9), 0)
    assert found.one_way < 0.05  # those that deliver a frame or two in all, by chance one way only


def test_a_logistic_curve_is_found_back() -> None:
    level = np.linspace(-95, -50, 400)
    middle, scale = logistic(level, 0.93 / (1 + np.exp(-(level + 84) / 1.3)))
    assert (middle, scale) == (pytest.approx(-84, abs=1e-3), pytest.approx(1.3, abs=1e-3))


def test_correlation_is_of_windows_of_one_link() -> None:
    whole = samples(burst_loss=0.2, burst_s=5.0)
    flip = np.where(np.arange(len(whole.pdr)) % 2, 0.25, 0.75)
    every = np.ones(len(flip), bool)
    assert correlation(replace(whole, pdr=flip), every, 1) == pytest.approx(-1, abs=0.01)
    assert correlation(replace(whole, pdr=flip), every, 2) == pytest.approx(1, abs=0.01)


def test_where_losses_are() -> None:
    """A third lost on one channel of four, and a thousandth on the others."""
    whole = samples()
    odd = whole.channel == 12
    few, theirs, none = lost_where(replace(whole, pdr=np.where(odd, 2 / 3, 0.999)), -90)
    assert (few, none) == (0.25, 0.75)
    assert theirs == pytest.approx(1 / 3 / (1 / 3 + 3 * 0.001))


def test_the_square_has_the_share_that_is_asked_for() -> None:
    side, places = square(SECTION, 3, 0.2)
    assert heard(SECTION, places, 3) == pytest.approx(0.2, abs=0.005)
    assert max(max(place) for place in places.values()) <= side
    assert HEARD < 1 / (19 * 16 * 100)
