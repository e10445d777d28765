"""Both renderers draw the same content: exact depth, places of shapes, moving and removing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.people import LOOKS, hydrant_body, person_body, person_pose_parts
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.scene.scene import Body, Intrinsics, Material, SceneRenderer, Shape, Visual
from rosbot_patrol.simulation.sdf.world import load_world

# A robot's camera at the origin that looks along x: optical z is forward, x right, y down.
CAMERA = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
VIEW = Intrinsics()
ROOT = Path(__file__).parents[2]


@pytest.fixture(params=["egl", "tiny"])
def renderer(request: pytest.FixtureRequest) -> Iterator[SceneRenderer]:
    made = make_renderer(prefer=request.param)
    yield made
    made.close()


def at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def thing(name: str, kind: str, size: tuple[float, ...], pose: np.ndarray, colour=(1.0, 0.0, 0.0), static=True) -> Body:
    visual = Visual(shape=Shape(kind=kind, size=size), material=Material(rgba=(*colour, 1.0)))
    return Body(name=name, pose=pose, static=static, visuals=(visual,))


def test_depth_of_a_box_is_exact(renderer: SceneRenderer) -> None:
    renderer.add(thing("box", "box", (1.0, 1.0, 1.0), at(3.5, 0, 0)))
    _, depth = renderer.render(CAMERA, VIEW)
    assert depth.shape == (480, 640)
    inside = depth[180:300, 250:390]
    assert np.abs(inside - 3.0).max() < 0.01
    assert np.isinf(depth[0, 0])


def test_depth_of_the_floor_is_exact(renderer: SceneRenderer) -> None:
    renderer.add(thing("floor", "plane", (50, 50), at(0, 0, -0.22)))
    _, depth = renderer.render(CAMERA, VIEW)
    for row in (300, 400, 470):
        assert depth[row, 320] == pytest.approx(0.22 * VIEW.fy / (row - VIEW.cy), rel=0.002)


def test_a_sphere_is_where_geometry_says(renderer: SceneRenderer) -> None:
    renderer.add(thing("ball", "sphere", (0.3,), at(4.0, 0.8, 0.4)))
    _, depth = renderer.render(CAMERA, VIEW)
    rows, columns = np.nonzero(np.isfinite(depth))
    assert columns.mean() == pytest.approx(VIEW.cx - VIEW.fx * 0.8 / 4.0, abs=2.0)
    assert rows.mean() == pytest.approx(VIEW.cy - VIEW.fy * 0.4 / 4.0, abs=2.0)
    assert len(rows) == pytest.approx(np.pi * (VIEW.fx * 0.3 / 4.0) ** 2, rel=0.08)


@pytest.mark.parametrize(
    ("kind", "size"), [("cylinder", (0.2, 1.0)), ("capsule", (0.2, 0.6)), ("box", (0.4, 0.4, 1.0))]
)
def test_a_shape_is_as_wide_and_high_as_it_says(renderer: SceneRenderer, kind: str, size: tuple[float, ...]) -> None:
    renderer.add(thing("it", kind, size, at(4.0, 0, 0)))
    _, depth = renderer.render(CAMERA, VIEW)
    rows, columns = np.nonzero(np.isfinite(depth))
    assert np.ptp(columns) == pytest.approx(VIEW.fx * 0.4 / 3.9, abs=4)
    assert np.ptp(rows) == pytest.approx(VIEW.fy * 1.0 / 3.9, abs=8)


def test_colour_is_the_material_s(renderer: SceneRenderer) -> None:
    renderer.add(thing("left", "box", (1, 1, 1), at(3, 0.8, 0), colour=(1, 0, 0)))
    renderer.add(thing("right", "box", (1, 1, 1), at(3, -0.8, 0), colour=(0, 0, 1)))
    colour, _ = renderer.render(CAMERA, VIEW)
    left, right = colour[240, 130].astype(int), colour[240, 510].astype(int)
    assert left[0] > 60
    assert left[1:].max() < 10
    assert right[2] > 60
    assert right[:2].max() < 10


@pytest.mark.parametrize("colour", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.9, 0.8, 0.1), (0.2, 0.2, 0.2), (1, 1, 1)])
def test_a_colour_keeps_its_hue_and_its_brightness(renderer: SceneRenderer, colour: tuple[float, ...]) -> None:
    renderer.add(thing("it", "sphere", (0.5,), at(2.5, 0, 0), colour=colour))
    picture, depth = renderer.render(CAMERA, VIEW)
    seen = picture[np.isfinite(depth)].mean(axis=0) / 255.0
    assert seen / seen.max() == pytest.approx(np.array(colour) / max(colour), abs=0.08)
    assert 0.5 * max(colour) < seen.max() <= max(colour) + 0.02


def test_the_nearer_hides_the_farther(renderer: SceneRenderer) -> None:
    renderer.add(thing("far", "box", (1, 8, 8), at(6, 0, 0), colour=(0, 1, 0)))
    renderer.add(thing("near", "box", (1, 1, 1), at(3, 0, 0), static=False))
    _, depth = renderer.render(CAMERA, VIEW)
    assert depth[240, 320] == pytest.approx(2.5, abs=0.01)
    assert depth[20, 20] == pytest.approx(5.5, abs=0.01)


def test_move_pose_and_remove(renderer: SceneRenderer) -> None:
    renderer.add(thing("box", "box", (1, 1, 1), at(3, 0, 0)))
    renderer.move("box", at(4, 0, 0))
    assert renderer.render(CAMERA, VIEW)[1][240, 320] == pytest.approx(3.5, abs=0.01)
    renderer.pose_visuals("box", at(1, 0, 0)[None])
    assert renderer.render(CAMERA, VIEW)[1][240, 320] == pytest.approx(4.5, abs=0.01)
    renderer.remove("box")
    assert np.isinf(renderer.render(CAMERA, VIEW)[1]).all()


def test_a_person_stands_as_high_as_the_look_says(renderer: SceneRenderer) -> None:
    look = LOOKS["visitor"]
    renderer.add(person_body("somebody", look))
    renderer.move("somebody", at(6.0, 0, -1.0))
    renderer.pose_visuals("somebody", person_pose_parts(look))
    rows = np.nonzero(np.isfinite(renderer.render(CAMERA, VIEW)[1]))[0]
    assert np.ptp(rows) == pytest.approx(VIEW.fy * look.height / 6.0, rel=0.06)


def test_mistakes_are_named(renderer: SceneRenderer) -> None:
    renderer.add(thing("box", "box", (1, 1, 1), at(3, 0, 0)))
    with pytest.raises(WorldError, match="box: is in the scene already"):
        renderer.add(thing("box", "box", (1, 1, 1), at(3, 0, 0)))
    with pytest.raises(WorldError, match="nobody: is not in the scene"):
        renderer.move("nobody", np.eye(4))
    with pytest.raises(WorldError, match="box: has visuals"):
        renderer.pose_visuals("box", np.zeros((3, 4, 4)))
    with pytest.raises(WorldError, match="cylinder: needs 2 sizes"):
        renderer.add(thing("thin", "cylinder", (1.0,), np.eye(4)))


def house_view(prefer: str, place: Pose2D) -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth of the house with a person and a hydrant in it, from the robot's camera."""
    renderer = make_renderer(prefer=prefer)
    for body in load_world(ROOT / "worlds" / "house.world").bodies:
        renderer.add(body)
    look = LOOKS["visitor"]
    renderer.add(person_body("somebody", look))
    renderer.move("somebody", from_pose2d(Pose2D(2.2, 0.6, 2.0)))
    renderer.pose_visuals("somebody", person_pose_parts(look, 0.3, True))
    renderer.add(hydrant_body("hydrant"))
    renderer.move("hydrant", from_pose2d(Pose2D(1.6, -0.5, 0.0)))
    picture = renderer.render(from_pose2d(place, 0.22) @ CAMERA, VIEW)
    renderer.close()
    return picture


