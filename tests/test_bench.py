"""What a run costs, as the benchmark tells it: the smallest field under each driver."""

from __future__ import annotations

from itertools import pairwise
from math import dist

import pytest

from bench import hearing, latency, ready, recorder, start
from bench.processes import GROUPS
from bench.scale import PROCESS_COLUMNS, VIRTUAL_COLUMNS, Column, measured, table
from bench.virtual import SPEED_M_S, route, scenario


def cells(columns: tuple[Column, ...], text: str) -> dict[str, str]:
    """The one row of a table in Markdown, by the heads of its columns."""
    head, line, row = ([cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines())
    assert head == [name for name, _ in columns]
    assert len(set(head)) == len(head)
    assert line == ["---:"] * len(columns)
    return dict(zip(head, row, strict=True))


def test_a_run_in_virtual_time() -> None:
    figures = measured("bench.virtual", nodes=100, link="ideal", seconds=60)
    row = cells(tuple(VIRTUAL_COLUMNS), table(VIRTUAL_COLUMNS, [figures]))
    assert (row["nodes"], row["link"], row["emulated s"]) == ("100", "ideal", "61")
    assert len(row["RSS MB at 25 / 50 / 75 / 100 %"].split(" / ")) == 4
    # At each step the target is in somebody's reach; each that starts, hears or fuses handles an event.
    assert figures["frames"]["delivered"] == figures["frames"]["sent"] >= 60
    assert figures["events"] > 101 + figures["frames"]["sent"]
    assert max(figures["rss_mb"]) <= figures["peak_mb"]


def test_a_run_as_processes() -> None:
    figures = measured("bench.processes", nodes=4, steps=6, seconds=1)
    row = cells(tuple(PROCESS_COLUMNS), table(PROCESS_COLUMNS, [figures]))
    assert (row["nodes"], row["host_lost"], row["recorder dropped"]) == ("4", "0", "0")
    assert set(figures["shares"]) == set(GROUPS)
    assert 0.0 < sum(figures["shares"].values()) <= 1.0


@pytest.mark.long
def test_latencies_beside_bare_puts() -> None:
    found = latency.measure(0.75, seconds=11)
    assert found["run"]["frames"] > 33
    assert all(found[name]["frames"] > 4 for name in ("1", "4"))
    assert all(0.0 < found[name]["p50"] <= found[name]["p99"] for name in ("run", "1", "4"))
    head, line, row = latency.table([found]).splitlines()
    assert head.count("|") == line.count("|") == row.count("|")


def test_the_recorder_beside_a_bare_subscriber() -> None:
    found = recorder.measure(messages=2000, rate=4000)
    assert found["ratio"] == found["fast"]["per_s"] / found["bare_per_s"]
    for figures in (found["fast"], found["steady"]):
        assert figures["dropped"] == 0
        assert 0.0 < figures["per_s"] <= 2000 / figures["behind_s"]
    assert "recorder, 4,000 a second" in recorder.table(found)


def test_commands_beside_a_python_that_does_nothing() -> None:
    found = start.measure(1, {"trackfield --version": ("--version",)})
    assert list(found) == [start.NOTHING, "trackfield --version"]
    head, line, nothing, row = start.table(found).splitlines()
    assert head.count("|") == line.count("|") == row.count("|")
    assert nothing.endswith("| 1 |")
    assert found["trackfield --version"][1] > found[start.NOTHING][1] > 0.0


def test_the_start_of_processes_with_and_without_numpy() -> None:
    found = measured("bench.ready", processes=11, heavy=2)
    row = cells(tuple(ready.COLUMNS), table(ready.COLUMNS, [found]))
    assert (row["processes"], row["with numpy"]) == ("11", "2")
    assert all(cpu_s > 0.0 for cpu_s in found["cpu_s"].values())
    assert 0.0 < found["pss_mb"]["light"] < found["pss_mb"]["heavy"]


@pytest.mark.parametrize("side_m", [50.0, 450.0, 15_750.0])
def test_the_target_stays_amid_the_sensors_at_its_speed(side_m: float) -> None:
    way = route(side_m, 3600)
    assert way[0][0] == 0.0
    assert way[-1][0] == 3600.0
    assert all(0.0 <= c <= side_m for _, *point in way for c in point)
    for (t0, *here), (t1, *there) in pairwise(way):
        assert dist(here, there) == pytest.approx(SPEED_M_S * (t1 - t0))


def test_the_field_has_the_packaged_spacing() -> None:
    assert scenario(100, "ideal", 60, 1).field.spacing_m == 50.0  # type: ignore[union-attr]


def test_sound_is_made_and_heard() -> None:
    lines = hearing.table(seconds=20.0, rounds=1)
    assert len(lines) == 5
    assert "2 passes in 20 s" in lines[3]
