"""Whatever befalls the field itself, nothing that its own processes send is taken for a stranger's."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.running import both_ways

FIELD = ("spcpf", "--nodes", "6", "--set", "target.steps=12", "--tracker", "imm-ukf", "--quiet")
LORA = ("link.radio=lora868", "link.queue=4")

CASES = {
    "frames under way at the end": LORA,
    "frames that wait for their radio at the end": (*LORA, "link.sf=12"),
    "killed with frames under way": (*LORA, "link.sf=12", "faults=[{kind='kill', nodes=['n001', 'n002'], at_s=9}]"),
    "restarted with frames under way": (*LORA, "faults=[{kind='restart', nodes=['n001'], at_s=5.3, until_s=8}]"),
    "a centre whose clock is ahead": ("faults=[{kind='clock_jump', role='fusion', at_s=6, jump_ms=60000}]",),
    "everybody is killed": ("faults=[{kind='kill', role='node', at_s=8}, {kind='kill', role='fusion', at_s=9}]",),
}


LONG = ("frames under way at the end", "killed with frames under way", "restarted with frames under way")


@pytest.mark.parametrize("case", [pytest.param(c, marks=pytest.mark.long) if c in LONG else c for c in CASES])
def test_a_run_of_its_own_processes_is_not_interfered_with(case: str, tmp_path: Path) -> None:
    settings = [word for setting in CASES[case] for word in ("--set", setting)]
    home = both_ways(tmp_path, *FIELD, *settings)
    virtual, processes = (pq.read_table(home / way / "messages.parquet") for way in ("virtual", "processes"))
    assert processes.equals(virtual)
    metrics = json.loads((home / "processes" / "metrics.json").read_text())
    assert not any(metrics["interference"].values())
    assert metrics["frames"]["refused"] == {}
    assert metrics["complete"]
