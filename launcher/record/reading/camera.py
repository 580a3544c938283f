"""Reads camera.json of a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

from annotated_types import Ge, Le
from pydantic import AllowInfNan, TypeAdapter, ValidationError

from launcher.files import CAMERA
from launcher.outside import Outside
from launcher.record.figures.measures import first_problem
from launcher.record.journal import METRICS
from launcher.record.outside.rows import KINDS, ROWS
from launcher.record.reading.files import A_RUN, OF_THIS, read_json, refuse
from trackfield.errors import ScenarioError
from trackfield.models.pointing import Mount
from trackfield.scenario import Site
from trackfield.scenario.sections.camera import EviD30

_Number = Annotated[float, Ge(-1e9), Le(1e9), AllowInfNan(False)]
_MOUNT: Final = TypeAdapter(dict[str, _Number])


def read_camera(folder: Path) -> Outside:
    """What was told in the run of this folder. Raises ``ScenarioError`` if the file is missing or damaged."""
    found, file = read_json(folder, CAMERA), folder / CAMERA
    if missing := [name for name in ("mount", *KINDS) if name not in found]:
        refuse(file, missing[0], "is missing", A_RUN)
    rows = {name: _rows(file, name, found[name]) for name in KINDS}
    return Outside(_mount(file, found["mount"]), **rows)


def check_camera(folder: Path, outside: Outside | None, fixes: int | None, site: Site) -> None:
    """Raise ``ScenarioError`` if what was told is not of the run of this site, which had so many ``fixes``.

    ``fixes`` and ``outside`` are None without a camera.
    """
    section = site.scenario.camera
    camera = section if isinstance(section, EviD30) else None
    if (fixes is None) != (camera is None):
        refuse(folder / METRICS, "camera", f"is {'null' if fixes is None else 'there'}", OF_THIS)
    if outside is None or camera is None:
        return
    file, mount = folder / CAMERA, outside.mount
    if (mount.x_m, mount.y_m, mount.z_m) != (camera.x_m, camera.y_m, camera.z_m):
        refuse(file, "mount", "is elsewhere", OF_THIS)
    if len(outside.aims) != fixes:
        refuse(file, "aims", f"has {len(outside.aims)} rows", f"{fixes}, as {METRICS} says")
    for name in KINDS:
        if late := [row[0] for row in getattr(outside, name) if row[0] > site.end_ns]:
            refuse(file, f"{name}.t_ns", f"is {late[0]:,}", f"{site.end_ns:,} at most: the run ended then")


def _mount(file: Path, found: Any) -> Mount:
    try:
        return Mount(**_MOUNT.validate_python(found, strict=True))
    except ValidationError as error:
        key, what = first_problem(error)
        raise ScenarioError(what, file=str(file), key=f"mount.{key}".rstrip("."), expected="numbers") from None
    except TypeError:
        refuse(file, "mount", "has other keys", ", ".join(Mount.__dataclass_fields__))


def _rows(file: Path, name: str, found: Any) -> tuple[Any, ...]:
    """The rows of one list, in the order of time."""
    if not isinstance(found, list):
        refuse(file, name, "is no list", "a list")
    fields, rows = KINDS[name]._fields, list[Any]()
    for number, one in enumerate(found):
        key = f"{name}.{number}"
        if not isinstance(one, dict) or set(fields) - set(one):
            refuse(file, key, "is no whole row", f"a table with {', '.join(fields)}")
        try:
            rows.append(ROWS[name].row([one[field] for field in fields]))
        except ValidationError as error:
            at = error.errors(include_url=False)[0]["loc"][0]
            _, what = first_problem(error)
            refuse(file, f"{key}.{fields[int(at)]}", what)
    if [row[0] for row in rows] != sorted(row[0] for row in rows):
        refuse(file, name, "is not in the order of time")
    return tuple(rows)
