"""docs/wire.md is in step with the code: its tables, and its C, which is compiled and run."""

from __future__ import annotations

import json
import re
import runpy
import shutil
import subprocess
from pathlib import Path
from typing import Any, Final

import msgpack
import pytest

from trackfield.wire import keys
from trackfield.wire.line import framed
from trackfield.wire.tables import kinds_table, vectors_tables

ROOT: Final = Path(__file__).parents[1]
DOCS: Final = (ROOT / "docs" / "wire.md").read_text()
GOLDEN: Final = ROOT / "tests" / "golden" / "wire.json"
VECTORS: Final[dict[str, Any]] = json.loads(GOLDEN.read_text())

EDGES: Final = [sign * 2**bits + d for bits in (5, 7, 8, 15, 16, 31, 32, 40) for sign in (-1, 1) for d in (-1, 0, 1)]
"""Where the spelling of an integer changes."""
MAIN: Final = """
#include <stdio.h>

void print(const uint8_t *data, size_t n)
{
    while (n--) printf("%02x", *data++);
    printf("\\n");
}

void print_integers(const char *payload)
{
    uint8_t data[4096];
    int64_t integers[30];
    size_t length = 0;
    unsigned byte;
    int count, i;
    for (; sscanf(payload, "%2x", &byte) == 1; payload += 2) data[length++] = (uint8_t)byte;
    count = decode_integers(integers, 30, data, length);
    printf("%d", count);
    for (i = 0; i < count; i++) printf(",%lld", (long long)integers[i]);
    printf("\\n");
}

uint8_t doa[12], request[15], envelope[24];

int main(void)
{
"""
C_ENCODERS: Final = {
    "doa": "print(doa, encode_doa(doa, {}));",
    "sync-request": "print(request, encode_sync_request(request, {}));",
}
"""What a node sends."""


def test_the_table_of_kinds() -> None:
    assert kinds_table() in DOCS, "run python -m trackfield.wire and paste its table into docs/wire.md"


def test_the_golden_vectors() -> None:
    assert vectors_tables(VECTORS) in DOCS, f"run python -m trackfield.wire {GOLDEN.relative_to(ROOT)}"


def test_the_module_prints_both(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["trackfield.wire", str(GOLDEN)])
    runpy.run_module("trackfield.wire", run_name="__main__")
    assert capsys.readouterr().out == f"{kinds_table()}\n\n{vectors_tables(VECTORS)}\n"


def test_every_control_key_is_listed() -> None:
    for key in (f"{keys.JOIN}/<id>", f"{keys.CONFIRM}/<id>", keys.START, keys.END, keys.STOP, keys.FINISH):
        assert f"`{key}`" in DOCS


def test_every_reason_of_refusal_is_listed() -> None:
    rooms = ("trackfield/wire", "trackfield/drivers", "launcher/record")
    sources = (path.read_text() for room in rooms for path in (ROOT / room).rglob("*.py"))
    raised = {reason for text in sources for reason in re.findall(r'WireError\("(\w+)"', text)}
    assert raised - {"seal", "order", "process", "line"} == set(
        re.findall(r"^\| `(\w+)` \| (?:came|has|is) ", DOCS, re.MULTILINE)
    )


