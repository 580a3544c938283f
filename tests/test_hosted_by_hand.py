"""A process of several roles that starts by hand, as one in a container does."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.outside import OPTIONS, Start, process, router, start
from tests.running import Run, until

__all__ = ["router", "start"]

ALONE = "trackfield.drivers.standalone"
HEAD = ("head", "tally=tests.pairs:Tally", "node=node.role:Node", "fusion=fusion.role:Fusion")
"""In another order than the architecture has them."""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with the architecture, in the Python of the launcher."""
    info = tmp_path / "packages" / "paired-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: paired\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[trackfield.architectures]\npaired = tests.pairs:Paired\n")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(info.parent), os.environ.get("PYTHONPATH", "")]))


def test_its_roles_are_named_on_its_command_line(router: str, start: Start, tmp_path: Path, installed: None) -> None:
    run = Run(tmp_path / "run", *OPTIONS, "--set", "architecture.kind=paired", "--connect", router)
    until(lambda: "1 of 6 ready" in run.said())
    said = tmp_path / "wrong"
    with process(ALONE, *HEAD[:-1], "--connect", router, said=said) as wrong:
        assert wrong.wait(30) == 1
    why = "what the launcher tells makes no head here (ValueError: its roles are tally, node, not node, fusion, tally)"
    assert why in said.read_text()
    assert "Traceback" not in said.read_text()
    start(ALONE, *HEAD)
    start(ALONE, "herald", "tests.strangers:Herald")
    for _ in range(3):
        start("node")
    code, ended = run.finish()
    assert code == 0, ended
    roles = run.metrics()["frames"]["by_role"]
    messages = pq.read_table(run.folder / "messages.parquet").to_pylist()
    hellos = [row["outcome"] for row in messages if row["kind"] == "hello"]
    assert roles["tally"] == {"delivered": hellos.count("delivered") + 2, "ignored": 2}
    assert hellos.count("ignored") == 2
    assert roles["fusion"]["delivered"] > 0
    assert {row["source"] for row in pq.read_table(run.folder / "tracks.parquet").to_pylist()} == {"n002"}


def test_without_its_head_a_run_waits(router: str, start: Start, tmp_path: Path, installed: None) -> None:
    """A process with the right roles, but of another name, is not its head."""
    run = Run(tmp_path / "run", *OPTIONS, "--set", "architecture.kind=paired", "--connect", router)
    until(lambda: "1 of 6 ready" in run.said())
    said = tmp_path / "wrong"
    with process(ALONE, "heat", *HEAD[1:], "--connect", router, said=said) as wrong:
        assert wrong.wait(30) == 1
    assert "no process of this run has the role 'heat'" in said.read_text()
    run.process.send_signal(signal.SIGINT)
    run.finish()
