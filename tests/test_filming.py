"""What a camera sees, drawn: exact places of points in frames, vehicles to scale, and the video of a run."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import cos, degrees, pi, radians, sin, tan
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from launcher.filming import film
from launcher.filming.film import Film
from launcher.filming.lens import BEYOND, Lens
from launcher.filming.painter import INSIDE, OUTSIDE, Picture, marked, paint
from launcher.filming.scenery import Scenery
from launcher.filming.sheet import GAP, MOST, TILE, seen, sheet
from launcher.filming.vehicle import HIGH_M, LONG_M, WIDE_M, Vehicle, faces, framed
from launcher.filming.video import jpeg, writing
from launcher.outside import Aim, Exposure, Outside, Turn
from trackfield.models.pointing import AIM_M, EVI_D30, Direction, Mount, in_view, project, towards
from trackfield.role import NS
from trackfield.world.path import Path as Way

WIDTH, HEIGHT = EVI_D30.width, EVI_D30.height
FOCAL = WIDTH / 2 / tan(radians(EVI_D30.wide / 2))
EAST = Mount(0.0, 0.0, 1.0, 0.0)
"""A camera in the origin that looks east at pan 0."""
NOWHERE = np.empty((0, 3))
EMPTY = Scenery(NOWHERE, NOWHERE, np.empty((0, 3, 3)), {})

angles = st.floats(-170, 170)
looks = st.builds(Direction, st.floats(-100, 100), st.floats(-25, 25))
mounts = st.builds(Mount, st.floats(-50, 50), st.floats(-50, 50), st.floats(0.5, 10), angles)
points = st.tuples(st.floats(-200, 200), st.floats(-200, 200), st.floats(0, 20))
vehicles = st.builds(Vehicle, st.just("target"), st.floats(-80, 80), st.floats(-80, 80), st.floats(-pi, pi))


def lens(pan: float = 0.0, tilt: float = 0.0, mount: Mount = EAST) -> Lens:
    return Lens(mount, Direction(pan, tilt))


def pixels(picture: Picture) -> NDArray[np.int16]:
    return np.asarray(picture.image).astype(np.int16)


def red(picture: Picture) -> NDArray[np.bool_]:
    """Where the paint of the first target is, above the words."""
    shown = pixels(picture)[: HEIGHT - 22]
    return (shown[..., 0] - shown[..., 1] > 60) & (shown[..., 0] - shown[..., 2] > 60)


# --- points -----------------------------------------------------------------------------------------------------------


@given(mounts, looks, points)
def test_points_are_where_the_pinhole_has_them(
    mount: Mount, look: Direction, point: tuple[float, float, float]
) -> None:
    one = Lens(mount, look)
    seen = one.seen(np.array([point]))
    at = project(mount, look, *point)
    if at is None or seen[0, 2] < 1e-3:
        assert seen[0, 2] < 1e-3
    else:
        assert one.pixels(seen)[0] == pytest.approx(at, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("away_deg", [0.0, 3.0, -7.5])
def test_five_degrees_of_pan_move_a_point_by_as_many_pixels_as_computed(away_deg: float) -> None:
    point = np.array([[30 * cos(radians(away_deg)), -30 * sin(radians(away_deg)), 1.0]])
    before, after = (one.pixels(one.seen(point))[0] for one in (lens(), lens(pan=5.0)))
    assert before == pytest.approx((WIDTH / 2 + FOCAL * tan(radians(away_deg)), HEIGHT / 2))
    moved = FOCAL * (tan(radians(away_deg - 5)) - tan(radians(away_deg)))
    assert after - before == pytest.approx((moved, 0.0), abs=1e-9)


def test_five_degrees_of_pan_move_the_drawn_vehicle_by_as_many_pixels() -> None:
    ahead = Vehicle("target", 40.0, 0.0, pi / 2)
    middles = [np.flatnonzero(red(paint(lens(pan), EMPTY, [ahead], [], "")).any(axis=0)) for pan in (0.0, 5.0)]
    before, after = ((columns[0] + columns[-1]) / 2 for columns in middles)
    near = 40.0 - WIDE_M / 2
    ends = [FOCAL * tan(radians(degrees(np.arctan2(side, near)) - 5)) for side in (-LONG_M / 2, LONG_M / 2)]
    assert after - before == pytest.approx(sum(ends) / 2, abs=1.0)


@pytest.mark.parametrize("tilt", [-8.0, 0.0, 2.5, 15.0])
def test_the_horizon_is_at_the_row_of_the_tilt(tilt: float) -> None:
    expected = HEIGHT / 2 + FOCAL * tan(radians(tilt))
    one = lens(tilt=tilt)
    far = np.array([[1e7, 3e6, 1.0]])
    assert one.horizon == pytest.approx(expected)
    assert one.pixels(one.seen(far))[0, 1] == pytest.approx(expected, abs=1e-3)
    column = pixels(paint(one, EMPTY, [], [], ""))[: HEIGHT - 22, 50]
    green = np.flatnonzero(column[:, 1] > column[:, 2])
    assert green[0] == pytest.approx(expected, abs=1.0)
    assert (np.diff(green) == 1).all()


@pytest.mark.parametrize("tilt", [-10.0, 0.0, 4.0])
def test_a_row_of_the_ground_is_that_of_its_points(tilt: float) -> None:
    one = lens(tilt=tilt)
    for away in (10.0, 30.0):
        assert one.row(away) == pytest.approx(one.pixels(one.seen(np.array([[away, 0.0, 0.0]])))[0, 1])


# --- lines and areas --------------------------------------------------------------------------------------------------


@given(looks, points, points)
def test_what_is_left_of_a_line_is_in_reach_of_the_picture_and_of_the_line(
    look: Direction, start: tuple[float, float, float], end: tuple[float, float, float]
) -> None:
    one = Lens(Mount(3.0, -2.0, 1.7, 30.0), look)
    found = one.lines(np.array([start]), np.array([end]))
    assert len(found) <= 1
    half = np.array([WIDTH, HEIGHT]) / 2
    for u_v in found.reshape(-1, 2):
        assert (np.abs(u_v - half) <= BEYOND * half * (1 + 1e-6) + 1e-6).all()
    steps = np.linspace(0, 1, 101)[:, None]
    seen = one.seen(np.array(start) + steps * (np.array(end) - start))
    shown = one.pixels(seen[seen[:, 2] > 0.11])
    inside = shown[(np.abs(shown - half) <= half).all(axis=1)]
    if len(inside):
        (a, b), along = found[0], found[0][1] - found[0][0]
        length = float(np.hypot(*along))
        for point in inside:
            off = point - a
            assert abs(off[0] * along[1] - off[1] * along[0]) <= 1e-3 * max(length, 1.0) * max(length, 1.0)
            assert np.hypot(*off) + np.hypot(*(b - point)) == pytest.approx(length, rel=1e-3, abs=1e-2)


def test_an_area_is_cut_at_the_edges_and_before_the_camera() -> None:
    ground = np.array([(-5.0, -50.0, 0.0), (60.0, -50.0, 0.0), (60.0, 50.0, 0.0), (-5.0, 50.0, 0.0)])
    area = lens().area(ground)
    left, top = area.min(axis=0)
    right, bottom = area.max(axis=0)
    assert top == pytest.approx(HEIGHT / 2 + FOCAL / 60)
    assert (left, right, bottom) == pytest.approx(
        (WIDTH / 2 * (1 - BEYOND), WIDTH / 2 * (1 + BEYOND), HEIGHT / 2 * (1 + BEYOND))
    )
    assert len(lens(pan=180.0).area(ground + np.array([10.0, 0.0, 0.0]))) == 0


# --- vehicles ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("away_m", [10.0, 25.0, 60.0])
def test_a_vehicle_is_as_large_as_its_distance_says(away_m: float) -> None:
    across = framed(Vehicle("target", away_m, 0.0, pi / 2), lens())
    along = framed(Vehicle("target", away_m, 0.0, 0.0), lens())
    assert across is not None and along is not None
    scale = FOCAL / (away_m - WIDE_M / 2)
    assert across.right - across.left == pytest.approx(LONG_M * scale)
    assert across.bottom - across.top == pytest.approx(HIGH_M * scale)
    assert along.right - along.left == pytest.approx(WIDE_M * FOCAL / (away_m - LONG_M / 2))


@pytest.mark.parametrize("heading", [0.0, 0.7, pi / 2, 2.5, pi])
def test_what_is_drawn_of_a_vehicle_fills_its_rectangle(heading: float) -> None:
    one = Vehicle("target", 20.0, 1.0, heading)
    picture = paint(lens(tilt=-1.0), EMPTY, [one], [], "")
    found = picture.framed[0]
    bare = pixels(paint(lens(tilt=-1.0), EMPTY, [], [], ""))
    changed = np.abs(pixels(picture) - bare).max(axis=2) > 12
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(red(picture).any(axis=0))
    assert rows[0] == pytest.approx(found.top, abs=2.0)
    assert found.left - 1.0 <= columns[0] and columns[-1] <= found.right + 1.0
    assert columns[-1] - columns[0] > 0.9 * (found.right - found.left)


@given(vehicles, looks)
def test_faces_lie_in_the_rectangle_around_them(one: Vehicle, look: Direction) -> None:
    view = Lens(Mount(1.0, 2.0, 2.0, 30.0), look)
    around = framed(one, view)
    _, *shown = (area for area, _ in faces(one, view, (200, 0, 0)))
    if around is None:
        return
    low, high = (around.left, around.top), (around.right, around.bottom)
    for area in shown:
        cut = np.clip(area, 0, (WIDTH, HEIGHT))
        assert (cut >= np.array(low) - 1e-6).all() and (cut <= np.array(high) + 1e-6).all()


@given(vehicles, looks, mounts)
def test_a_target_is_inside_where_the_kernel_has_it_in_view(one: Vehicle, look: Direction, mount: Mount) -> None:
    found, inside = framed(one, Lens(mount, look)), in_view(mount, look, one.x_m, one.y_m)
    if found is None:
        assert not inside
    else:
        assert found.inside == inside
        assert 0 <= found.left < found.right <= WIDTH and 0 <= found.top < found.bottom <= HEIGHT


def test_what_is_behind_the_camera_is_not_drawn() -> None:
    behind = Vehicle("target", -20.0, 0.0, 0.4)
    nothing, picture = paint(lens(), EMPTY, [], [], "x"), paint(lens(), EMPTY, [behind], [], "x")
    assert picture.framed == ()
    assert (pixels(picture) == pixels(nothing)).all()
    assert framed(behind, lens()) is None


def test_what_is_nearer_hides_what_is_farther() -> None:
    first, second = Vehicle("a", 15.0, 0.0, pi / 2), Vehicle("b", 40.0, 0.0, pi / 2)
    alone, both = (paint(lens(), EMPTY, some, [], "") for some in ([first], [first, second]))
    middle = round(HEIGHT / 2 + FOCAL * (1.0 - AIM_M) / 15), WIDTH // 2
    for dy in (0, 4):
        assert (pixels(both)[middle[0] + dy, middle[1]] == pixels(alone)[middle[0] + dy, middle[1]]).all()
    assert [one.target for one in both.framed] == ["a", "b"]


def test_sensors_stand_where_they_are_and_have_their_names() -> None:
    there = Scenery(NOWHERE, NOWHERE, np.empty((0, 3, 3)), {"n7": (20.0, 0.0), "behind": (-20.0, 0.0)})
    changed = np.abs(pixels(paint(lens(), there, [], [], "")) - pixels(paint(lens(), EMPTY, [], [], ""))).max(axis=2)
    rows, columns = np.flatnonzero((changed > 12).any(axis=1)), np.flatnonzero((changed > 12).any(axis=0))
    assert rows[-1] == pytest.approx(HEIGHT / 2 + FOCAL / 20, abs=2)  # its foot, 1 m below the camera
    assert (columns[0] + columns[-1]) / 2 == pytest.approx(WIDTH / 2, abs=2)


def test_a_rectangle_is_green_where_the_middle_of_a_target_is_in_the_frame_and_red_where_not() -> None:
    for y, colour in ((0.0, INSIDE), (10.5, OUTSIDE)):  # 10.5 m left: its middle is just outside
        picture = paint(lens(), EMPTY, [Vehicle("target", 20.0, y, pi / 2)], [], "")
        (one,) = picture.framed
        row, column = round(one.top - 3), round(min(one.right, WIDTH - 1) - 8)
        assert marked(picture).getpixel((column, row)) == colour


# --- a run ------------------------------------------------------------------------------------------------------------


def filmed(count: int = 20, **changes: object) -> Film:
    """A camera that turns from east to north while a target passes; a frame every 0.1 s from 2 s on."""
    mount = Mount(0.0, 0.0, 2.0, 0.0)
    turns = (Turn(0, 0.0, 0.0, 0.0, 0.0, 80.0, 50.0), Turn(2 * NS, 0.0, 0.0, -90.0, -3.0, 60.0, 50.0))
    aim = Aim(2 * NS, 1, "n0", 3, 1.2, NS, 7 * NS // 2, -5.0, 20.0, -90.0, -3.0, "aimed")
    exposures = tuple(Exposure(2 * NS + number * NS // 10, 1, number) for number in range(count))
    outside = Outside(mount, turns=turns, aims=(aim,), exposures=exposures)
    way = Way.of([(0.0, -40.0, 20.0, 10.0, 0.0), (4.0, 0.0, 20.0, 10.0, 0.0)])
    return Film(outside, {"target": way}, {"n0": (0.0, 10.0)}, origin_ns=NS, **changes)  # type: ignore[arg-type]


def test_frames_show_where_the_camera_looked_and_where_the_target_was_when_they_were_exposed() -> None:
    film = filmed()
    taken = list(film.taken())
    assert [one.exposed for one in taken] == list(film.outside.exposures)
    half = next(one for one in taken if one.exposed.t_ns == 2.5 * NS)
    assert half.look == pytest.approx((-30.0, -3.0))
    for one in taken:
        state = film.paths["target"].at(one.exposed.t_ns / NS)
        assert state is not None
        inside = [found.inside for found in one.picture.framed]
        assert any(inside) == in_view(film.outside.mount, one.look, *state[:2])
    assert {any(found.inside for found in one.picture.framed) for one in taken} == {True, False}


def test_a_target_that_is_gone_is_in_no_frame() -> None:
    late = [one for one in filmed(40).taken() if one.exposed.t_ns > 4 * NS]
    assert late and not any(one.picture.framed for one in late)


def test_a_shot_is_shown_as_it_was_aimed() -> None:
    (shot,) = filmed().shots(5)
    assert (shot.aim.shot, shot.look) == (1, Direction(-90.0, -3.0))
    (found,) = shot.picture.framed
    ahead = towards(Mount(0.0, 0.0, 2.0, 0.0), -5.0, 20.0)
    assert (found.left + found.right) / 2 == pytest.approx(WIDTH / 2 + FOCAL * tan(radians(ahead.pan + 90)), abs=6)


def test_of_many_frames_some_are_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "MOST", 7)
    many = filmed(20)
    assert (many.every, many.left_out) == (3, 13)
    assert [one.exposed.frame for one in many.taken()] == [0, 3, 6, 9, 12, 15, 18]
    assert filmed(7).left_out == 0


def test_the_same_frames_are_the_same_bytes() -> None:
    first, second = ([jpeg(one.picture.image) for one in filmed(3).taken()] for _ in range(2))
    assert first == second
    assert len(set(first)) == 3


def test_without_anything_told_of_the_camera_there_is_no_frame() -> None:
    blind = Film(Outside(EAST, exposures=(Exposure(NS, 1, 0),)), {}, {})
    assert list(blind.taken()) == []
    assert (blind.every, blind.left_out) == (1, 0)


# --- the file ---------------------------------------------------------------------------------------------------------


def test_a_video_has_all_its_frames_at_their_rate(tmp_path: Path) -> None:
    file = tmp_path / "video.mp4"
    taken = [one.picture.image for one in filmed(12).taken()]
    with writing(file, Fraction(10)) as video:
        for image in taken:
            video.add(image)
    with av.open(str(file)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.average_rate) == ("h264", 10)
        found = [frame.to_ndarray(format="rgb24").astype(float) for frame in container.decode(stream)]
    assert len(found) == 12
    for frame, image in zip(found, taken, strict=True):
        assert np.abs(frame - np.asarray(image)).mean() < 6.0
    assert [one.name for one in tmp_path.iterdir()] == ["video.mp4"]


def test_the_same_frames_are_the_same_video(tmp_path: Path) -> None:
    for name in ("a.mp4", "b.mp4"):
        with writing(tmp_path / name, Fraction(25, 2)) as video:
            for one in filmed(5).taken():
                video.add(one.picture.image)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_video_that_fails_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), writing(tmp_path / "video.mp4", Fraction(10)) as video:
        video.add(Image.new("RGB", (64, 48)))
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


# --- the sheet --------------------------------------------------------------------------------------------------------


def test_a_sheet_has_a_frame_of_each_shot_and_says_whether_its_target_is_in_it() -> None:
    one = filmed()
    aim = one.outside.aims[0]
    away = aim._replace(shot=2, t_ns=aim.t_ns + 1, aim_ns=5 * NS // 2)
    dropped = aim._replace(shot=0, outcome="superseded")
    two = Film(replace(one.outside, aims=(aim, away, dropped)), one.paths, one.sensors, one.origin_ns)
    whole = sheet(two)
    assert whole is not None
    assert whole.size == (2 * TILE[0] + GAP, TILE[1])
    assert [seen(two, shot) for shot in two.shots(5)] == [True, False]
    words = [whole.crop((left + 200, TILE[1] - 20, left + TILE[0], TILE[1])) for left in (0, TILE[0] + GAP)]
    green, red = (np.asarray(word).astype(int) for word in words)
    assert (green[..., 1] - green[..., 0] > 80).any() and not (green[..., 0] - green[..., 1] > 80).any()
    assert (red[..., 0] - red[..., 1] > 80).any() and not (red[..., 1] - red[..., 0] > 80).any()


def test_of_many_shots_the_first_ones_are_on_the_sheet() -> None:
    one = filmed()
    many = tuple(one.outside.aims[0]._replace(shot=number, t_ns=2 * NS + number) for number in range(1, MOST + 3))
    whole = sheet(Film(replace(one.outside, aims=many), one.paths, one.sensors))
    assert whole is not None
    assert whole.size[1] > 4 * TILE[1] + 3 * GAP  # four rows of three, and a note


def test_without_a_shot_there_is_no_sheet() -> None:
    assert sheet(Film(Outside(EAST), {}, {})) is None


def test_where_the_truth_is_not_known_a_sheet_says_nothing_of_it() -> None:
    one = filmed()
    whole = sheet(Film(one.outside, {}, one.sensors, one.origin_ns))
    assert whole is not None
    colours = np.asarray(whole.crop((200, TILE[1] - 20, TILE[0], TILE[1]))).astype(int)
    assert (np.ptp(colours, axis=2) < 30).all()


# --- whatever comes ---------------------------------------------------------------------------------------------------

anywhere = st.floats(-1e5, 1e5)


@settings(max_examples=40, deadline=None)
@given(
    st.builds(Mount, anywhere, anywhere, st.floats(0.1, 1000), st.floats(-360, 360)),
    st.builds(Direction, st.floats(-360, 360), st.floats(-360, 360)),
    st.lists(st.builds(Vehicle, st.just("t"), anywhere, anywhere, st.floats(-7, 7)), max_size=2),
    st.booleans(),
)
def test_a_frame_can_be_drawn_from_anywhere(mount: Mount, look: Direction, there: list[Vehicle], at: bool) -> None:
    here = [Vehicle("here", mount.x_m, mount.y_m, 0.5)] if at else []
    view = Lens(mount, look)
    picture = paint(view, Scenery.around(mount, {"n": (mount.x_m, mount.y_m)}), [*there, *here], [], "words")
    assert picture.image.size == (WIDTH, HEIGHT)
    for one in picture.framed:
        assert 0 <= one.left < one.right <= WIDTH and 0 <= one.top < one.bottom <= HEIGHT


def test_ground_behind_the_camera_has_no_row() -> None:
    assert lens(tilt=120.0).row(10.0) is None
    assert lens(tilt=-80.0, mount=Mount(0.0, 0.0, 100.0, 0.0)).row(10.0) is not None


@pytest.mark.parametrize("rate", [Fraction(1, 10), Fraction(100), Fraction(10, 3)])
def test_slow_and_fast_videos_keep_their_rate(tmp_path: Path, rate: Fraction) -> None:
    file = tmp_path / "video.mp4"
    with writing(file, rate) as video:
        for one in filmed(3).taken():
            video.add(one.picture.image)
    with av.open(str(file)) as container:
        times = [float(frame.time) for frame in container.decode(video=0) if frame.time is not None]
    assert np.diff(times) == pytest.approx([1 / float(rate)] * 2, rel=0.01)
