"""Waking by radio: preambles that last from the window of one clock to that of another, or for the whole interval."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.ledger import Ledger
from tests import waking
from tests.protocols.agreement import in_time
from tests.simulated import simulated
from tests.test_drivers_agree import toy_plan
from trackfield.drivers.engine.receiver import Windows
from trackfield.protocols.wakeup import Wakeup
from trackfield.role import NS

MS = 1_000_000
UNSURE_NS = 40 * MS


def outcomes(**how: object) -> Counter[str]:
    ledger: Ledger = simulated(toy_plan(*waking.party(**how)))[0]
    return Counter(row.outcome for row in ledger.rows if row.kind == "call")


def test_two_symbols_at_sf9_are_8_ms() -> None:
    assert waking.LORA.detect_ns == 8_192_000
    assert waking.LORA.preamble_ns == 32_768_000


@given(
    st.integers(0, 300 * MS),
    st.integers(-(10**12), 10**12),
    st.integers(0, 10**12),
    st.integers(0, 100 * MS),
    st.integers(-100, 100),
)
def test_within_its_uncertainty_each_call_is_heard(
    unsure_ns: int, correction_ns: int, now: int, spare_ns: int, percent: int
) -> None:
    """The sleeper's clock is off by any share of the uncertainty, the sender's is the reference."""
    one = Wakeup(4 * NS, 10 * MS, 7 * MS, 8 * MS, spare_ns, unsure_ns)
    at = one.send_at(now)
    assert now <= at < now + 4 * NS
    listen = one.listen(correction_ns)
    begins = listen.from_ns + correction_ns + unsure_ns * percent // 100  # by the reference
    windows = Windows(listen.every_ns, listen.open_ns, begins, listen.detect_ns, listen.spare_ns)
    assert windows.catches(at, one.preamble_ns, -(1 << 62)) is not None or at < begins - unsure_ns


def test_the_preamble_is_twice_the_uncertainty_and_what_is_detected() -> None:
    one = Wakeup(4 * NS, 10 * MS, 0, 8 * MS, 24 * MS, UNSURE_NS)
    assert one.detect_ns + one.spare_ns + one.preamble_ns == 2 * UNSURE_NS + 8 * MS
    assert Wakeup(4 * NS, 10 * MS, 0, 8 * MS, 24 * MS, 10 * MS).preamble_ns == 0
    assert Wakeup(4 * NS, 10 * MS, 0, 8 * MS, 24 * MS).preamble_ns == 4 * NS - 24 * MS


@pytest.mark.parametrize(("every_ns", "open_ns"), [(5, 6), (5, 0), (20, 7)])
def test_windows_that_cannot_be_are_refused(every_ns: int, open_ns: int) -> None:
    with pytest.raises(ValueError, match="open_ns"):
        Wakeup(every_ns, open_ns, 0, 8)


def test_clocks_that_are_set_and_a_preamble_for_what_is_left_of_their_error_wake_all() -> None:
    found = outcomes(unsure_ns=UNSURE_NS)
    assert found["delivered"] > 100
    assert found.keys() <= {"delivered", "in_flight"}


def test_without_the_longer_preamble_most_are_missed() -> None:
    """What the usual preamble has to spare is 25 ms; a window that is 10 ms late is caught, most are not."""
    found = outcomes(unsure_ns=UNSURE_NS, short=True)
    assert found["asleep"] > found["delivered"]


def test_without_set_clocks_the_windows_are_missed() -> None:
    found = outcomes(unsure_ns=UNSURE_NS, clocks=False)
    assert found["asleep"] > 5 * found["delivered"]


def test_a_preamble_as_long_as_the_interval_needs_no_clocks() -> None:
    assert outcomes(unsure_ns=None, clocks=False).keys() <= {"delivered", "in_flight"}


@pytest.mark.parametrize("unsure_ns", [UNSURE_NS, None])
def test_both_drivers_agree(unsure_ns: int | None) -> None:
    one = in_time(toy_plan(*waking.party(unsure_ns=unsure_ns, seconds=90)), 20.0, 5.0)
    assert one.found == ()
    assert one.host_late == 0
