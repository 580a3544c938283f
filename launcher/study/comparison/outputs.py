"""The files of a comparison: whether they can be written, and writing them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from launcher.files import check_writable
from launcher.record.reading.files import read_manifest
from launcher.study.comparison.exact import Exactness
from launcher.study.comparison.runs import Compared
from trackfield.errors import ScenarioError


@dataclass(frozen=True)
class Outputs:
    """The files of the page, the table and the recording; None: not written."""

    html: Path | None = None
    csv: Path | None = None
    rrd: Path | None = None

    def check(self, compared: Compared) -> None:
        """Raise ``ScenarioError`` for a file that cannot be written, is named twice, or is a file of a run.

        Also for a run without the manifest that a page needs.
        """
        if self.html is not None or self.rrd is not None:
            for folder in compared.folders:
                read_manifest(folder)
        seen: dict[Path, str] = {}
        for key, file in self._named():
            whole = file.resolve()
            if (other := seen.setdefault(whole, key)) != key:
                raise ScenarioError(f"{other} names the same file", file=str(file), key=key, expected="another file")
            if whole.exists() and any(whole.is_relative_to(folder.resolve()) for folder in compared.folders):
                expected = "a new file, or one outside the run folders"
                raise ScenarioError("is a file of a run", file=str(file), key=key, expected=expected)
            check_writable(file, key)

    def write(self, compared: Compared, exact: Exactness | None) -> Iterator[str]:
        """Write them, over existing files; yields what was written, in words."""
        if self.html is not None:
            from launcher.study.comparison.page import as_page

            yield _written("page", self.html, as_page(compared, exact).encode())
        if self.csv is not None:
            from launcher.study.comparison.data import as_csv

            yield _written("table", self.csv, as_csv(compared).encode())
        if self.rrd is not None:
            from launcher.study.comparison.lines import MOST_RUNS
            from launcher.study.comparison.recording import write_recording

            write_recording(compared, self.rrd)
            yield f"recording: {self.rrd}"
            if left_out := compared.names[MOST_RUNS:]:
                yield f"note: the recording has the first {MOST_RUNS} runs, without {', '.join(left_out)}"

    def _named(self) -> Iterator[tuple[str, Path]]:
        named = (("--html", self.html), ("--csv", self.csv), ("--rrd", self.rrd))
        return ((key, file) for key, file in named if file is not None)


def _written(what: str, file: Path, content: bytes) -> str:
    file.write_bytes(content)
    return f"{what}: {file}"
