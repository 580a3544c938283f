"""What users see of a field of containers in a browser: a run that goes on, and one that is over."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from launcher.timeline import look
from launcher.timeline.view import free_port
from tests.browser import page, shows, with_browser
from tests.containers import SCENARIO, Field, image, output
from tests.running import PATIENCE_S, until

__all__ = ["image"]

pytestmark = [pytest.mark.engine, pytest.mark.timeout(900)]

SENT, DELIVERED = look.SERIES["bytes"][1]
WORK = {look.CENTRE: 100, look.STATE_COLOURS["reporting"]: 50, DELIVERED: 50}
"""Pixels of the fusion centre, of sensors that report, and of the plot of bytes."""
WHOLE = WORK | {look.INFO: 1000, DELIVERED: 200}
"""Of messages, and of a curve of bytes that goes to the end, once all is loaded."""


@pytest.fixture
def field(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Field]:
    page, data = free_port(), free_port()
    one = Field(image, tmp_path_factory.mktemp("runs"), SCENARIO)
    one.environment |= {"TRACKFIELD_PAGE": str(page), "TRACKFIELD_DATA": str(data)}
    one.environment["TRACKFIELD_RUN"] += f" --live-at viewer:{data}"
    try:
        yield one
    finally:
        one.down()


def address(field: Field) -> str:
    """Where the newest viewer says that it is."""

    def said() -> list[str]:
        [viewer] = field.hosts("viewer")
        return re.findall(r"The viewer is at (http://\S+)", output("sh", "-c", f"docker logs {viewer} 2>&1"))

    until(lambda: bool(said()), PATIENCE_S)
    return said()[-1]


@with_browser
def test_the_viewer_shows_a_run_that_goes_on_and_one_that_is_over(field: Field, tmp_path: Path) -> None:
    field.up(viewer=1, node=25, fusion=1)
    [viewer] = field.hosts("viewer")
    published = json.loads(output("docker", "inspect", "--format", "{{json .NetworkSettings.Ports}}", viewer))
    assert {one["HostIp"] for some in published.values() for one in some} == {"127.0.0.1"}
    field.launch()
    field.until(5)
    with page(address(field)) as shown:
        shows(shown, WORK, tmp_path / "live.png")
    assert field.finish() == 0, field.said()
    shown_then = {"TRACKFIELD_SHOW": "latest"}
    output(*field.compose, "up", "--detach", "viewer", **field.environment | shown_then)
    with page(address(field)) as shown:
        assert shown.title() == "Rerun Viewer"
        shows(shown, WHOLE, tmp_path / "finished.png")
