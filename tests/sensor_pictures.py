"""The pictures of each kind of sensing in docs/scenarios.md: ``python -m tests.sensor_pictures docs`` makes them."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from PIL import Image

import trackfield as tf
from launcher.timeline.view import picture

KINDS: Final = ("range", "rss", "energy")
AT_S: Final = 54.0
FIELD: Final = (2, 68, 664, 522)
"""The view of the field in a picture of the timeline: left, top, right, bottom."""


def main(folder: Path) -> None:
    """Write ``sensor-KIND.png`` for each kind: the bus of ``bus`` as it turns."""
    for kind in KINDS:
        settings = {"sensor.kind": kind, "fusion.trackers": ["imm-ukf"]}
        with TemporaryDirectory() as home:
            result = tf.run(tf.Scenario.load("bus", settings), out=Path(home) / "run")
            whole = Path(home) / "whole.png"
            picture(result.path, whole, AT_S)
            with Image.open(whole) as shown:
                shown.convert("RGB").crop(FIELD).quantize(200).save(folder / f"sensor-{kind}.png", optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
