"""The timeline in a real browser, without a screen: what a page shows, by the colours of its pixels."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
with_browser = pytest.mark.skipif(not CHROMIUM, reason="no Chromium (apt install chromium)")

FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",  # no graphics card is needed
    "--use-gl=angle",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # no other machine is there
)
PATIENCE_S = 120.0
NEAR = 16
"""How much a channel of a colour may be off, by blending with what is behind."""


@contextmanager
def page(address: str) -> Iterator[Page]:
    """The page at this address, opened and closed with the block; a small one, as software draws it."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            opened = browser.new_page(viewport={"width": 1280, "height": 720})
            opened.set_default_timeout(PATIENCE_S * 1000)
            opened.goto(f"{address}&renderer=webgl")
            yield opened
        finally:
            browser.close()


def shows(page: Page, wanted: Mapping[int, int], keep: Path) -> bytes:
    """A screenshot with at least so many pixels of each colour (0xRRGGBBAA), also kept as a file; waits for it."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        shot = page.screenshot()
        keep.write_bytes(shot)
        found = {colour: count(shot, colour) for colour in wanted}
        if all(found[colour] >= pixels for colour, pixels in wanted.items()):
            return shot
        assert time.monotonic() < deadline, f"{keep}: { ({f'{c:08x}': n for c, n in found.items()}) }"
        time.sleep(1)


def count(shot: bytes, colour: int) -> int:
    """How many pixels of a picture have a colour."""
    pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), int)
    red_green_blue = [colour >> shift & 0xFF for shift in (24, 16, 8)]
    return int((abs(pixels - red_green_blue) <= NEAR).all(axis=2).sum())
