"""The guests of a run as its launcher sees them."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from launcher.processes.gathering import Household


@pytest.fixture
def registry() -> Any:
    return SimpleNamespace(start_ns=None, live={"n1", "n2"})


@pytest.fixture
def household(registry: Any) -> Iterator[Household]:
    household = Household(registry, 0)
    for name in registry.live:
        household.expect(name)
    yield household
    household.close()


def test_who_goes_before_anybody_looks_is_out_of_reach(household: Household, registry: Any) -> None:
    """A launcher looks at some of them at a time, and a slice or a container may go at once after the start."""
    registry.live.discard("n1")
    assert not household.stopped("n1")
    registry.start_ns = 1
    assert household.stopped("n1")
    assert not household.stopped("n2")
    registry.live.add("n1")
    assert not household.stopped("n1")


def test_who_sent_its_final_record_is_not_out_of_reach(household: Household, registry: Any) -> None:
    registry.start_ns = 1
    household.left("n1")
    registry.live.discard("n1")
    assert not household.stopped("n1")
    assert household.gone() == [("n1", "exit code 0")]
