"""Sound files: whatever their rate, depth and channels, read piece by piece as samples at ``RATE``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from stat import S_ISREG
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from trackfield.acoustics.recordings import FULL_SCALE
from trackfield.acoustics.signals import RATE
from trackfield.errors import ScenarioError
from trackfield.filters.types import Array

_PIECE_S: Final = 0.5
_RATES_HZ: Final = (1_000, 1_000_000)
SHORTEST_S: Final = 2.0
"""Of a pass, a second before its peak is heard and one after it."""
_EXPECTED: Final = "a sound file, like a WAV file of 8 to 32 bits with one or more channels"


def blocks(file: Path, key: str = "") -> Iterator[Array]:
    """A sound file at ``RATE``, the mean of its channels, full scale being 1, in pieces of about half a second.

    Raises ``ScenarioError``, with this ``key``, for a file that cannot be read, is none, is shorter than 2 s or holds
    what is no number.
    """
    return (piece.mean(axis=1) for piece in _pieces(file, key))


def _pieces(file: Path, key: str) -> Iterator[Array]:
    """The same with its channels: pieces (n, channels)."""
    import soundfile
    import soxr

    try:
        # by its descriptor: from a name that ends in .raw, soundfile would take it to have no header
        with _regular(file).open("rb") as stream, soundfile.SoundFile(stream.fileno(), closefd=False) as sound:
            _check(sound, file, key)
            resampler = soxr.ResampleStream(sound.samplerate, RATE, sound.channels, "float64")
            done = 0
            for piece in sound.blocks(round(_PIECE_S * sound.samplerate), dtype="float64", always_2d=True):
                _check_numbers(piece, done / sound.samplerate, file, key)
                done += len(piece)
                yield np.asarray(resampler.resample_chunk(piece))
            if done < SHORTEST_S * sound.samplerate:
                raise _short(done / sound.samplerate, file, key)
            yield np.asarray(resampler.resample_chunk(np.zeros((0, sound.channels)), last=True))
    except OSError as error:
        what = f"cannot be read ({error.strerror or error})"
        raise ScenarioError(what, file=str(file), key=key, expected=_EXPECTED) from None
    except soundfile.SoundFileError as error:
        what = "is empty" if file.stat().st_size == 0 else f"is no sound file ({_reason(error)})"
        raise ScenarioError(what, file=str(file), key=key, expected=_EXPECTED) from None


def channels(file: Path, longest_s: float, key: str = "") -> npt.NDArray[np.int16]:
    """(channels, n) a sound file of at most so many seconds at ``RATE``, in 16 bits, channel by channel.

    Raises ``ScenarioError`` as ``blocks`` does, and if it is longer.
    """
    kept, count = list[Array](), 0
    for piece in _pieces(file, key):
        kept.append(piece)
        count += len(piece)
        if count > longest_s * RATE:
            what = f"is longer than {longest_s:g} s"
            raise ScenarioError(what, file=str(file), key=key, expected="a shorter recording")
    whole = np.rint(np.concatenate(kept) * FULL_SCALE)
    return np.clip(whole, -FULL_SCALE, FULL_SCALE - 1.0).astype(np.int16).T


def _regular(file: Path) -> Path:
    """The file. Raises ``OSError`` if it is none, such as a folder, or a device that never ends."""
    try:
        mode = file.stat().st_mode
    except ValueError as error:  # a NUL in its name
        raise OSError(str(error)) from None
    if not S_ISREG(mode):
        raise OSError("not a regular file")
    return file


def _check(sound: Any, file: Path, key: str) -> None:
    """Raise ``ScenarioError`` for a header that no recording has."""
    low, high = _RATES_HZ
    if not low <= sound.samplerate <= high:
        what = f"has {sound.samplerate} samples a second"
        raise ScenarioError(what, file=str(file), key=key, expected=f"from {low} to {high}")
    if 0 <= sound.frames < SHORTEST_S * sound.samplerate:
        raise _short(sound.frames / sound.samplerate, file, key)


def _short(seconds: float, file: Path, key: str) -> ScenarioError:
    return ScenarioError(
        f"has {seconds:.3g} s of sound", file=str(file), key=key, expected=f"at least {SHORTEST_S:g} s"
    )


def _check_numbers(samples: Array, from_s: float, file: Path, key: str) -> None:
    """Raise ``ScenarioError`` if one of them is none."""
    if not np.isfinite(samples).all():
        what = f"holds a sample within half a second after {from_s:g} s that is no finite number"
        raise ScenarioError(what, file=str(file), key=key, expected="numbers, 1 being full scale")


def _reason(error: Exception) -> str:
    """What libsndfile says, without the name of the file."""
    said = str(getattr(error, "error_string", "") or error)
    return said.rstrip(".")
