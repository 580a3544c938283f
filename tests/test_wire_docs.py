"""docs/wire.md is in step with the code: its tables, and its C, which is compiled and run."""

from __future__ import annotations

import json
import re
import runpy
import shutil
import subprocess
from pathlib import Path
from typing import Any, Final

import pytest

from trackfield.wire import keys
from trackfield.wire.tables import kinds_table, vectors_tables

ROOT: Final = Path(__file__).parents[1]
DOCS: Final = (ROOT / "docs" / "wire.md").read_text()
GOLDEN: Final = ROOT / "tests" / "golden" / "wire.json"
VECTORS: Final[dict[str, Any]] = json.loads(GOLDEN.read_text())

MAIN: Final = """
#include <stdio.h>

static void print(const uint8_t *data, size_t n)
{
    while (n--) printf("%02x", *data++);
    printf("\\n");
}

int main(void)
{
    uint8_t doa[12], envelope[24];
"""


def test_the_table_of_kinds() -> None:
    assert kinds_table() in DOCS, "run python -m trackfield.wire and paste its table into docs/wire.md"


def test_the_golden_vectors() -> None:
    assert vectors_tables(VECTORS) in DOCS, f"run python -m trackfield.wire {GOLDEN.relative_to(ROOT)}"


def test_the_module_prints_both(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["trackfield.wire", str(GOLDEN)])
    runpy.run_module("trackfield.wire", run_name="__main__")
    assert capsys.readouterr().out == f"{kinds_table()}\n\n{vectors_tables(VECTORS)}\n"


def test_every_control_key_is_listed() -> None:
    for key in (keys.JOIN, keys.START, keys.END, keys.STOP, keys.FINISH):
        assert f"`{key}`" in DOCS


def test_every_reason_of_refusal_is_listed() -> None:
    sources = (path.read_text() for path in (ROOT / "trackfield" / "wire").glob("*.py"))
    raised = {reason for text in sources for reason in re.findall(r'WireError\("(\w+)"', text)}
    assert raised == set(re.findall(r"^\| `(\w+)` \| (?:came|has|is) ", DOCS, re.MULTILINE))


def test_the_c_code_produces_the_golden_vectors(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    code = re.search(r"```c\n(.*?)```", DOCS, re.DOTALL)
    assert code
    calls, expected = [], []
    for vector in VECTORS["messages"]:
        step, bearing, level = vector["fields"].values()
        calls.append(f"print(doa, encode_doa(doa, {step}, {bearing}, {level}));")
        expected.append(vector["hex"])
    calls.append("print(doa, encode_doa(doa, 60, 359.996, 71.24));")
    expected.append("9501013c00cd1bd4")
    for vector in VECTORS["envelopes"]:
        numbers = ", ".join(f"{value}u" if value < 2**32 else f"{value}" for value in vector["fields"].values())
        calls.append(f"encode_envelope(envelope, {numbers}); print(envelope, sizeof envelope);")
        expected.append(vector["hex"])
    source, program = tmp_path / "node.c", tmp_path / "node"
    source.write_text(code[1] + MAIN + "\n".join(calls) + "\nreturn 0;\n}\n")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([compiler, *strict, source, "-o", program, "-lm"], check=True)
    printed = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert printed.split() == expected
