"""Masters, slaves and the base of a field start by hand, as in containers: each by the program of its role."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq

from tests.outside import Start, router, start
from tests.running import Run, until

__all__ = ["router", "start"]

MASTERS, SLAVES = 2, 5
FIELD = f"""
name = "by-hand"
seed = 1
[field]
layout = "random"
nodes = {SLAVES}
spacing_m = 100.0
[sensor]
kind = "range"
range_m = 800.0
[target]
path = "drifting"
start_m = [110.0, 110.0]
half_width_m = 110.0
speed_m_s = 2.0
step_s = 1.0
steps = 8
[link]
model = "fixed"
delay_ms = 20.0
[architecture]
kind = "clusters"
masters = {MASTERS}
[fusion]
trackers = ["ukf"]
prior = "paper"
prior_sd = [1.0, 1.0, 0.5, 0.5]
deadline_s = 0.4
"""


def test_each_role_has_its_program(router: str, start: Start, tmp_path: Path) -> None:
    field = tmp_path / "field.toml"
    field.write_text(FIELD)
    run = Run(tmp_path / "run", str(field), "--external", "--connect", router)
    until(lambda: f"1 of {2 + MASTERS + SLAVES} ready" in run.said())
    start("fusion", "base")
    for _ in range(MASTERS):
        start("head")
    for _ in range(SLAVES):
        start("node", "slave")
    code, ended = run.finish()
    assert code == 0, ended
    found = pq.read_table(run.folder / "tracks.parquet").to_pylist()
    assert any(row["source"] == "base" and row["x"] is not None for row in found)
    led = [row for row in found if row["source"] != "base" and row["reports"]]
    assert {row["source"] for row in led} <= {"m0", "m1"}
    assert len({row["step"] for row in led}) >= 6
    assert run.metrics()["clusters"]["orphans_last"] == 0
