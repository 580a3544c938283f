"""A video file of frames: H.264 in an MP4 file, as browsers play it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import av
from PIL import Image

QUALITY: Final = 80
"""Of JPEG files, of 100."""
_CODING: Final = {"preset": "veryfast", "crf": "24", "threads": "1"}
_FILE: Final = {"movflags": "faststart", "fflags": "bitexact"}


class Video:
    """Frames of one size that follow each other at a fixed rate, written as they come."""

    def __init__(self, container: Any, rate: Fraction) -> None:
        self._container, self._rate = container, rate
        self._stream: Any = None

    def add(self, image: Image.Image) -> None:
        """Add a frame."""
        if self._stream is None:
            self._stream = self._container.add_stream("libx264", rate=self._rate, options=dict(_CODING))
            self._stream.width, self._stream.height = image.size
            self._stream.pix_fmt = "yuv420p"
        frame: Any = av.VideoFrame
        self._container.mux(self._stream.encode(frame.from_image(image)))

    def end(self) -> None:
        """All frames are there."""
        if self._stream is not None:
            self._container.mux(self._stream.encode(None))


@contextmanager
def writing(file: Path, rate: Fraction) -> Iterator[Video]:
    """Write a video to a file, of so many frames a second; there is none unless all goes well."""
    part = file.with_name(f".{file.name}.part")
    try:
        with av.open(str(part), "w", format="mp4", options=dict(_FILE)) as container:
            video = Video(container, rate)
            yield video
            video.end()
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)


def jpeg(image: Image.Image) -> bytes:
    """A frame as a JPEG file."""
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return file.getvalue()
