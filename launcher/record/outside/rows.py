"""What the rows of camera.json may hold, whoever told or wrote them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Final, Literal, get_type_hints

from annotated_types import Ge, Le, MaxLen
from pydantic import AllowInfNan, TypeAdapter

from launcher.outside import ANSWERS, OUTCOMES, STATES, Aim, Counts, Exposure, Known, Ordered, Refusal, Turn

MAX_NS: Final = 2**62
_Ns = Annotated[int, Ge(-MAX_NS), Le(MAX_NS)]
_When = Annotated[int, Ge(0), Le(MAX_NS)]
_Whole = Annotated[int, Ge(0), Le(2**31 - 1)]
_Text = Annotated[str, MaxLen(200)]
_Angle = Annotated[float, Ge(-360.0), Le(360.0), AllowInfNan(False)]
_Speed = Annotated[float, Ge(0.0), Le(1e6), AllowInfNan(False)]
_Place = Annotated[float, Ge(-1e9), Le(1e9), AllowInfNan(False)]
_Seconds = Annotated[float, Ge(-1e9), Le(1e9), AllowInfNan(False)]
_FIELDS: Final[dict[str, Any]] = {
    **dict.fromkeys(("pan0", "tilt0", "pan1", "tilt1", "pan_deg", "tilt_deg"), _Angle),
    **dict.fromkeys(("pan_deg_s", "tilt_deg_s"), _Speed),
    **dict.fromkeys(("aim_x_m", "aim_y_m"), _Place),
    **dict.fromkeys(("cpa_ns", "aim_ns"), _Ns),
    **{"t_ns": _When, "delay_s": _Seconds},
}
_WORDS: Final[dict[tuple[type, str], Any]] = {
    (Aim, "outcome"): Literal.__getitem__(OUTCOMES),
    (Known, "state"): Literal.__getitem__(STATES),
    (Ordered, "answer"): Literal.__getitem__(ANSWERS),
}
KINDS: Final[dict[str, Any]] = {
    "turns": Turn,
    "aims": Aim,
    "exposures": Exposure,
    "counts": Counts,
    "states": Known,
    "orders": Ordered,
    "refusals": Refusal,
}
"""The lists of an ``Outside`` by their names, and the named tuples in them."""


class Rows:
    """Parses rows of one kind, each by its fields in their order."""

    def __init__(self, kind: Any) -> None:
        self.kind, hints = kind, get_type_hints(kind)
        plain = {int: _Whole, str: _Text}
        types = [_WORDS.get((kind, one)) or _FIELDS.get(one) or plain[hints[one]] for one in kind._fields]
        together: Any = tuple.__class_getitem__(tuple(types))
        self._adapter = TypeAdapter[tuple[Any, ...]](together)

    def row(self, values: Sequence[Any]) -> Any:
        """The row of these values; more than its fields are left out. Raises ``ValidationError``."""
        return self.kind(*self._adapter.validate_python(tuple(values)[: len(self.kind._fields)], strict=True))


ROWS: Final = {name: Rows(kind) for name, kind in KINDS.items()}
