"""The house's plan beyond the contracts of import-linter: no circles of imports, no folder too full to look through.

Import-linter's own contract against circles compares siblings only, never two packages of the top, and it reads the
graph of the other contracts, without the imports that are for type checkers alone. Here those count: who reads one
module of a circle has to read them all.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Final

import grimp
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOT: Final = Path(__file__).parents[1]
ROOMS: Final = ("trackfield", "node", "fusion", "head", "launcher", "bench")
FACADE: Final = "trackfield"
"""Left out: a façade of the whole house, it names what is above it for type checkers, and fetches it on first use."""
MOST_FILES: Final = 20
FOLDERS: Final = sorted({file.parent for room in ("launcher", "trackfield") for file in (ROOT / room).rglob("*.py")})
each_folder = pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: str(folder.relative_to(ROOT)))

Circle = tuple[str, ...]


def circles(imports: dict[str, set[str]]) -> list[Circle]:
    """The strongly connected components of more than one module, sorted. Only modules that are keys count."""
    names = sorted(imports)
    place = {name: i for i, name in enumerate(names)}
    edges = [(place[name], place[other]) for name in names for other in imports[name] if other in place]
    ends = np.array(edges, int).reshape(-1, 2).T
    matrix = coo_array((np.ones(len(edges)), tuple(ends)), shape=(len(names), len(names)))
    count, labels = connected_components(matrix, connection="strong")
    parts = [tuple(names[i] for i in np.flatnonzero(labels == part)) for part in range(count)]
    return sorted(part for part in parts if len(part) > 1)


def test_circles_are_found() -> None:
    chain = {"a": {"b"}, "b": {"c"}, "c": set(), "d": {"elsewhere"}}
    assert circles(chain) == circles({}) == []
    assert circles({**chain, "c": {"a"}}) == [("a", "b", "c")]
    assert circles({**chain, "b": {"a"}, "c": {"d"}, "d": {"c"}}) == [("a", "b"), ("c", "d")]


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = grimp.build_graph(*ROOMS, exclude_type_checking_imports=False, cache_dir=None)
    found = circles({name: graph.find_modules_directly_imported_by(name) for name in graph.modules - {FACADE}})
    assert found == []


@each_folder
def test_each_folder_is_a_package_that_says_what_it_is(folder: Path) -> None:
    assert ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))


def test_no_folder_of_the_launcher_is_too_full() -> None:
    counts = {str(folder.relative_to(ROOT)): len(list(folder.glob("*.py"))) for folder in FOLDERS}
    full = {name: count for name, count in counts.items() if name.startswith("launcher") and count > MOST_FILES}
    assert full == {}, "make subpackages of the files that belong together"
