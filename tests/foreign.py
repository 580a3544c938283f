"""Runs with processes that are no part of Trackfield: the examples of docs/foreign.md, as they are printed."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import pytest

from tests.running import PATIENCE_S, Run, until
from trackfield.drivers.exchange.seal import TOKEN

DOCS: Final = (Path(__file__).parents[1] / "docs" / "foreign.md").read_text()
EXAMPLES: Final = dict(re.findall(r"`(\w+\.py)`.*?```python\n(.*?)```", DOCS, re.DOTALL))


@pytest.fixture
def examples(tmp_path: Path) -> Path:
    """A folder with the examples."""
    folder = tmp_path / "examples"
    folder.mkdir()
    for name, code in EXAMPLES.items():
        (folder / name).write_text(code)
    return folder


def free_endpoint(protocol: str = "tcp") -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"{protocol}/127.0.0.1:{probe.getsockname()[1]}"


@contextmanager
def waiting(folder: Path, ids: Sequence[str], *arguments: str) -> Iterator[tuple[Run, Path]]:
    """A run that waits for these processes and has started all others, and a file of settings for a client of its."""
    endpoint, named = free_endpoint(), ",".join(map(repr, ids))
    run = Run(folder, *arguments, "--set", f"run.external=[{named}]", "--listen", endpoint)
    try:
        gathered(run, ids)
        yield run, client(folder.with_suffix(".json5"), endpoint, run.manifest()["run"])
    finally:
        run.process.kill()
        run.process.wait()


@contextmanager
def secured(folder: Path, ids: Sequence[str], *arguments: str) -> Iterator[tuple[Run, Callable[[str], Path]]]:
    """The same with certificates, and what makes a file of settings for a client with the certificate of this name."""
    endpoint, named, certificates = free_endpoint("tls"), ",".join(map(repr, ids)), folder.with_suffix(".certificates")
    secure = ("--secure", "--certificates", str(certificates))
    run = Run(folder, *arguments, *secure, "--set", f"run.external=[{named}]", "--listen", endpoint)

    def settings(name: str) -> Path:
        own = {
            part: str(certificates / f"{name}.{end}") for part, end in (("certificate", "pem"), ("private_key", "key"))
        }
        authority = {"enable_mtls": True, "root_ca_certificate": str(certificates / "authority.pem")}
        tls = {**authority, **{f"connect_{part}": file for part, file in own.items()}}
        more = {"transport": {"link": {"tls": tls}}}
        told = json.loads((certificates / "run.json").read_text())
        return client(folder.with_suffix(f".{name}.json5"), endpoint, told["run"], more)

    try:
        gathered(run, ids)
        yield run, settings
    finally:
        run.process.kill()
        run.process.wait()


def gathered(run: Run, ids: Sequence[str]) -> None:
    """Wait until none but these are missing."""
    until(lambda: f"missing {', '.join(ids)}\n" in run.said() or run.process.poll() is not None)
    assert run.process.poll() is None, run.said()


def client(file: Path, endpoint: str, run: str, more: Mapping[str, Any] | None = None) -> Path:
    """A file with the settings of a client."""
    plain = {"mode": "client", "connect": {"endpoints": [endpoint]}, "namespace": run, **(more or {})}
    file.write_text(json.dumps(plain))
    return file


def started(examples: Path, program: str, settings: Path, id: str, token: str | None = None) -> subprocess.Popen[str]:
    """One of the examples takes the place of a process."""
    environment = {key: text for key, text in os.environ.items() if key not in ("PYTHONPATH", TOKEN)}
    environment |= {} if token is None else {TOKEN: token}
    return subprocess.Popen(
        [sys.executable, program, str(settings), id], cwd=examples, env=environment, stderr=subprocess.PIPE, text=True
    )


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """The exit code of an example, and what it said."""
    try:
        _, said = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    return process.returncode, said


@cache
def loaded(name: str) -> dict[str, Any]:
    """What an example defines."""
    found: dict[str, Any] = {"__name__": name.removesuffix(".py")}
    for other in EXAMPLES.keys() - {name}:
        if f"from {other.removesuffix('.py')} import" in EXAMPLES[name]:
            module = ModuleType(other.removesuffix(".py"))
            module.__dict__.update(loaded(other))
            sys.modules[module.__name__] = module
    exec(compile(EXAMPLES[name], name, "exec"), found)
    return found
