"""docs/deploy.md says what deploy/ and the commands have."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "deploy.md").read_text()


def test_the_variables_of_the_stack_are_explained() -> None:
    stack = (ROOT / "deploy" / "swarm.yaml").read_text()
    variables = set(re.findall(r"\$\{(\w+)", stack))
    assert variables - {"TRACKFIELD_TOKEN"} == set(re.findall(r"`(SLICES|TRACKFIELD_[A-Z]+)`", PAGE))
    assert yaml.safe_load(stack)["services"].keys() == {"launcher", "slice"}


def test_all_files_are_named() -> None:
    for file in (ROOT / "deploy").iterdir():
        assert f"`deploy/{file.name}`" in PAGE


def test_benchmarks_that_it_names_are_there() -> None:
    modules = set(re.findall(r"python -m (bench\.\w+)", PAGE))
    assert {"bench.links", "bench.upstream"} <= modules
    for module in modules:
        assert (ROOT / f"{module.replace('.', '/')}.py").is_file()
