"""What is done before nodes are forked is what a node does: else each of them would do it for the first time."""

from __future__ import annotations

from launcher.processes.preload import REHEARSAL
from trackfield.plugins import load


def test_the_node_that_is_rehearsed_reports_in_each_step() -> None:
    assert load(REHEARSAL)() == 3
