"""What a fix costs on its way to the camera, as the benchmark tells it."""

import pytest

from bench.camera import measured, table


def test_each_fix_has_a_way_through_three_processes() -> None:
    found = measured(3)
    assert len(found.ways) == 3
    for way in found.ways:
        assert way.head.cpu_ms > way.control.cpu_ms > 0.0
        assert way.base.cpu_ms > 0.0
        assert way.whole.wall_ms == way.head.wall_ms + way.base.wall_ms + way.control.wall_ms
    assert found.cpu_ms(50) <= found.cpu_ms(95)
    head, line, row = table(found)
    assert head.count("|") == line.count("|") == row.count("|")


@pytest.mark.alone
def test_from_report_to_command_it_takes_five_times_what_the_solvers_take_at_most() -> None:
    """Of both solvers of the packaged scenario, for 19 of 20 fixes; the best of three rounds on a shared machine."""
    rounds = [measured(20) for _ in range(3)]
    assert min(found.cpu_ms(95) / found.solvers_ms for found in rounds) <= 5.0
