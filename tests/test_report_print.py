"""The report on paper: printed by a browser, all of it there, and nothing broken over pages."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from launcher import report
from launcher.report.folder import read_run
from launcher.report.parts import errors, messages
from tests.browser import CHROMIUM, with_browser
from tests.reporting import troubled

__all__ = ["troubled"]

pytestmark = [
    with_browser,
    pytest.mark.skipif(not shutil.which("pdftotext"), reason="no pdftotext (apt install poppler-utils)"),
]


@pytest.fixture(scope="module")
def pages(troubled: Path, tmp_path_factory: pytest.TempPathFactory) -> list[list[str]]:
    """The lines of each page, as they stand there."""
    file = tmp_path_factory.mktemp("paper") / "report.pdf"
    page = (troubled / report.PAGE).resolve().as_uri()
    command = [str(CHROMIUM), "--headless", "--no-sandbox", "--no-pdf-header-footer", f"--print-to-pdf={file}", page]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    said = subprocess.run(["pdftotext", "-layout", file, "-"], check=True, capture_output=True, text=True).stdout
    return [text.splitlines() for text in said.split("\f") if text.strip()]


def words(lines: list[str]) -> str:
    return " ".join(" ".join(lines).split())


def test_every_column_is_on_paper(troubled: Path, pages: list[list[str]]) -> None:
    table = errors.trackers(read_run(troubled))
    whole = words([line for page in pages for line in page])
    for row in table.rows:
        assert " ".join(row) in whole
    assert " ".join(table.head) in whole


def test_the_first_page_is_used(pages: list[list[str]]) -> None:
    """What was run, the verdicts, and the map with its caption."""
    first = words(pages[0])
    for said in ("zhai-spcpf", "imm-ukf", "spcpf", "Track", "Sensors by the best outcome of their reports"):
        assert said in first


def test_bars_stand_together(troubled: Path, pages: list[list[str]]) -> None:
    bars = messages.fates(read_run(troubled))
    assert len(bars) > 2
    assert any(all(bar.value in words(page) for bar in bars) for page in pages)


def test_a_heading_is_on_the_page_of_what_it_heads(pages: list[list[str]]) -> None:
    for page in pages:
        last = [line.strip() for line in page if line.strip()][-1]
        assert last not in ("Track", "Error", "Consistency", "Messages", "Latency", "Energy", "Run it again")
