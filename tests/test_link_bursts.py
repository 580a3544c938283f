"""Dwells: a continuous-time Markov chain with rates 1/good_s and 1/bad_s, and links that are bad in its bad state.

Statistical tests as in ``tests/test_link.py``.
"""

from __future__ import annotations

import tracemalloc
from math import exp
from typing import Any

import pytest
from scipy.stats import binom, nbinom

from tests.links import MS, PLACES, S, likely
from tests.test_link import SPECS, frames
from trackfield.link import make_link
from trackfield.link.dwells import Dwells
from trackfield.link.fate import Transmission, lost


@pytest.mark.parametrize("at_s", [0, 0.5, 100])
def test_the_share_of_bad_links_is_stationary(at_s: float) -> None:
    link, n = Dwells(1, good_s=5, bad_s=2), 5000
    bad = sum(link.bad(f"n{i}", "fusion", round(at_s * S)) for i in range(n))
    assert likely(bad, binom(n, 2 / 7))


@pytest.mark.parametrize("lag_s", [0.1, 1, 5])
def test_how_long_a_link_stays_bad(lag_s: float) -> None:
    """P(bad after lag | bad) = p + (1 - p) exp(-(1/good + 1/bad) lag), with p the stationary share."""
    link, at, share = Dwells(2, good_s=5, bad_s=2), 7 * S, 2 / 7
    bad = [f"n{i}" for i in range(8000) if link.bad(f"n{i}", "fusion", at)]
    still = sum(link.bad(name, "fusion", at + round(lag_s * S)) for name in bad)
    assert likely(still, binom(len(bad), share + (1 - share) * exp(-(1 / 5 + 1 / 2) * lag_s)))


def test_the_length_of_bursts() -> None:
    """Seen every 0.1 s the chain is a discrete one: a burst spans 1 + a geometric number of samples."""
    link, step_s, share = Dwells(3, good_s=1.0, bad_s=0.5), 0.1, 1 / 3
    stay = share + (1 - share) * exp(-(1 / 1.0 + 1 / 0.5) * step_s)
    path = [link.bad("a", "b", round(i * step_s * S)) for i in range(30_000)]
    lengths = [len(run) for run in "".join("x" if bad else " " for bad in path).strip("x").split()]
    assert len(lengths) > 1000
    assert likely(sum(lengths) - len(lengths), nbinom(len(lengths), 1 - stay))


def test_good_and_bad_dwells_alternate() -> None:
    """With means a billion apart a link is nearly always in the state of the long one, however it began."""
    mostly_good, mostly_bad = Dwells(4, good_s=1e6, bad_s=0.001), Dwells(4, good_s=0.001, bad_s=1e6)
    assert not any(mostly_good.bad(f"n{i}", "b", S) for i in range(2000))
    assert all(mostly_bad.bad(f"n{i}", "b", S) for i in range(2000))


def test_links_are_independent_of_each_other_and_of_their_reverse() -> None:
    link, n, share = Dwells(5, good_s=5, bad_s=2), 5000, 2 / 7
    both = sum(link.bad(f"n{i}", "b", S) and link.bad("b", f"n{i}", S) for i in range(n))
    assert likely(both, binom(n, share**2))
    both = sum(link.bad(f"n{i}", "b", S) and link.bad(f"n{i + 1}", "b", S) for i in range(0, 2 * n, 2))
    assert likely(both, binom(n, share**2))


def test_bursts_of_one_medium_are_not_those_of_another() -> None:
    link, n, share = Dwells(5, good_s=5, bad_s=2), 5000, 2 / 7
    both = sum(link.bad(f"n{i}", "b", S) and link.bad(f"n{i}", "b", S, "backbone") for i in range(n))
    assert likely(both, binom(n, share**2))


def test_memory_does_not_grow_with_the_length_of_a_run() -> None:
    link, names = Dwells(10, good_s=2, bad_s=1), [f"n{i}" for i in range(200)]
    for name in names:
        link.bad(name, "fusion", 0)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for minute in range(10):
        for name in names:
            link.bad(name, "fusion", minute * 60 * S)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown / len(names) < 300  # bytes; 200 dwells per link went by


# --- bursts on any link ---

BURSTY: dict[str, Any] = {"burst_loss": 0.3, "burst_s": 2.0}


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec["model"])
def test_any_link_is_what_it_was_but_for_its_bursts(spec: dict[str, Any]) -> None:
    """What is sent, and what that costs, stays the same; what was lost before stays lost for its own reason."""
    plain, bursty = make_link(spec, 3, PLACES), make_link({**spec, **BURSTY}, 3, PLACES)
    dwells = Dwells(3, 2.0 * 0.7 / 0.3, 2.0, ("bursts",))
    hit = 0
    for frame in (Transmission(*f, broadcast=cast) for f in frames(400) for cast in (False, True)):
        fate, bad = plain.fate(frame), dwells.bad(frame.src, frame.dst, frame.sent_ns)
        hit += bad and fate.cause is None
        assert bursty.fate(frame) == (lost(fate, "radio") if bad and fate.cause is None else fate)
    assert hit > 20
    for ends in (("n1", "fusion"), ("n2", "n10")):
        assert bursty.reception(*ends, 12) == pytest.approx(0.7 * plain.reception(*ends, 12))


def test_a_links_own_bursts_and_those_on_top_are_independent() -> None:
    own = {"model": "gilbert_elliott", "good_s": 4.0, "bad_s": 4.0}
    link, n = make_link({**own, "burst_loss": 0.5, "burst_s": 4.0}, 1), 5000
    lost_now = sum(link.fate(Transmission(f"n{i}", "b", "doa", S, 0, 12)).cause is not None for i in range(n))
    assert likely(lost_now, binom(n, 0.75))


def test_bursts_last_four_seconds_unless_told() -> None:
    told, untold = (make_link({"model": "ideal", "burst_loss": 0.2, **more}, 5) for more in ({"burst_s": 4.0}, {}))
    asked = [Transmission("a", "b", "doa", 100 * k * MS, 0, 12) for k in range(2000)]
    assert [told.fate(one) for one in asked] == [untold.fate(one) for one in asked]


@pytest.mark.parametrize("share", [-0.1, 1.0, 2.0])
def test_a_share_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(ValueError, match=r"burst_loss: .* is not a share above 0 and below 1"):
        make_link({"model": "ideal", "burst_loss": share}, 1)
