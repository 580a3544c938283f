"""What docs/papers-ozfidan.md says of the experiments of Özfidan et al. (2018) is in ``results.json`` beside it."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import pytest

from launcher.reproduce.intervals import Interval
from launcher.reproduce.papers.ozfidan.claims import JUDGES
from launcher.reproduce.papers.ozfidan.words import BATCHED
from launcher.reproduce.tables import READING, Claim, Row, claims_table, rows_table, with_interval

DOCS: Final = Path(__file__).parents[1] / "docs"
SAID: Final = (DOCS / "papers-ozfidan.md").read_text()
RESULTS: Final[dict[str, Any]] = json.loads((DOCS / "papers-ozfidan" / "results.json").read_text())
INTERVALS: Final = frozenset(field.name for field in fields(Row) if "Interval" in str(field.type))


def rows(table: str) -> list[Row]:
    return [
        Row(**{name: Interval(*it) if it and name in INTERVALS else it for name, it in row.items()})
        for row in RESULTS["tables"][table]
    ]


def test_claims_and_verdicts_are_those_of_the_results() -> None:
    found = [Claim(**claim) for claim in RESULTS["claims"]]
    assert len(found) == len(JUDGES)
    assert f"{READING}\n\n{claims_table(found)}" in SAID


def test_figures_beside_the_prototypes_are_those_of_the_results() -> None:
    assert rows_table(rows("prototype")) in SAID


def lines(start: str) -> list[str]:
    """The lines of tables whose first cell is this."""
    return [line for line in SAID.splitlines() if re.match(rf"\| {re.escape(start)} +\|", line)]


@pytest.mark.parametrize("row", rows("errors"), ids=lambda row: f"{row.case}-{row.tracker}")
def test_every_error_is_in_the_docs(row: Row) -> None:
    assert any(f" {with_interval(row.ours)} " in line for line in lines(row.case)), with_interval(row.ours)


@pytest.mark.parametrize("row", rows("energy, prototype"), ids=lambda row: f"{row.case}-{row.quantity}")
def test_every_count_beside_the_prototypes_is_in_the_docs(row: Row) -> None:
    told = with_interval(row.ours, lambda value: f"{value:.4g}" if value < 1e4 else f"{value:.0f}")
    assert any(f" {row.quantity} " in line and f" {told} " in line for line in lines(row.case)), told


def test_the_command_is_that_of_the_results_and_tables_say_where_they_come_from() -> None:
    assert f"\n{' '.join(RESULTS['command'])}\n" in SAID
    assert RESULTS["command"][-2:] == ["--runs", str(RESULTS["runs"])]
    tables = SAID.partition("\n## Tables\n")[2].partition("\n## ")[0]
    headings = re.findall(r"^### (.*)$", tables, re.MULTILINE)
    assert len(headings) > 10
    assert [heading for heading in headings if not heading.endswith(f"({BATCHED})")] == []
