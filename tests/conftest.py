"""What all tests share: the skip policy, hypothesis without a clock, and where real recordings are."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Final, TypeVar

import hypothesis
import pytest

pytest_plugins = ["pytester"]

Report = TypeVar("Report", pytest.TestReport, pytest.CollectReport)

STRICT: Final = "TRACKFIELD_STRICT_SKIPS"
"""Set to 1 (as .ci/run does), a skip for any reason but the allowed ones is a failure."""

ALLOWED_SKIPS: Final = {
    "no container engine": "an engine needs rights that not every machine gives; where one is, its tests run",
    "no Chromium": "a browser is large; where one is, it opens what users open",
    "no peer": "others' filters, with which the benchmark compares, are installed by make bench alone",
    "no small disk": "to mount one takes rights that not every machine gives; where they are, it is filled",
    "no data file": "recordings of real vehicles and sounds are not ours to put into the repository",
}
"""How the reason of an allowed skip begins, and why it is allowed."""

DATA: Final = Path(__file__).parents[2] / "shared" / "data"

hypothesis.settings.register_profile("trackfield", deadline=None)  # a busy machine is no defect
hypothesis.settings.load_profile("trackfield")


@pytest.fixture
def data_file() -> Callable[[str], Path]:
    """The path of a real recording by name; skips the test where it is missing."""

    def find(name: str) -> Path:
        if not (DATA / name).is_file():
            pytest.skip(f"no data file {name}")
        return DATA / name

    return find


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    return _strict((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    return _strict((yield))


def _strict(report: Report) -> Report:
    """Turn an unexpected skip into a failure, where that is asked for."""
    if os.environ.get(STRICT) == "1" and report.skipped and not hasattr(report, "wasxfail"):
        where = report.longrepr
        reason = str(where[2] if isinstance(where, tuple) else where).removeprefix("Skipped: ")
        if not reason.startswith(tuple(ALLOWED_SKIPS)):
            report.outcome = "failed"
            report.longrepr = f"unexpected skip: {reason}"
    return report
