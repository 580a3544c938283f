"""``extra_loss``: a share of all transmissions of any link, on top of its model.

Statistical tests compare with the exact distribution, and fail for a right answer with probability ``SURE``.
"""

from __future__ import annotations

from typing import Any

import pytest
from scipy.stats import binom

from tests.links import MS, PLACES, likely, radio_link
from tests.test_link import SPECS, frames
from trackfield.errors import ScenarioError
from trackfield.link import make_link
from trackfield.link.fate import Transmission
from trackfield.link.signals import Signals
from trackfield.scenario import Scenario

CLOSE = {"a": (0.0, 0.0), "b": (1.0, 0.0)}
"""So near that a radio loses nothing by itself."""


def sent(n: int) -> list[Transmission]:
    return [Transmission("a", "b", "doa", i * MS, 0, 10) for i in range(n)]


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec["model"])
def test_without_it_a_link_is_as_it_was(spec: dict[str, Any]) -> None:
    plain, with_none = make_link(spec, 1, PLACES), make_link({**spec, "extra_loss": 0.0}, 1, PLACES)
    for frame in (Transmission(*key) for key in frames(200)):
        assert plain.fate(frame) == with_none.fate(frame)


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec["model"])
def test_what_is_lost_with_less_is_lost_with_more(spec: dict[str, Any]) -> None:
    """Common random numbers: losses of one seed are nested, where a frame is sent once."""
    once = {key: value for key, value in spec.items() if key != "ack"}
    links = [make_link({**once, "extra_loss": share}, 1, PLACES) for share in (0.0, 0.2, 0.5)]
    for frame in (Transmission(*key) for key in frames(300)):
        gone = [link.fate(frame).cause is not None for link in links]
        assert gone == sorted(gone)


@pytest.mark.parametrize("model", ["ideal", "ethernet", "csma154", "lognormal_prr"])
def test_that_share_is_lost(model: str) -> None:
    link, n = make_link({"model": model, "extra_loss": 0.3}, 1, CLOSE), 4000
    lost = sum(link.fate(frame).cause is not None for frame in sent(n))
    assert likely(lost, binom(n, 0.3))
    assert link.reception("a", "b", 10, "doa") == pytest.approx(0.7, abs=1e-6)


def test_each_repeat_and_acknowledgement_may_be_lost() -> None:
    """Three tries: all are lost with .3 to the power of 3; the first is known to have arrived with .7 squared."""
    link, n = radio_link(CLOSE, ack=3, extra_loss=0.3), 4000
    fates = [link.fate(frame) for frame in sent(n)]
    assert likely(sum(fate.cause is not None for fate in fates), binom(n, 0.3**3))
    assert likely(sum(fate.attempts == 1 for fate in fates), binom(n, 0.7**2))
    assert link.reception("a", "b", 10, "doa") == pytest.approx(1 - 0.3**3, abs=1e-6)


def test_signals_stay_as_strong() -> None:
    links = [
        make_link({"model": "lognormal_prr", "extra_loss": share, "range_m": 500.0}, 1, PLACES) for share in (0, 0.4)
    ]
    found = [Signals.of(link, "field") for link in links]
    assert found[0] and found[1]
    assert found[0].db("n1", "fusion") == found[1].db("n1", "fusion")
    assert Signals.of(make_link({"model": "csma154", "extra_loss": 0.4}, 1, PLACES), "field") is not None


@pytest.mark.parametrize("share", [-0.1, 1.0, "much"])
def test_shares_that_leave_nothing_or_are_none_are_refused(share: object) -> None:
    with pytest.raises(ScenarioError, match=r"link\.extra_loss"):
        Scenario.load("bus", {"link.extra_loss": share})
