"""Message kinds: what a field of a message may hold and how it becomes an integer, declared once per field.

A kind is a frozen dataclass of ``Annotated[int, Scaled(...)]``, ``Annotated[float, Scaled(...)]`` and
``Annotated[bytes, Blob(...)]`` fields, registered under a number and a name by ``@kind``. Codec and table in
docs/wire.md are both made from that. The last field may be a ``tuple`` of numbers, at least one:
``tuple[Annotated[int, Scaled(...)], ...]``.
"""

from __future__ import annotations

import builtins
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeVar, get_args, get_origin, get_type_hints

from trackfield.wire.error import WireError
from trackfield.wire.keys import check_id

MAX_FIELDS: Final = 27
"""A message of this many fields, each at MessagePack's longest integer (9 bytes), stays within ``PLAIN_BYTES``."""
PLAIN_BYTES: Final = 256
"""The longest payload of a kind that has numbers only. One with bytes may be longer by as much as they are."""
MAX_BYTES: Final = 4096
"""The longest payload of any kind, also of one that a process does not know; a longer one is refused unread."""

OWN_KINDS: Final = 128
"""Kind numbers from here to 255 are for kinds registered outside of Trackfield."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Scaled:
    """A number that travels as the integer nearest to value / resolution.

    ``resolution`` is 1/n for an integer n. ``cyclic`` (an angle): the step after ``high`` is ``low`` again.
    """

    low: float
    high: float
    resolution: float = 1
    unit: str = ""
    cyclic: bool = False


@dataclass(frozen=True, slots=True)
class Blob:
    """Bytes that travel as they are, at most so many; ``unit`` says what they are."""

    most: int
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Bytes:
    """A field of a kind that holds bytes."""

    name: str
    blob: Blob
    many: bool = False

    def pack(self, value: object) -> bytes:
        """``value`` if the field can hold it; raises ``WireError`` (``type``, ``range``)."""
        if type(value) is not bytes:
            raise WireError("type", f"{self.name}: {type(value).__name__}")
        if len(value) > self.blob.most:
            raise WireError("range", f"{self.name}: {len(value)} bytes, at most {self.blob.most}")
        return value

    unpack = pack

    def longest(self) -> bytes:
        """A value that is as long as any."""
        return bytes(self.blob.most)


@dataclass(frozen=True, slots=True)
class Number:
    """A field of a kind, with its bounds in steps of the resolution; ``many`` numbers, or one."""

    name: str
    integral: bool
    scaled: Scaled
    per_unit: int
    first: int
    last: int
    many: bool = False

    @classmethod
    def of(cls, name: str, hint: object) -> Number:
        """The field of numbers that a type hint declares; raises ``TypeError`` for one that cannot be encoded."""
        many = get_origin(hint) is tuple and get_args(hint)[1:] == (...,)
        one = get_args(hint)[0] if many else hint
        number, *extras = get_args(one) if get_origin(one) is Annotated else (one,)
        if number not in (int, float) or len(extras) != 1 or not isinstance(extras[0], Scaled):
            expected = "Annotated[int, Scaled(...)], Annotated[float, Scaled(...)] or Annotated[bytes, Blob(...)]"
            raise TypeError(f"{name}: expected {expected}")
        scaled = extras[0]
        per_unit = round(1 / scaled.resolution)
        if abs(per_unit * scaled.resolution - 1) > 1e-9 or (number is int and per_unit != 1):
            raise TypeError(f"{name}: the resolution must be 1/n (1 for an int), not {scaled.resolution}")
        first, last = round(scaled.low * per_unit), round(scaled.high * per_unit)
        if not -(2**63) <= first < last < 2**63:
            raise TypeError(f"{name}: the range {scaled.low}..{scaled.high} is empty or beyond 64 bits")
        return cls(name, number is int, scaled, per_unit, first, last, many)

    def pack(self, value: object) -> int:
        """The integer that stands for ``value``; raises ``WireError`` (``type``, ``range``)."""
        if isinstance(value, bool) or not isinstance(value, int if self.integral else int | float):
            raise WireError("type", f"{self.name}: {type(value).__name__}")
        steps = value * self.per_unit
        if not self.first - 2 <= steps <= self.last + 2:  # also fails for NaN and infinity, which cannot be rounded
            raise WireError("range", f"{self.name}: not in {self.scaled.low}..{self.scaled.high}")
        number = round(steps)
        if self.scaled.cyclic and number == self.last + 1:
            number = self.first
        return self._within(number)

    def unpack(self, number: object) -> int | float:
        """The value that the integer ``number`` stands for; raises ``WireError`` (``type``, ``range``)."""
        if type(number) is not int:
            raise WireError("type", f"{self.name}: {type(number).__name__}")
        self._within(number)
        return number if self.integral else number / self.per_unit

    def longest(self) -> int:
        """A number that is about as long as any."""
        return max((self.first, self.last), key=abs)

    def _within(self, number: int) -> int:
        if not self.first <= number <= self.last:
            raise WireError("range", f"{self.name}: {number} not in {self.first}..{self.last}")
        return number


Field = Number | Bytes


def field_of(name: str, hint: object) -> Field:
    """The field that a type hint declares; raises ``TypeError`` for one that cannot be encoded."""
    match get_args(hint) if get_origin(hint) is Annotated else ():
        case (builtins.bytes, Blob() as blob):
            if not 1 <= blob.most <= MAX_BYTES - PLAIN_BYTES:
                raise TypeError(f"{name}: at most {blob.most} bytes; expected 1 to {MAX_BYTES - PLAIN_BYTES}")
            return Bytes(name, blob)
    return Number.of(name, hint)


@dataclass(frozen=True, slots=True)
class Kind:
    """A registered message kind; ``fields`` in the order in which they travel.

    One that is ``bare`` has one field, of bytes. On a serial line these bytes travel alone, without any frame: it is
    the protocol of a device that knows none.
    """

    number: int
    name: str
    cls: type
    fields: tuple[Field, ...]
    bare: bool = False

    @property
    def most_bytes(self) -> int:
        """The longest payload."""
        return PLAIN_BYTES + sum(field.blob.most for field in self.fields if isinstance(field, Bytes))

    def pack(self, message: object) -> list[int | bytes]:
        """The values of a message, in order; raises ``WireError`` (``type``, ``range``, ``fields``)."""
        packed: list[int | bytes] = []
        for field in self.fields:
            value = getattr(message, field.name)
            packed += map(field.pack, value) if field.many else (field.pack(value),)
        self._check(len(packed))
        return packed

    def unpack(self, numbers: Sequence[object]) -> Any:
        """The message of these values; raises ``WireError`` (``type``, ``range``, ``fields``)."""
        self._check(len(numbers))
        if not self.fields or not self.fields[-1].many:
            return self.cls(*(field.unpack(n) for field, n in zip(self.fields, numbers, strict=True)))
        *single, last = self.fields
        first = [field.unpack(n) for field, n in zip(single, numbers, strict=False)]
        return self.cls(*first, tuple(last.unpack(n) for n in numbers[len(single) :]))

    def longest(self) -> Any:
        """A message that is about as long as any of this kind; of a tuple one number."""
        return self.unpack([field.longest() for field in self.fields])

    def _check(self, count: int) -> None:
        least = len(self.fields)
        if self.fields and self.fields[-1].many:
            if not least <= count <= MAX_FIELDS:
                raise WireError("fields", f"{self.name} has {least} to {MAX_FIELDS}, not {count}")
        elif count != least:
            raise WireError("fields", f"{self.name} has {least}, not {count}")


_by_number: dict[int, Kind] = {}
_by_name: dict[str, Kind] = {}
_by_class: dict[type, Kind] = {}
_most_bytes: dict[str, int] = {}


def kind(number: int, name: str, *, bare: bool = False) -> Callable[[type[T]], type[T]]:
    """Register a frozen dataclass as the message kind ``number`` (1..255, your own from 128) named ``name``.

    ``bare`` as in ``Kind``. Raises ``ValueError`` for a number or name that is taken or invalid, ``TypeError`` for a
    class whose fields cannot be encoded, or which cannot be bare.
    """
    if not 1 <= number <= 255:
        raise ValueError(f"kind number {number} is not in 1..255")
    check_id(name)

    def register(cls: type[T]) -> type[T]:
        for other in _by_number.values():
            if number == other.number or name == other.name:
                raise ValueError(f"kind {number} {name!r} collides with {other.number} {other.name!r}")
        hints = get_type_hints(cls, include_extras=True)
        members: tuple[dataclasses.Field[Any], ...] = dataclasses.fields(cls)  # type: ignore[arg-type]
        fields = tuple(field_of(member.name, hints[member.name]) for member in members)
        if any(field.many for field in fields[:-1]):
            raise TypeError(f"{name}: only the last field may be a tuple")
        if len(fields) > MAX_FIELDS:
            raise TypeError(f"{name}: {len(fields)} fields, at most {MAX_FIELDS} fit a message")
        made = Kind(number, name, cls, fields, bare)
        if bare and not (len(fields) == 1 and isinstance(fields[0], Bytes)):
            raise TypeError(f"{name}: a bare kind has one field, of bytes")
        if made.most_bytes > MAX_BYTES:
            raise TypeError(f"{name}: up to {made.most_bytes} bytes, at most {MAX_BYTES} fit a message")
        _by_number[number] = _by_name[name] = _by_class[cls] = made
        _most_bytes[name] = made.most_bytes
        return cls

    return register


def kind_of(message: object) -> Kind:
    """The kind of a message; raises ``WireError`` (``kind``) for an object that is not a message."""
    try:
        return _by_class[type(message)]
    except KeyError:
        raise WireError("kind", f"{type(message).__name__} is not a message") from None


def kind_of_class(cls: type) -> Kind:
    """The kind of messages of this class; raises ``KeyError`` for any other class."""
    return _by_class[cls]


def known_class(cls: type) -> bool:
    """Whether messages are of this class."""
    return cls in _by_class


def kind_by_number(number: object) -> Kind:
    """The kind registered under a number; raises ``WireError`` (``type``, ``kind``)."""
    if type(number) is not int:
        raise WireError("type", f"kind: {type(number).__name__}")
    try:
        return _by_number[number]
    except KeyError:
        raise WireError("kind", str(number)) from None


def check_size(name: str, size: int) -> None:
    """Raise ``WireError`` (``size``) for a payload that is too long for the kind of this name."""
    most = _most_bytes.get(name, MAX_BYTES)
    if size > most:
        raise WireError("size", f"{size} bytes of {name}, at most {most}")


def kinds() -> list[Kind]:
    """All kinds that were registered, by number."""
    return [_by_number[number] for number in sorted(_by_number)]


def product_kinds() -> list[Kind]:
    """Trackfield's own kinds, by number."""
    return [one for one in kinds() if one.number < OWN_KINDS]
