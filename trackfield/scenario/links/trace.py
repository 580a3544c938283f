"""The link model ``trace``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, WithJsonSchema

from trackfield.scenario.links.link import Attempts, RadioSection
from trackfield.scenario.quantities import Instant
from trackfield.scenario.section import FileName, Id, Word, wrong
from trackfield.words import quoted

_NODES: Final = 'a table of ids and nodes of the recording, like { fusion = "17", n000 = "3" }'
_MOST: Final = 10_000


def _pairs(value: Any) -> Any:
    """A scenario is hashable, so a table is kept as its pairs; a node may be a whole number."""
    if not isinstance(value, Mapping):
        raise wrong(f"is {quoted(value)}", _NODES)
    return tuple((id, str(node) if type(node) is int else node) for id, node in sorted(value.items()))


def _different(pairs: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    """Raise an error if two processes would be the same node, between which nothing was measured."""
    if twice := [node for node, count in Counter(node for _, node in pairs).items() if count > 1]:
        raise wrong(f"gives node {quoted(twice[0])} to several processes", "another node for each")
    return pairs


Nodes = Annotated[
    tuple[tuple[Id, Word], ...],
    Field(max_length=_MOST),
    BeforeValidator(_pairs),
    AfterValidator(_different),
    PlainSerializer(dict),
    WithJsonSchema({"type": "object", "additionalProperties": {"type": "string", "maxLength": 100}}),
]


class Trace(RadioSection):
    """A measured link, replayed: frames, or delivery ratios under an 802.15.4 radio.

    All keys but ``file`` are for files of delivery ratios; what a radio has does not matter to a trace of frames.
    """

    model: Literal["trace"] = Field(default="trace", description="a measured link, replayed")
    file: FileName = Field(
        description="CSV file (src,dst,t_s,received,delay_ms), or delivery ratios in k7 form, relative to the "
        "scenario's own folder; may be packed with gzip"
    )
    only_channel: int | None = Field(
        default=None,
        ge=0,
        le=1000,
        description="the recorded channel that counts, of a k7 file; unset: their mean",
    )
    start_s: Instant = Field(default=0.0, description="where in the recording of a k7 file the run starts")
    nodes: Nodes | None = Field(
        default=None,
        json_schema_extra={"expected": _NODES},
        description="the nodes of a k7 file that the processes are, others have no links; unset: those of the same "
        "id, the others in the order of the file",
    )
    ack: Attempts = Field(
        default=0,
        description="with a k7 file: most transmissions until acknowledged; 0: sent once, not acknowledged",
    )
