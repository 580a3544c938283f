"""Nodes that hear targets pass, and their base, start by hand, as in containers."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import tomlkit

from tests.cpa_fields import SMALL
from tests.outside import Start, router, start
from tests.running import Run, until

__all__ = ["router", "start"]


def test_each_of_them_is_a_program(router: str, start: Start, tmp_path: Path) -> None:
    field = tmp_path / "field.toml"
    field.write_text(tomlkit.dumps(SMALL))
    run = Run(
        tmp_path / "run", str(field), "--set", "target.steps=32", "--speed", "2", "--external", "--connect", router
    )
    until(lambda: "1 of 7 ready" in run.said())
    start("fusion", "sink")
    for _ in range(5):
        start("head", "ear")
    code, ended = run.finish()
    assert code == 0, ended
    rows = pq.read_table(run.folder / "tracks.parquet").to_pylist()
    assert any(row["source"] == "base" and row["x"] is not None for row in rows)
    assert any(row["source"] != "base" and row["event_ns"] is not None and not row["refused"] for row in rows)
    assert run.metrics()["frames"]["by_role"].keys() >= {"ear", "hearing"}