@pytest.mark.parametrize("place", [Pose2D(), Pose2D(2.8, -0.2, 2.4), Pose2D(-3.5, 0.3, 1.0), Pose2D(14.7, 11.5, -2.0)])
def test_both_draw_the_same_house(place: Pose2D) -> None:
    """Depth but for edges the same, colours of the same hue and, but for textures and light, the same brightness."""
    (colour, depth), (other_colour, other_depth) = (house_view(prefer, place) for prefer in ("egl", "tiny"))
    both = np.isfinite(depth) & np.isfinite(other_depth)
    assert (np.isfinite(depth) != np.isfinite(other_depth)).mean() < 0.005
    gap = np.abs(depth[both] - other_depth[both])
    assert np.median(gap) < 0.002
    assert (gap > 0.02).mean() < 0.01
    coarse, other_coarse = (
        p.reshape(12, 40, 16, 40, 3).astype(float).mean(axis=(1, 3)) for p in (colour, other_colour)
    )
    solid = both.reshape(12, 40, 16, 40).all(axis=(1, 3))  # the sky's colour is the renderer's own
    assert np.abs(coarse - other_coarse)[solid].mean() < 15.0
    assert np.corrcoef(coarse[solid].ravel(), other_coarse[solid].ravel())[0, 1] > 0.9
