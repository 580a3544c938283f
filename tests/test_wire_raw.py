"""The raw reports of a fix, as bytes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.wire.passes import MOST_RAW
from trackfield.wire.raw import Raw, pack, unpack

rows = st.builds(
    Raw, st.integers(0, 65535), st.floats(0.0, 6.5535), st.floats(-100.0, 200.0), st.floats(0.0, 6.375)
)  # fmt: skip


@given(st.lists(rows, max_size=MOST_RAW))
def test_they_come_back_within_half_a_step_of_their_resolutions(given_rows: list[Raw]) -> None:
    found = unpack(pack(given_rows))
    assert [one.number for one in found] == [one.number for one in given_rows]
    for one, old in zip(found, given_rows, strict=True):
        assert abs(one.early_s - old.early_s) <= 0.00005 + 1e-9
        assert abs(one.strength_db - old.strength_db) <= 0.005 + 1e-9
        assert abs(one.width_s - old.width_s) <= 0.0125 + 1e-9


def test_the_bytes_are_these() -> None:
    """By hand: 258, 10000 steps of 0.1 ms, -1234 of 0.01 dB, 40 of 25 ms, little-endian."""
    assert pack([Raw(258, 1.0, -12.34, 1.0)]).hex() == "02011027" + "2efb" + "2800"


def test_those_that_are_too_old_or_to_come_are_left_out_and_the_last_eight_kept() -> None:
    assert pack([Raw(1, 7.0, 0.0, 0.0), Raw(2, -0.1, 0.0, 0.0)]) == b""
    many = [Raw(number, 1.0, 0.0, 0.0) for number in range(11)]
    assert [one.number for one in unpack(pack(many))] == list(range(3, 11))


@pytest.mark.parametrize("length", [1, 7, 9])
def test_bytes_that_end_within_a_report_are_refused(length: int) -> None:
    with pytest.raises(ValueError, match=f"{length} bytes"):
        unpack(bytes(length))
