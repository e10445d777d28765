"""Both renderers draw the same content: exact depth, places of shapes, moving and removing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors import LOOKS, person_body, person_pose_parts
from rosbot_patrol.simulation.renderer import make_renderer
from rosbot_patrol.simulation.scene import Body, Intrinsics, Material, SceneRenderer, Shape, Visual

# A robot's camera at the origin that looks along x: optical z is forward, x right, y down.
CAMERA = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
VIEW = Intrinsics()


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
