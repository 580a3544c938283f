"""The report in a real browser that no network is there for."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from launcher import report
from tests.reporting import troubled

__all__ = ["troubled"]

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

pytestmark = [
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium (apt install chromium)"),
    pytest.mark.rendered,
]


@pytest.mark.parametrize("width", [1280, 500, 390])
def test_a_page_opens_offline_on_a_screen_of_any_width(troubled: Path, tmp_path: Path, width: int) -> None:
    """Nothing is asked of anybody, nothing complained of, every figure is there, and nothing hangs over the edge."""
    file, asked, complaints = (troubled / report.PAGE).resolve().as_uri(), list[str](), list[str]()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            page = browser.new_context(offline=True, viewport={"width": width, "height": 900}).new_page()
            page.on("request", lambda request: asked.append(request.url))
            page.on("console", lambda message: complaints.append(message.text))
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.goto(file)
            page.screenshot(path=tmp_path / f"report-{width}.png", full_page=True)
            sizes = page.eval_on_selector_all("img", "all => all.map(one => [one.naturalWidth, one.clientWidth])")
            edges = page.eval_on_selector_all(
                "img, h1, h2, h3, p, dd, li, code, summary, table",
                """all => all.filter(one => !one.closest('.scroll, pre') || one.tagName == 'IMG')
                          .map(one => [one.tagName, one.getBoundingClientRect().right])""",
            )
            scrolled = page.eval_on_selector_all(
                ".scroll", "all => all.map(one => [one.scrollWidth - one.clientWidth, getComputedStyle(one).overflowX])"
            )
            wide = page.evaluate("document.documentElement.scrollWidth")
            title = page.title()
        finally:
            browser.close()
    assert [url for url in asked if not url.startswith("data:")] == [file]
    assert complaints == []
    assert len(sizes) == 5
    assert all(natural > 1000 and shown > 300 for natural, shown in sizes)
    assert wide <= width
    assert [edge for edge in edges if edge[1] > width] == []
    assert all(beyond <= 0 or overflow == "auto" for beyond, overflow in scrolled)
    assert title == "zhai-spcpf, seed 1 – Trackfield report"
