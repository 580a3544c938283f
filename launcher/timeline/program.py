"""Rerun's program: where it is, and with which environment it runs."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

from trackfield.errors import RunFailed


def program() -> Path:
    """Rerun's program. Raises ``RunFailed`` if it is not installed."""
    package = importlib.util.find_spec("rerun_cli")
    # The program itself, not the script of that name, so that its exit code is seen here.
    found = package and package.origin and Path(package.origin).with_name("rerun")
    if not found or not found.is_file():
        raise RunFailed(
            "Rerun's viewer is not installed; its program comes with the package rerun-sdk "
            "(pip install --force-reinstall rerun-sdk)",
            process="viewer",
        )
    return found


def environment() -> dict[str, str]:
    """The environment of Rerun's program; ``CI`` turns its analytics off."""
    return {"RUST_LOG": "warn", **os.environ, "CI": "1"}
