"""Recordings of sensors' reports, drawn by the emulator's own kinds: what is fitted to them is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Final

from trackfield.draw import uniform
from trackfield.sensing.complete import Kind
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

NS: Final = 1_000_000_000
Places = Mapping[str, tuple[float, float]]


def places_of(count: int, side_m: float, seed: int) -> dict[str, tuple[float, float]]:
    """Sensors anywhere in a square."""
    return {f"s{i}": (side_m * uniform(seed, "x", i), side_m * uniform(seed, "y", i)) for i in range(count)}


def walk(number: int, side_m: float, seconds: float) -> Path:
    """Through the square from west to east, or from south to north, as the number says; at constant speed."""
    speed, at = side_m / seconds, side_m * (0.25 + 0.5 * (number % 3) / 2.0)
    begin, end = (0.0, at), (side_m, at)
    if number % 2:
        begin, end = begin[::-1], end[::-1]
    v = (0.0, speed) if number % 2 else (speed, 0.0)
    return Path.of([(0.0, *begin, *v), (seconds, *end, *v)])


def text_of(kind: Kind, places: Places, path: Path, every_s: float, seed: int) -> str:
    """What the sensors report, read at once ``every_s``, as CSV."""
    lines = ["t_s,sensor,value,x_m,y_m"]
    sensors = [Placed(id, place, Scene((path,)), (), kind, {}, 0.0, seed) for id, place in places.items()]
    for k in range(int(path.end_s / every_s) + 1):
        state = path.at(k * every_s)
        assert state is not None
        for sensor in sensors:
            reading = sensor.sample(round(k * every_s * NS))
            if reading is not None:
                lines.append(f"{k * every_s:.3f},{sensor.id},{reading.values[0]:.6g},{state[0]:.4f},{state[1]:.4f}")
    return "\n".join(lines) + "\n"


def written(
    folder: FilePath, kind: Kind, places: Places, paths: Sequence[Path], every_s: float, seed: int
) -> tuple[list[FilePath], FilePath]:
    """A recording for each path, and the file of the sensors' places."""
    folder.mkdir(exist_ok=True)
    files = []
    for number, path in enumerate(paths):
        files.append(folder / f"walk_{number}.csv")
        files[-1].write_text(text_of(kind, places, path, every_s, 1000 * seed + number))
    rows = "".join(f"{id},{x},{y}\n" for id, (x, y) in places.items())
    (folder / "sensors.csv").write_text(f"id,x,y\n{rows}")
    return files, folder / "sensors.csv"
