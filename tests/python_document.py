"""The Python blocks of a document, run in order: ``python -m tests.python_document docs/python.md`` prints them anew.

All blocks share one namespace. A ``text`` block right after a ``python`` block is what that printed.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

BLOCK = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```text\n(?P<text>.*?)```\n)?", re.DOTALL)


def updated(document: str) -> str:
    """The document with what its blocks print now, in the working directory."""
    names: dict[str, Any] = {"__name__": "document"}
    number = 0

    def run(block: re.Match[str]) -> str:
        nonlocal number
        number += 1
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(block["code"], f"block {number}", "exec"), names)
        code = f"```python\n{block['code']}```\n"
        if block["text"] is None:
            assert not said.getvalue(), f"block {number} prints, and nothing below it says what"
            return code
        return f"{code}\n```text\n{said.getvalue()}```\n"

    return BLOCK.sub(run, document)


if __name__ == "__main__":
    file = Path(sys.argv[1]).absolute()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        file.write_text(updated(file.read_text()))
