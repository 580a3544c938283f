"""What all tests share: the skip policy, hypothesis without a clock, and where real recordings are."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any, Final, TypeVar

import hypothesis
import pytest

pytest_plugins = ["pytester"]

Report = TypeVar("Report", pytest.TestReport, pytest.CollectReport)

STRICT: Final = "TRACKFIELD_STRICT_SKIPS"
"""Set to 1 (as .ci/run does), a skip for any reason but the allowed ones is a failure."""

ALLOWED_SKIPS: Final = {
    "no container engine": "an engine needs rights that not every machine gives; where one is, its tests run",
    "no time namespaces": "another clock needs root and a kernel that has it; the arithmetic is tested without",
    "no Chromium": "a browser is large; where one is, it opens what users open",
    "no peer": "others' filters, with which the benchmark compares, are installed by make bench alone",
    "no small disk": "to mount one takes rights that not every machine gives; where they are, it is filled",
    "no data file": "recordings of real vehicles and sounds are not ours to put into the repository",
}
"""How the reason of an allowed skip begins, and why it is allowed."""

DATA: Final = Path(__file__).parents[2] / "shared" / "data"

hypothesis.settings.register_profile("trackfield", deadline=None)  # a busy machine is no defect
hypothesis.settings.load_profile("trackfield")

sys.dont_write_bytecode = False  # hundreds of processes start in the tests: none compiles what another has compiled
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

SKETCH: Final = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b55"
    "0000000a49444154789c63f80f0001010100b138f6140000000049454e44ae426082"
)
"""A picture of one pixel."""


@pytest.fixture(scope="module", autouse=True)
def _sketched(request: pytest.FixtureRequest) -> Iterator[Any]:
    """Figures are made, but not rendered, which takes longer than a short run; but in modules marked ``rendered``."""
    from matplotlib.figure import Figure

    savefig = Figure.savefig
    with pytest.MonkeyPatch.context() as patch:
        if request.node.get_closest_marker("rendered") is None:
            patch.setattr(Figure, "savefig", _sketch)
        yield savefig


@pytest.fixture(scope="module", autouse=True)
def _outlived() -> Iterator[None]:
    """A run that a failed test left behind ends with its module: it would disturb others."""
    from tests.running import STARTED

    yield
    while STARTED:
        run = STARTED.pop()
        run.kill()
        run.wait()


@pytest.fixture(autouse=True)
def _rendered(request: pytest.FixtureRequest, _sketched: Any) -> Iterator[None]:
    """In a test marked ``rendered``, what it draws itself is rendered, too."""
    with pytest.MonkeyPatch.context() as patch:
        if request.node.get_closest_marker("rendered") is not None:
            patch.setattr("matplotlib.figure.Figure.savefig", _sketched)
        yield


def _sketch(figure: object, where: Any, **_: object) -> None:
    if hasattr(where, "write"):
        where.write(SKETCH)
    else:
        Path(where).write_bytes(SKETCH)


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
