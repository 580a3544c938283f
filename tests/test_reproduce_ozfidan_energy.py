"""Frames and energy of the clusters of Özfidan et al. (2018), counted by hand in small cases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.ozfidan.counts import BEACON_EVERY, counts, counts_of_all
from launcher.reproduce.papers.ozfidan.energy import (
    ACCOUNTS,
    CC2420,
    EVERY_1,
    EVERY_10,
    ON,
    RADIO,
    REPORTS,
    SLEEP,
    SLOTS,
    Ledger,
    energy,
    frames,
    on_air_s,
    sent_bytes,
)
from launcher.reproduce.papers.ozfidan.field import NOBODY, Setup, Truth
from launcher.reproduce.papers.ozfidan.tracks import Tracks
from trackfield.filters.types import Gaussian
from trackfield.link.lora868 import Lora

SETUP = Setup(masters=3, slaves=6, capacity=3, steps=4)
OWNER = np.array([[0, 0, 0, 1, 2, NOBODY]])
MJ_PER_BYTE = 32e-6 * (17.4 + 18.8) * 3.0  # sent and received, by mA at 3 V


def truth() -> Truth:
    places = np.zeros((1, 6, 2))
    return Truth(places[:, :3], places, OWNER, np.zeros((1, 5, 4)), np.zeros((1, 4, 6)), Gaussian(places, places))


def tracks(awake: list[list[int]], leader: list[int]) -> Tracks:
    """Of one run, by the slaves that are awake at each step."""
    flags = np.array([[[slave in some for slave in range(6)] for some in awake]])
    steps = flags.shape[1]
    return Tracks(np.zeros((1, steps, 4)), np.zeros((1, steps)), np.array([leader]), flags, np.zeros((1, steps), int))


def hand_counted() -> Figures:
    """Four steps: master 0 leads with two of its slaves, then with three and the one of master 1, which then leads."""
    return counts(SETUP, truth(), tracks([[0, 1], [0, 1, 2, 3], [0, 1, 2, 3], [3]], [0, 0, 1, 1]))


# --- counts ---


def test_what_is_sent_in_four_steps() -> None:
    found = hand_counted()
    assert found["reports"] == pytest.approx([(2 + 4 + 4 + 1) / 4])
    # by size: the one of master 1 at step 2, the three of master 0 at step 3, when master 1 leads; leaders forward none
    assert found["forwards"][0] == pytest.approx([0.0, 1 / 4, 0.0, 1 / 4])
    assert found["handovers"] == pytest.approx([1 / 4])
    assert found["estimates"] == pytest.approx([1.0])
    # for the two of master 0, for its three when another is woken, and for the one of master 1
    assert found["beacons"][0] == pytest.approx([0.0, 1 / 4, 1 / 4, 1 / 4])
    assert found["asleep"] == pytest.approx([5 - 11 / 4])  # the sixth has no master: nobody wakes it


def test_those_who_stay_awake_hear_a_beacon_now_and_then() -> None:
    steps = 2 * BEACON_EVERY + 1
    found = counts(SETUP, truth(), tracks([[3]] * steps, [1] * steps))
    assert found["beacons"][0] * steps == pytest.approx([0.0, 3.0, 0.0, 0.0])
    again = counts(SETUP, truth(), tracks([[3], [], [3], []], [1] * 4))
    assert again["beacons"][0] * 4 == pytest.approx([0.0, 2.0, 0.0, 0.0])


def test_without_scheduling_every_slave_with_a_master_reports_and_every_master_that_has_slaves_forwards() -> None:
    found = counts_of_all(SETUP, truth())
    assert found["reports"] == [5.0]
    assert found["forwards"][0].tolist() == [0.0, 2.0, 0.0, 1.0]
    assert [found[what].sum() for what in ("estimates", "handovers", "beacons", "asleep")] == [0.0] * 4


# --- energy ---


def of_all() -> Ledger:
    return Ledger(counts_of_all(SETUP, truth()), 6, 3, scheduled=False)


def scheduled() -> Ledger:
    return Ledger(hand_counted(), 6, 3)


def test_frames_and_bytes_of_a_step() -> None:
    assert frames(of_all()) == pytest.approx([2 * (5 + 3)])
    reports, forwards = 5 * (25 + 11), 2 * (17 + 2 + 6 + 11) + (17 + 2 + 18 + 11)
    assert sent_bytes(of_all(), RADIO[CC2420]) == pytest.approx([reports + forwards])
    ours = (11 * 36 + (36 + 48) + 4 * (17 + 18 + 11) + (17 + 64 + 11)) / 4
    assert sent_bytes(scheduled(), RADIO[CC2420]) == pytest.approx([ours])
    assert frames(scheduled()) == pytest.approx([2 * (11 + 2 + 4 + 1) / 4])
    assert on_air_s(scheduled(), RADIO[CC2420]) == pytest.approx([32e-6 * ours])


def test_each_account_by_hand() -> None:
    """Of the paper's radio: mJ in a step of 2 s."""
    radio, sleep_mw, receive_mw = RADIO[CC2420], 5.1e-3 * 3.0, 18.8 * 3.0

    def mj(one: Ledger, by: str) -> float:
        return float(1e3 * energy(one, radio, ACCOUNTS[by])[0])

    ours, theirs = (MJ_PER_BYTE * sent_bytes(one, radio)[0] for one in (scheduled(), of_all()))
    asleep = 2.0 * 6 * sleep_mw
    assert mj(scheduled(), REPORTS) == pytest.approx(ours)
    assert mj(of_all(), REPORTS) == pytest.approx(theirs)
    assert mj(scheduled(), SLEEP) == pytest.approx(ours + asleep)
    windows = (5 - 11 / 4) * 0.005 * receive_mw
    # beacons of 17 + 2 bytes and 2 for each slave, heard by one, two, three
    beacons = sum(32e-6 * (19 + 2 * n) * 3.0 * (17.4 + n * 18.8) for n in (1, 2, 3)) / 4
    assert mj(scheduled(), EVERY_1) == pytest.approx(ours + asleep + beacons + windows)
    assert mj(scheduled(), EVERY_10) == pytest.approx(ours + asleep + beacons + windows / 10)
    assert mj(of_all(), EVERY_1) == pytest.approx(theirs + asleep)
    assert mj(scheduled(), SLOTS) == pytest.approx(ours + asleep + 2.0 * 3 * sleep_mw)
    # masters are busy once with reports and estimates, twice with what they send each other
    busy_s = 32e-6 * (11 * 36 + 2 * (36 + 48) + 4 * 46 + 2 * 92) / 4
    assert mj(scheduled(), ON) == pytest.approx(ours + asleep + receive_mw * (2.0 * 3 - busy_s))
    sink_s = 32e-6 * sent_bytes(of_all(), radio)[0]  # without scheduling masters send to the sink
    assert mj(of_all(), ON) == pytest.approx(theirs + asleep + receive_mw * (2.0 * 3 - sink_s))


