"""What docs/papers-zhou.md says of the runs through roles is in ``results.json`` beside it."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import pytest

from launcher.reproduce.intervals import Interval
from launcher.reproduce.papers.zhou.roles import ROLES, WHOLE
from launcher.reproduce.papers.zhou.whole_claims import JUDGES
from launcher.reproduce.papers.zhou.whole_tables import TITLES, network
from launcher.reproduce.tables import READING, Claim, Row, claims_table, rows_table

DOCS: Final = Path(__file__).parents[1] / "docs"
SAID: Final = (DOCS / "papers-zhou.md").read_text()
RESULTS: Final[dict[str, Any]] = json.loads((DOCS / "papers-zhou" / "results.json").read_text())
INTERVALS: Final = frozenset(field.name for field in fields(Row) if "Interval" in str(field.type))


def rows(table: str) -> list[Row]:
    found = list[Row]()
    for row in RESULTS["tables"][table]:
        values: dict[str, Any] = {name: Interval(*it) if it and name in INTERVALS else it for name, it in row.items()}
        found.append(Row(**values))
    return found


def test_claims_and_verdicts_are_those_of_the_results() -> None:
    found = [Claim(**claim) for claim in RESULTS["claims"]]
    assert len(found) == len(JUDGES)
    assert f"{READING}\n\n{claims_table(found)}" in SAID


@pytest.mark.parametrize("name", TITLES)
def test_tables_are_those_of_the_results(name: str) -> None:
    text = network(rows(name), RESULTS["runs"]) if name.endswith("network") else rows_table(rows(name))
    assert f"### {TITLES[name]}\n\n{text}\n" in SAID


def test_every_experiment_is_in_the_table_of_the_network() -> None:
    assert {f"{row.case}{ROLES}" for row in rows("roles, network")} == set(WHOLE)


def test_the_command_is_that_of_the_results() -> None:
    assert f"\n{' '.join(RESULTS['command'])}\n" in SAID
    assert RESULTS["command"][-2:] == ["--runs", str(RESULTS["runs"])]
