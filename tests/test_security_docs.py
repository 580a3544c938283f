"""docs/security.md says what the code does."""

from __future__ import annotations

from pathlib import Path

from launcher.security.access import TOOLS
from launcher.security.authority import DAY_S, LENGTHS, SKEW
from tests.access_table import table

DOCS = (Path(__file__).parents[1] / "docs" / "security.md").read_text()


def test_the_table_of_what_each_certificate_may_do_is_that_of_the_code() -> None:
    assert table() in DOCS, "print it with python -m tests.access_table"


def test_names_and_times_are_those_of_the_code() -> None:
    for name in TOOLS:
        assert f"`{name}`" in DOCS
    assert (DAY_S, LENGTHS, SKEW.total_seconds()) == (86_400, 2, 3600)
    assert "valid for a day, or twice as long as the run takes" in DOCS
    assert "late by an hour" in DOCS
