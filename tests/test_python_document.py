"""docs/python.md: its blocks run, one after the other, and print what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.python_document import updated

DOCUMENT = Path(__file__).parents[1] / "docs" / "python.md"


@pytest.mark.rendered
def test_the_blocks_print_what_the_document_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("launcher.run._report", lambda *_: "")  # reports have tests of their own
    text = DOCUMENT.read_text()
    assert updated(text) == text  # if it is right: python -m tests.python_document docs/python.md
    assert (tmp_path / "errors.png").stat().st_size > 10_000


def test_a_block_that_prints_something_else_is_found() -> None:
    assert updated("```python\nprint(1 + 1)\n```\n\n```text\n3\n```\n").endswith("```text\n2\n```\n")
    with pytest.raises(AssertionError, match="block 1 prints"):
        updated("```python\nprint(1)\n```\n")
