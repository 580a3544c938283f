"""The tables of docs/gateway.md are those of the runs (``tests/gateway_figures.py``)."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from tests.gateway_figures import AWAY, LOSSY, away_row, hop_row

DOCUMENT: Final = (Path(__file__).parents[1] / "docs" / "gateway.md").read_text()


@pytest.mark.parametrize("name", AWAY)
def test_what_happens_when_a_side_is_away_is_as_documented(name: str) -> None:
    assert away_row(name) in DOCUMENT


@pytest.mark.parametrize(
    ("hops", "name", "settings"),
    [(1, "1 forwarding node", ()), (3, "3 forwarding nodes", ()), (3, "3, and one frame in seven is lost", LOSSY)],
    ids=["one", "three", "lossy"],
)
def test_how_long_fixes_take_over_hops_is_as_documented(hops: int, name: str, settings: tuple[str, ...]) -> None:
    """Without the last column, which has all messages of the backbone."""
    row = hop_row(hops, name, *settings)
    assert row.rsplit("|", 2)[0] in DOCUMENT
