"""What docs/papers-yu.md says of the runs of Yu et al. (2009) through roles is in ``results.json`` beside it."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import pytest

from launcher.reproduce.intervals import Interval
from launcher.reproduce.papers.yu.judged import JUDGES
from launcher.reproduce.papers.yu.messages import PARTS
from launcher.reproduce.tables import READING, Claim, Row, claims_table, rows_table, with_interval

DOCS: Final = Path(__file__).parents[1] / "docs"
SAID: Final = (DOCS / "papers-yu.md").read_text()
RESULTS: Final[dict[str, Any]] = json.loads((DOCS / "papers-yu" / "results.json").read_text())
INTERVALS: Final = frozenset(field.name for field in fields(Row) if "Interval" in str(field.type))


def rows(table: str) -> list[Row]:
    found = []
    for row in RESULTS["tables"][table]:
        values: dict[str, Any] = {name: Interval(*it) if it and name in INTERVALS else it for name, it in row.items()}
        found.append(Row(**values))
    return found


def test_claims_and_verdicts_are_those_of_the_results() -> None:
    found = [Claim(**claim) for claim in RESULTS["claims"]][-len(JUDGES) :]
    assert f"{READING}\n\n{claims_table(found)}" in SAID


def test_figures_beside_another_design_are_those_of_the_results() -> None:
    assert rows_table(rows("roles, beside")) in SAID


@pytest.mark.parametrize("row", rows("roles"), ids=lambda row: row.case)
def test_every_error_is_in_the_docs(row: Row) -> None:
    """In the lines of its case; those of hand-overs are called by tracker and form."""
    case = row.case.replace(", hands over: ", ": ")
    lines = [line for line in SAID.splitlines() if re.match(rf"\| {re.escape(case)} +\|", line)]
    assert any(f" {with_interval(row.ours)} " in line for line in lines), with_interval(row.ours)


def test_the_command_is_that_of_the_results_and_every_part_is_there() -> None:
    assert f"\n{' '.join(RESULTS['command'])}\n" in SAID
    assert RESULTS["command"][-2:] == ["--runs", str(RESULTS["runs"])]
    assert [heading for heading, _ in PARTS if f"\n### {heading}\n" not in SAID] == []
