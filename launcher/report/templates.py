"""The templates of all pages, and pictures that are embedded in a page."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


def templates(*packages: str) -> Environment:
    """The templates of reports (``base.html.j2``, ``macros.html.j2``), those of other packages first."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=ChoiceLoader([PackageLoader(package, ".") for package in (*packages, __package__)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def inline(png: bytes) -> str:
    """A picture as a data URL, so that a page needs no other file."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
