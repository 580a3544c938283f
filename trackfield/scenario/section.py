"""What all sections of a scenario file have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from typing import Annotated, Any, Final
from unicodedata import category

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from trackfield.words import quoted

OTHER: Final = "any other"
"""Stands for all kinds of a section that users add."""

_REFUSED: Final = frozenset({"Cc", "Cs"})
"""Kinds of characters that names of files must not have: controls, and halves of pairs."""

ID: Final = r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}"
"""The id of a process or a target, as ``trackfield.wire.keys.check_id`` accepts it."""
ID_WORDS: Final = "1 to 32 characters of A-Z a-z 0-9 _ . -, not beginning with . or -"

Id = Annotated[str, Field(pattern=f"^{ID}$", json_schema_extra={"expected": ID_WORDS})]


def _openable(name: str) -> str:
    """Raise an error for a name that no file can have, or that cannot be written into another file."""
    if any(category(character) in _REFUSED for character in name):
        raise wrong(f"is {quoted(name)}", "the name of a file, without control characters")
    return name


Word = Annotated[str, Field(max_length=100)]
"""A name of something that is looked up."""
FileName = Annotated[str, Field(min_length=1, max_length=4096), AfterValidator(_openable)]


class Section(BaseModel):
    """Immutable; no unknown keys, no silent conversions, no NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def one_of(kinds: Sequence[type[Section]], tag: str) -> Any:
    """The type of a section that has these kinds, selected by its key ``tag``."""
    return Annotated[reduce(or_, kinds), Field(discriminator=tag)] if len(kinds) > 1 else kinds[0]


def open_union(kinds: Mapping[str, type[Section]], default: str) -> Any:
    """The type of a section that users add kinds to: ``kinds`` by their key ``kind``, and ``OTHER`` for all others."""

    def kind_of(section: Any) -> str:
        given = section.get("kind", default) if isinstance(section, Mapping) else getattr(section, "kind", default)
        return given if isinstance(given, str) and given in kinds else OTHER

    models = (Annotated[model, Tag(kind)] for kind, model in kinds.items())
    return Annotated[reduce(or_, models), Field(discriminator=Discriminator(kind_of))]


def wrong(what: str, expected: str, key: str = "") -> PydanticCustomError:
    """A validation error with this message; ``key`` is its place if that is not where it was found."""
    return PydanticCustomError("own", "{what}", {"what": what, "expected": expected, "key": key})
