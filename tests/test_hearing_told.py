"""What a head says of an event in a message: as many beliefs as fit, the reason, and the reports."""

from __future__ import annotations

import numpy as np

from head.hearing.memory import Pass
from head.hearing.told import MOST_BELIEF, OTHER, fix_report
from trackfield.filters.belief import Modes
from trackfield.filters.passes.types import REASONS
from trackfield.filters.types import Gaussian
from trackfield.role import NS, TrackPoint
from trackfield.tracking.stored import unpack
from trackfield.wire.codec import encode
from trackfield.wire.interests import Data
from trackfield.wire.passes import CpaReport
from trackfield.wire.raw import unpack as unpack_raw

STEP, AT_NS = 20, 30 * NS
KNOWN = Gaussian(np.array([1.0, 2.0, 3.0, 4.0]), np.eye(4))
RAW = [(i, Pass(f"n{i:02}", CpaReport(19, 1.0, 0, -20.0 - i, 0.5), AT_NS - (2 + i) * NS // 2)) for i in range(5)]


def ended(tracker: str, refused: str = "") -> TrackPoint:
    return TrackPoint(tracker, "target", AT_NS, "waiting", event_ns=AT_NS - NS, refused=refused)


def test_a_fix_has_the_beliefs_of_those_that_made_one_and_the_reason_of_the_first_that_did_not() -> None:
    fix = fix_report(7, STEP, AT_NS, {"ml": KNOWN, "ecpa": KNOWN}, [ended("ml"), ended("ecpa", REASONS[4])], RAW)
    assert (fix.number, fix.step, fix.reason) == (7, STEP, 4)
    assert set(unpack(fix.belief).beliefs) == {"ml"}


def test_without_any_there_are_no_beliefs() -> None:
    fix = fix_report(0, STEP, AT_NS, {"ml": None}, [ended("ml", REASONS[1])], RAW)
    assert (fix.belief, fix.reason) == (b"", 1)


def test_a_reason_in_words_of_its_own_has_a_number_for_that() -> None:
    assert fix_report(0, STEP, AT_NS, {}, [ended("mine", "it rained")], RAW).reason == OTHER


def test_reports_are_told_by_the_numbers_of_their_sensors_and_their_times_before_the_step() -> None:
    fix = fix_report(0, STEP, AT_NS, {"ml": KNOWN}, [ended("ml")], RAW)
    rows = unpack_raw(fix.raw)
    assert [row.number for row in rows] == [0, 1, 2, 3, 4]
    assert np.allclose([row.early_s for row in rows], [1.0, 1.5, 2.0, 2.5, 3.0])
    assert np.allclose([row.strength_db for row in rows], [-20.0, -21.0, -22.0, -23.0, -24.0])


def test_beliefs_that_do_not_fit_are_left_out_the_last_ones_first() -> None:
    """The message is data of diffusion, which holds 1024 bytes."""
    names = [f"tracker{number:02}" for number in range(30)]
    fix = fix_report(0, STEP, AT_NS, dict.fromkeys(names, KNOWN), [], [*RAW, *RAW])
    told = list(unpack(fix.belief).beliefs)
    assert 3 <= len(told) < 30
    assert told == names[: len(told)]
    assert len(fix.belief) <= MOST_BELIEF
    payload = encode(fix)
    assert encode(Data(b"base", 1, b"n00", 1, 1, 0, payload))


def test_mixtures_are_told_as_one_gaussian() -> None:
    modes = Modes(np.full(2, 0.5), np.array([[0.0, 0, 1, 0], [2.0, 0, 1, 0]]), np.tile(np.eye(4), (2, 1, 1)))
    fix = fix_report(0, STEP, AT_NS, {"imm-ukf": modes}, [], RAW)
    (belief,) = unpack(fix.belief).beliefs.values()
    assert isinstance(belief, Gaussian)
    assert np.allclose(belief.mean, [1.0, 0.0, 1.0, 0.0])
    assert np.isclose(belief.covariance[0, 0], 2.0)
