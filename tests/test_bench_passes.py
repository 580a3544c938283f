"""What solving for a path costs, as the benchmark tells it."""

import pytest

from bench.passes import NAMES, measured, table


def test_each_solver_has_a_row() -> None:
    rows = measured(1, many=20)
    assert [row.who for row in rows] == list(NAMES) == ["plane", "cpa", "ecpa", "ml"]
    assert rows[0].ratio == 1.0 and all(row.ms > row.many_ms > 0.0 for row in rows)
    head, line, *others = table(rows, 20)
    assert len({text.count("|") for text in (head, line, *others)}) == 1 and len(others) == 4


@pytest.mark.alone
def test_the_default_solver_takes_20_ms_at_most() -> None:
    rows = {row.who: row for row in measured(3, many=20)}
    assert rows["ml"].ms < 20.0
    assert rows["ml"].ratio < 10.0
