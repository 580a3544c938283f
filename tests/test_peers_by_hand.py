"""Nodes of which any may lead, and their base, start by hand, as in containers."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq

from tests.outside import Start, router, start
from tests.peer_runs import SMALL
from tests.running import Run, until

__all__ = ["router", "start"]

NODES = 8


def test_each_of_them_is_a_program(router: str, start: Start, tmp_path: Path) -> None:
    field = tmp_path / "field.toml"
    field.write_text(SMALL.replace("nodes = 24", f"nodes = {NODES}").replace("steps = 40", "steps = 8"))
    run = Run(tmp_path / "run", str(field), "--external", "--connect", router)
    until(lambda: f"1 of {2 + NODES} ready" in run.said())
    start("fusion", "base")
    for _ in range(NODES):
        start("head", "peer")
    code, ended = run.finish()
    assert code == 0, ended
    found = pq.read_table(run.folder / "tracks.parquet").to_pylist()
    assert any(row["source"] == "base" and row["x"] is not None for row in found)
    assert len({row["step"] for row in found if row["source"] != "base" and row["reports"]}) >= 5
    assert run.metrics()["frames"]["by_role"].keys() >= {"member", "header"}
