"""Samples as a WAV file, for players."""

from __future__ import annotations

import io
import wave
from typing import Final

import numpy as np

from launcher.heard import Array

FULL: Final = 32767
LOUDEST: Final = 0.9
"""The highest amplitude, of the highest that a file can have."""


def wav(samples: Array, rate: int) -> bytes:
    """Mono, 16 bits, as loud as can be."""
    most = float(np.abs(samples).max(initial=0.0)) or 1.0
    whole = np.rint(samples / most * LOUDEST * FULL).astype("<i2")
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        writer.setnchannels(1)
        writer.setsampwidth(2)
        writer.setframerate(rate)
        writer.writeframes(whole.tobytes())
    return file.getvalue()