def test_the_baseline_is_drawn_during_frames_or_always() -> None:
    radio = RADIO[CC2420]

    def more(one: Ledger, by: str) -> float:
        return float(1e3 * (energy(one, radio, ACCOUNTS[by], baseline=True) - energy(one, radio, ACCOUNTS[by]))[0])

    assert more(scheduled(), REPORTS) == pytest.approx(6.0 * 2 * on_air_s(scheduled(), radio)[0])
    assert [more(scheduled(), SLEEP), more(of_all(), EVERY_1)] == pytest.approx([6.0 * 2.0 * 6] * 2)
    assert [more(scheduled(), ON), more(of_all(), SLOTS)] == pytest.approx([6.0 * 2.0 * 9] * 2)


@pytest.mark.parametrize("sf", [7, 9])
def test_lora_has_its_own_airtime_and_powers(sf: int) -> None:
    one, radio = Ledger(hand_counted() | {"estimates": np.zeros(1)}, 6, 3), RADIO[f"LoRa SF{sf}"]
    alone = one.counts | {"forwards": np.zeros((1, 4)), "handovers": np.zeros(1)}
    reports_s = 11 / 4 * (Lora(sf).airtime_ns(8 + 13) + Lora(sf).airtime_ns(13)) / 1e9
    found = energy(replace_counts(one, alone), radio, ACCOUNTS[REPORTS])
    assert found == pytest.approx([reports_s * (0.1452 + 0.03564)])
    assert radio.window_s == pytest.approx(max(0.005, 2 * Lora(sf).symbol_ns / 1e9))


def replace_counts(one: Ledger, some: Figures) -> Ledger:
    return one._replace(counts=some)


def test_a_report_of_the_paper_has_25_bytes() -> None:
    one = Ledger(hand_counted(), 6, 3)
    only = {name: np.zeros_like(value) for name, value in one.counts.items()} | {"reports": np.ones(1)}
    radio = replace(RADIO[CC2420], ack=0)
    assert sent_bytes(replace_counts(one, only), radio) == [25.0]