def run_c(calls: list[str], folder: Path, begin: str = MAIN, number: int = 0) -> list[str]:
    """What the code of the page, the block of this number, prints when a program that begins so calls it."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    code = re.findall(r"```c\n(.*?)```", DOCS, re.DOTALL)[number]
    source, program = folder / "node.c", folder / "node"
    source.write_text(code + begin + "\n".join(calls) + "\nreturn 0;\n}\n")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    strict += ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
    subprocess.run([compiler, *strict, source, "-o", program, "-lm"], check=True)
    return subprocess.run([program], check=True, capture_output=True, text=True).stdout.split()


def only_integers(payload: str) -> bool:
    return all(type(value) is int for value in msgpack.unpackb(bytes.fromhex(payload)))


def test_the_c_code_produces_the_golden_vectors(tmp_path: Path) -> None:
    calls, expected = [], []
    for vector in VECTORS["messages"]:
        if encoder := C_ENCODERS.get(vector["kind"]):
            calls.append(encoder.format(", ".join(map(str, vector["fields"].values()))))
            expected.append(vector["hex"])
    assert len(expected) == 9
    calls.append("print(doa, encode_doa(doa, 60, 359.996, 71.24));")
    expected.append("9501013c00cd1bd4")
    for vector in (v for v in VECTORS["envelopes"] if "version" not in v["fields"]):  # a device sends what is final
        numbers = ", ".join(f"{value}u" if value < 2**32 else f"{value}" for value in vector["fields"].values())
        calls.append(f"encode_envelope(envelope, {numbers}); print(envelope, sizeof envelope);")
        expected.append(vector["hex"])
    for length, back in ((0, 1), (1, 0), (12, 0)):
        calls.append(f'printf("%d\\n", taken_back({length}));')
        expected.append(str(back))
    calls += [f"print(request, encode_sync_request(request, 0, {n}));" for n in EDGES]
    expected += [msgpack.packb([1, 2, 0, n]).hex() for n in EDGES]
    assert run_c(calls, tmp_path) == expected


def test_the_c_code_reads_the_golden_vectors(tmp_path: Path) -> None:
    """Integers as they are; -1 for what is no array of them. The rest of what is wrong is for a device to check."""
    sound = [v["hex"] for name in ("messages", "spellings") for v in VECTORS[name]]
    taken = [payload for payload in sound if only_integers(payload)]
    taken += [
        v["hex"]
        for v in VECTORS["refused"]
        if v["reason"] in ("range", "version", "kind", "fields") and only_integers(v["hex"])
    ]
    taken += [msgpack.packb([1, 2, 0, n]).hex() for n in EDGES]
    refused = [v["hex"] for v in VECTORS["refused"] if v["reason"] in ("type", "malformed") and v["hex"] != "9101"]
    refused += [payload for payload in sound if not only_integers(payload)]
    refused += [
        msgpack.packb([1, 2, 0, 2**63]).hex(),
        "",
        "dc001f" + "00" * 31,
        "dc00",
        "9101cd00",
        "92",
        "92cd00",
        "92cd",
    ]
    refused += [good[: 2 * n] for good in taken for n in range(len(good) // 2)]
    printed = run_c([f'print_integers("{payload}");' for payload in (*taken, *refused)], tmp_path)
    for payload, line in zip(taken, printed, strict=False):
        integers = msgpack.unpackb(bytes.fromhex(payload))
        assert line == ",".join(map(str, [len(integers), *integers])), payload
    assert set(printed[len(taken) :]) == {"-1"}
    assert len(printed) == len(taken) + len(refused)


LINES: Final = """
#include <stdio.h>

void print(const uint8_t *data, int n)
{
    if (n < 0) printf("damaged");
    if (n == 0) printf("nothing");
    while (n-- > 0) printf("%02x", *data++);
    printf("\\n");
}

int main(void)
{
static uint8_t line[1200];
"""


def c_array(data: bytes) -> str:
    return f'(const uint8_t *)"{"".join(f"{chr(92)}x{byte:02x}" for byte in data)}", {len(data)}'


def test_the_c_code_writes_and_reads_lines(tmp_path: Path) -> None:
    """Of golden messages, and of payloads with and without zeros at the length of a block."""
    payloads = [data for v in VECTORS["messages"] if len(data := bytes.fromhex(v["hex"])) <= 1000]
    payloads += [bytes([byte]) * size for byte in (0, 7) for size in (0, 1, 251, 252, 253, 254, 255, 507, 1000)]
    lines = [framed(payload) for payload in payloads]
    damaged = [
        line[:at] + bytes([line[at] ^ 8]) + line[at + 1 : -1] for line in lines[:20] for at in range(len(line) - 1)
    ]
    damaged += [b"", b"\x01", b"\x05abc", b"\xff" + bytes(300)]
    calls = [f"print(line, (int)encode_line(line, {c_array(payload)}));" for payload in payloads]
    for data in [line[:-1] for line in lines] + damaged:
        calls.append(f"memcpy(line, {c_array(data)}); print(line, decode_line(line, {len(data)}));")
    printed = run_c(calls, tmp_path, "#include <string.h>\n" + LINES, 1)
    assert printed[: len(lines)] == [line.hex() for line in lines]
    assert printed[len(lines) : 2 * len(lines)] == [payload.hex() or "nothing" for payload in payloads]
    assert set(printed[2 * len(lines) :]) == {"damaged"}
