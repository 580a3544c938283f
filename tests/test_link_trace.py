"""A measured link, replayed."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.links import PLACES, TRACE, S
from trackfield.link import Fate, make_link
from trackfield.link.fate import Transmission


@pytest.mark.parametrize(
    ("t_s", "fate"),
    [
        (0, Fate(None, 2_500_000)),
        (9.999999999, Fate(None, 2_500_000)),
        (10, Fate("radio")),
        (20.499999999, Fate("radio")),
        (20.5, Fate(None, 1_000_000)),
        (1e6, Fate(None, 1_000_000)),
    ],
)
def test_the_last_line_at_or_before_holds(t_s: float, fate: Fate) -> None:
    assert make_link(TRACE, 1, PLACES).fate(Transmission("n1", "fusion", "doa", round(t_s * S), 0, 12)) == fate


def test_a_link_receives_nothing_before_its_first_line_or_without_one() -> None:
    link = make_link(TRACE, 1, PLACES)
    assert link.fate(Transmission("n2", "fusion", "doa", 5 * S - 1, 0, 12)) == Fate("radio")
    assert link.fate(Transmission("n2", "fusion", "doa", 5 * S, 0, 12)) == Fate(None, 40_000_000)
    assert link.fate(Transmission("fusion", "n2", "doa", 5 * S, 0, 12)) == Fate("radio")


def test_its_reception_is_that_of_the_instant() -> None:
    link = make_link(TRACE, 1, PLACES)
    shares = [link.reception("n1", "fusion", 12, at_ns=round(t_s * S)) for t_s in (0, 9.9, 10, 20.4, 20.5, 1e6)]
    assert shares == [1, 1, 0, 0, 1, 1]
    assert [link.reception("n2", "fusion", 12, at_ns=t_s * S) for t_s in (4, 5)] == [0, 1]
    assert link.reception("fusion", "n1", 12, at_ns=5 * S) == 0


def test_a_process_keeps_its_own_links_of_a_trace() -> None:
    mine = make_link(TRACE, 1, {"n2": (0.0, 0.0), "fusion": (0.0, 0.0)})
    assert mine.fate(Transmission("n2", "fusion", "doa", 5 * S, 0, 12)).cause is None
    assert mine.reception("n10", "n1", 12) == 0
    assert make_link(TRACE, seed=1).reception("n10", "n1", 12) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column src, dst, t_s, received, delay_ms"),
        ("src,dst,t_s,received\n", "no column delay_ms"),
        ("src,dst,t_s,received,delay_ms\na,b,soon,1,2\n", ":2: .*soon"),
        ("src,dst,t_s,received,delay_ms\na,b,0,1,2\na,b,-1,1,2\n", ":3: t_s"),
        ("src,dst,t_s,received,delay_ms\na,b,0,yes,2\n", ":2: received: 'yes' is not 0 or 1"),
        ("src,dst,t_s,received,delay_ms\na,b,0,1,nan\n", ":2: delay_ms"),
        ("src,dst,t_s,received,delay_ms\na,b,0\n", ":2: has too few cells"),
        ("rssi,src,dst,t_s,received,delay_ms,note\n-80,a,b,0,1,2\n-80,a,b,0,1\n", ":3: has too few cells"),
    ],
)
def test_a_trace_that_cannot_be_used(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "trace.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        make_link({"model": "trace", "file": str(tmp_path / "trace.csv")}, seed=1)


@pytest.mark.parametrize("cells", ["", ",-80", ",-80,walked by", ",-80,walked by,more"])
def test_only_the_cells_of_its_own_columns_are_needed(cells: str, tmp_path: Path) -> None:
    (tmp_path / "trace.csv").write_text(f"src,dst,t_s,received,delay_ms,rssi,note\na,b,0,1,2{cells}\n")
    link = make_link({"model": "trace", "file": str(tmp_path / "trace.csv")}, seed=1)
    assert link.fate(Transmission("a", "b", "doa", 0, 0, 12)) == Fate(None, 2_000_000)
