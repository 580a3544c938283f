"""Whatever is in a file that a user names: it is read, or refused by errors that say the file, soon."""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from launcher.plan.prepare import prepare
from tests.command_line import Call, trackfield
from tests.test_extremes import bounded
from trackfield.errors import ScenarioError
from trackfield.files import DATA
from trackfield.scenario.toml import MOST_BYTES

__all__ = ["trackfield"]

TOML = b'name = "odd"\nseed = 3\n\n[target]\npath = "s1"\nsteps = 4\n\n'
TOML += b'[[faults]]\nkind = "kill"\nnodes = ["n001"]\nat_s = 2\n'
GPX = (
    b'<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.1"><trk><trkseg>\n'
    + b"".join(
        b'<trkpt lat="45.%04d" lon="-30.0"><time>2025-03-03T08:00:%02dZ</time></trkpt>\n' % (second, second)
        for second in range(12)
    )
    + b"</trkseg></trk></gpx>\n"
)
CSV = b"t_s,x,y\n0,10,10\n1,20,20\n2,30,35\n6,60,60\n"
FIELD = b"id,x,y,role\na,10,10,node\nb,40,40,\nfusion,20,20,fusion\n"
LINK = b"src,dst,t_s,received,delay_ms\nn000,fusion,0,1,2.5\nn001,fusion,0,0,0\n"
SEEDS = range(120)


def used(kind: str, file: Path) -> None:
    """Plan a scenario that uses this file. Raises ``ScenarioError``."""
    with bounded():
        match kind:
            case "toml":
                prepare(str(file))
            case "gpx" | "csv":
                prepare("bus", target=file)
            case "field":
                prepare("zhai-spcpf", sensors=file)
            case "link":
                prepare("zhai-spcpf", settings=[f"link.file='{file}'"])


SOUND = {"toml": TOML, "gpx": GPX, "csv": CSV, "field": FIELD, "link": LINK}
NAMES = {"toml": "odd.toml", "gpx": "odd.gpx", "csv": "odd.csv", "field": "field.csv", "link": "link.csv"}
SPICE = (
    *(b"\0", b"\xff", b"\xef\xbb\xbf", b"\r", b"\r\n", b"\n", b'"', b"'", b",", b";", b"\t", b"<", b"&", b"]]>", b"-"),
    *(b"nan", b"inf", b"1e309", b"5e-324", b"1e308", b"-0", b"9" * 400, b"0x" + b"f" * 4300, b"9" * 5000, b"[" * 3000),
    *(b"<!DOCTYPE a>", b"<!--", b"&lt;", b"\x1b[31m", "٣".encode(), b"+99:99", b"0001", b"9999", b"T24:00:00"),
    b"x" * 10_000,
)  # fmt: skip


def spiced(content: bytes, draw: random.Random) -> bytes:
    """The content with a few bytes cut out, repeated or put in."""
    for _ in range(draw.randint(1, 3)):
        a, b = sorted(draw.randrange(len(content) + 1) for _ in range(2))
        match draw.randrange(4):
            case 0:
                content = content[:a] + content[min(b, a + 20) :]
            case 1:
                content = content[:b] + content[a:]
            case _:
                content = content[:a] + draw.choice(SPICE) + content[min(b, a + draw.randrange(4)) :]
    return content


@pytest.mark.parametrize("kind", SOUND)
def test_a_sound_file_is_used_with_any_line_ends_and_a_mark_of_its_encoding(tmp_path: Path, kind: str) -> None:
    for content in (SOUND[kind], b"\xef\xbb\xbf" + SOUND[kind], SOUND[kind].replace(b"\n", b"\r\n")):
        file = tmp_path / NAMES[kind]
        file.write_bytes(content)
        used(kind, file)


@pytest.mark.parametrize("kind", SOUND)
def test_a_spiced_file_is_used_or_refused(tmp_path: Path, kind: str) -> None:
    file = tmp_path / NAMES[kind]
    for seed in SEEDS:
        file.write_bytes(spiced(SOUND[kind], random.Random(f"{kind}{seed}")))
        try:
            used(kind, file)
        except ScenarioError as error:
            said = str(error)
            assert all(character.isprintable() or character == "\n" for character in said), (seed, said)
            assert all(len(line) < 1000 for line in said.split("\n")), (seed, said)


def fifo(file: Path) -> Path:
    os.mkfifo(file)
    return file


def folder(file: Path) -> Path:
    file.mkdir()
    return file


def endless(file: Path) -> Path:
    file.symlink_to("/dev/zero")
    return file


def huge(file: Path) -> Path:
    with file.open("wb") as stream:
        stream.truncate(max(DATA, MOST_BYTES) + 1)  # takes no room
    return file


@pytest.mark.parametrize("kind", SOUND)
@pytest.mark.parametrize(
    ("make", "why"),
    [
        (fifo, "not a regular file"),
        (folder, "Is a directory"),
        (endless, "not a regular file"),
        (huge, "it has more than "),
    ],
)
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, kind: str, make: Callable[[Path], Path], why: str) -> None:
    file = make(tmp_path / NAMES[kind])
    with pytest.raises(ScenarioError) as caught:
        used(kind, file)
    assert f"{file}: cannot be read ({why}" in str(caught.value)


def test_a_user_sees_one_message(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "deep.toml").write_bytes(TOML + b"[x]\ny = " + b"[" * 3000 + b"]" * 3000 + b"\n")
    (tmp_path / "keys.toml").write_bytes(b"".join(b"key%d = 1\n" % number for number in range(16_000)) + TOML)
    (tmp_path / "colour.toml").write_bytes(TOML.replace(b"seed", b'"se\\u001b[31med"'))
    (tmp_path / "long.toml").write_bytes(TOML.replace(b"seed = 3", b"seed = 0x" + b"f" * 4300))
    for name, lines, part in (
        ("deep.toml", 1, "deep.toml: not a TOML file (values more than 16 deep)"),
        ("keys.toml", 21, "... and 15980 more errors"),
        ("colour.toml", 1, "se\\x1b[31med: unknown"),
        ("long.toml", 1, "long.toml: seed: is a whole number of 17200 bits; expected a number of at most 38 digits"),
        ("/dev/zero", 1, "/dev/zero: cannot be read (not a regular file)"),
    ):
        said = trackfield("validate", name)
        assert (said.code, said.out, said.err.count("\n")) == (2, "", lines), said.err
        assert part in said.err
