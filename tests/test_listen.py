"""``trackfield listen``: the passes of a recording, or one message that says why it cannot be heard."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

from launcher.listening import passes
from launcher.listening.passes import listen
from tests.command_line import Call, trackfield
from tests.sounds import no_pass, passing
from trackfield.acoustics.signals import RATE
from trackfield.filters.types import Array

__all__ = ["trackfield"]

PASS, PEAK_S = passing(7, 6.0, 14.0, 15.0, peak_s=5.0)


def write(file: Path, samples: Array, rate: int = RATE, subtype: str = "PCM_16", channels: int = 1) -> Path:
    """A pass or another sound, at 0.8 of full scale, held to a higher rate."""
    held = np.repeat(0.8 * samples / max(np.abs(samples).max(), 1e-9), rate // RATE)
    soundfile.write(file, np.column_stack([held] * channels), rate, subtype=subtype)
    return file


def test_a_pass_is_a_line(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("listen", write(tmp_path / "a.wav", PASS))
    assert (said.code, said.err) == (0, "")
    (line,) = said.out.splitlines()
    assert line.startswith("pass at 5.0")
    assert "width 0.4" in line


@pytest.mark.parametrize(
    ("rate", "subtype", "channels"),
    [(4_000, "PCM_U8", 1), (48_000, "PCM_16", 2), (96_000, "PCM_24", 1), (8_000, "FLOAT", 5)],
)
def test_any_rate_depth_and_channels(trackfield: Call, tmp_path: Path, rate: int, subtype: str, channels: int) -> None:
    said = trackfield("listen", write(tmp_path / "a.wav", PASS, rate, subtype, channels), "--json")
    found = json.loads(said.out)
    (one,) = found["passes"]
    assert found["seconds"] == pytest.approx(10.0, abs=0.01)
    assert one["peak_s"] == pytest.approx(PEAK_S, abs=0.05)
    assert one["width_s"] == pytest.approx(6.0 / 14.0, rel=0.15)
    assert 0.9 < one["confidence"] <= 1.0
    assert 1.0 <= one["known_s"] - one["peak_s"] <= 1.2


def test_a_file_is_judged_by_its_content_whatever_its_name(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(write(tmp_path / "a.wav", PASS).read_bytes())
    assert trackfield("listen", "a.raw").out == trackfield("listen", "a.wav").out
    (tmp_path / "b.raw").write_bytes(PASS.tobytes())
    assert "b.raw: FILE.wav: is no sound file (" in trackfield("listen", "b.raw").err


@pytest.mark.parametrize("detector", ["argmax", "smooth", "fit"])
def test_each_detector_by_its_name(trackfield: Call, tmp_path: Path, detector: str) -> None:
    said = trackfield("listen", write(tmp_path / "a.wav", PASS), "--detector", detector, "--json")
    (one,) = json.loads(said.out)["passes"]
    assert one["peak_s"] == pytest.approx(PEAK_S, abs=0.5)


@pytest.mark.parametrize("name", ["silence", "wind", "slams", "ends_before"])
def test_no_pass_is_said(trackfield: Call, tmp_path: Path, name: str) -> None:
    said = trackfield("listen", write(tmp_path / "a.wav", no_pass(name, 3)))
    assert said.code == 0
    assert said.out.startswith("no pass in ")


def test_a_picture_shows_everything_once_and_when_it_was(tmp_path: Path) -> None:
    """The end of the file brings less than a look; a click at 4 s is outlined then."""
    samples = np.zeros(round(10.02 * 44_100))
    samples[4 * 44_100] = 0.9
    soundfile.write(tmp_path / "click.wav", samples, 44_100)
    heard = listen(tmp_path / "click.wav", "fit", "")
    for times in (heard.t_s, heard.outline_s):
        assert np.diff(times) == pytest.approx(0.02)
        assert times[-1] == pytest.approx(10.0, abs=0.15)
    assert heard.outline_s[np.argmax(heard.high)] == pytest.approx(4.0, abs=0.0101)
    assert heard.t_s[np.argmax(heard.energies)] == pytest.approx(4.0, abs=0.0101)


def test_each_pass_has_its_own_curve_whatever_the_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = np.concatenate((PASS, PASS))
    monkeypatch.setattr(passes, "blocks", lambda file, key: iter([whole]))
    found = listen(Path("both.wav"), "fit", "").passes
    assert [one.detection.peak_s for one in found] == pytest.approx([PEAK_S, PEAK_S + 10.0], abs=0.05)
    assert [one.curve.peak_s for one in found] == [one.detection.peak_s for one in found]


@pytest.mark.rendered
def test_a_picture_of_it(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("listen", write(tmp_path / "a.wav", PASS), "--png", "heard.png")
    assert (said.code, said.err) == (0, "wrote heard.png\n")
    picture = (tmp_path / "heard.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 20_000


def not_numbers(file: Path) -> None:
    samples = PASS.copy()
    samples[9_000] = np.nan
    soundfile.write(file, samples, RATE, subtype="FLOAT")


def no_channels(file: Path) -> None:
    soundfile.write(file, PASS, RATE, subtype="PCM_16")
    content = bytearray(file.read_bytes())
    content[22:24] = struct.pack("<H", 0)
    file.write_bytes(content)


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "empty": (lambda file: file.write_bytes(b""), "is empty; expected a sound file"),
    "text": (lambda file: file.write_text("no sound " * 100), "is no sound file ("),
    "header": (lambda file: file.write_bytes(b"RIFF\x24\0\0\0WAVEfmt "), "is no sound file ("),
    "nan": (not_numbers, "no finite number; expected numbers"),
    "channels": (no_channels, "is no sound file ("),
    "short": (lambda file: soundfile.write(file, PASS[:4_000], RATE), "has 1 s of sound; expected at least 2 s"),
    "nothing": (lambda file: soundfile.write(file, PASS[:0], RATE), "has 0 s of sound; expected at least 2 s"),
    "slow": (lambda file: soundfile.write(file, PASS, 100), "has 100 samples a second; expected from 1000"),
    "folder": (lambda file: file.mkdir(), "cannot be read (not a regular file)"),
    "missing": (lambda file: None, "cannot be read (No such file or directory)"),
}


@pytest.mark.parametrize("what", tuple(BAD))
def test_what_cannot_be_heard_is_told_in_one_message(trackfield: Call, tmp_path: Path, what: str) -> None:
    make, message = BAD[what]
    make(tmp_path / "bad.wav")
    said = trackfield("listen", "bad.wav")
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("trackfield: bad.wav: FILE.wav: ")
    assert message in said.err
    assert "; expected " in said.err
    assert said.err.count("\n") == 1


def test_options_that_cannot_be_are_told(trackfield: Call, tmp_path: Path) -> None:
    file = write(tmp_path / "a.wav", PASS)
    for options, message in (
        (("--detector", "fitt"), "--detector: unknown detector 'fitt'; did you mean fit?; expected one of argmax"),
        (("--png", "a.jpg"), "a.jpg: --png: is no PNG file; expected a name that ends in .png"),
        (("--png", "no/a.png"), "no/a.png: --png: cannot be written (No such file or directory)"),
    ):
        said = trackfield("listen", file, *options)
        assert (said.code, said.out) == (2, "")
        assert message in said.err
    assert {one.name for one in tmp_path.iterdir()} == {"a.wav"}


@pytest.mark.parametrize(
    ("name", "peak_s"), [("car_20mph_2.5m_15C.wav", 4.56), ("car_28mph.wav", 2.68)], ids=["20 mph", "28 mph"]
)
def test_a_real_car_passes_once(trackfield: Call, data_file: Callable[[str], Path], name: str, peak_s: float) -> None:
    (one,) = json.loads(trackfield("listen", data_file(name), "--json").out)["passes"]
    assert one["peak_s"] == pytest.approx(peak_s, abs=0.15)
