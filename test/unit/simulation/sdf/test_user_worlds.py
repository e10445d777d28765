"""Worlds as Gazebo's users have them: of the building editor, of included models with meshes, of SDF 1.4 and 1.7."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.meshes.files import load_mesh, load_parts
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.render.from_above import draw_world
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.matrices import to_pose2d
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.slices import slice_bodies
from rosbot_patrol.simulation.sdf.world import World, load_world

DATA = Path(__file__).parents[1] / "data"
ROBOT = Path(__file__).parents[4] / "urdf" / "rosbot.urdf"


def world(name: str) -> World:
    return load_world(DATA / "worlds" / f"{name}.world", [DATA / "models"])


def body_of(name: str, in_world: World) -> Body:
    return next(body for body in in_world.bodies if body.name == name)


def range_at(name: str, place: tuple[float, float], bearing: float, height: float = 0.16) -> float:
    return float(slice_bodies(world(name).bodies, height).cast(*place, bearing, 0.1, 1, longest=50.0)[0])


@pytest.mark.parametrize("name", ["building", "dining", "old", "frames"])
def test_it_loads_and_can_be_driven_in(name: str) -> None:
    engine = Engine(world(name))
    engine.spawn_robot(load_robot(ROBOT))
    for _ in range(20):
        engine.step()
    assert not engine.touches()
    engine.close()


def test_the_building_stands_where_its_state_says() -> None:
    building = world("building")
    walls = [body for body in building.bodies if body.kind == "wall"]
    assert len(walls) == 5
    assert sum(len(wall.collisions) for wall in walls) == 3 + 4 + 1 + 1 + 1
    # The model's frame is (2, 1) turned by 0.5 rad: Wall_0 lies 2 m below its middle, with a door.
    c, s = math.cos(0.5), math.sin(0.5)
    middle = (2.0, 1.0)
    down = math.atan2(-c, s)
    assert range_at("building", middle, down) == pytest.approx(2.0 - 0.075, abs=1e-5)
    before_door = (middle[0] - 1.5 * c, middle[1] - 1.5 * s)
    assert range_at("building", before_door, down) == 50.0
    assert range_at("building", before_door, down, height=2.2) == pytest.approx(1.925, abs=1e-5)


def test_the_building_s_window_is_open_between_sill_and_lintel() -> None:
    c, s = math.cos(0.5), math.sin(0.5)
    before = (2.0 + 2.0 * c - 0.5 * s, 1.0 + 2.0 * s + 0.5 * c)
    assert range_at("building", before, 0.5, height=0.5) == pytest.approx(1.0 - 0.075, abs=1e-5)
    assert range_at("building", before, 0.5, height=1.5) == 50.0
    assert range_at("building", before, 0.5, height=2.3) == pytest.approx(1.0 - 0.075, abs=1e-5)


def test_state_scales_a_box() -> None:
    box = body_of("unit_box", world("building"))
    assert box.collisions[0].shape.size == pytest.approx((0.6, 0.8, 0.5))
    assert to_pose2d(box.pose) == pytest.approx((3.2, 1.2, 0.5))


def test_included_models_are_found_named_and_put_in_their_places() -> None:
    dining = world("dining")
    names = [body.name for body in dining.bodies]
    expected = ["ground_plane", "table", "stool_left", "stool_right", "lamp", "corner", "corner::seat"]
    assert names == expected
    assert to_pose2d(body_of("corner::seat", dining).pose)[:2] == pytest.approx((2.2, -0.8), abs=1e-4)
    (actor,) = dining.actors
    assert (actor.name, actor.model, actor.pose) == ("person_standing", "person", pytest.approx((-0.4, 0.8, -0.5)))


def test_model_config_chooses_the_newest_version_that_is_read_here() -> None:
    table = body_of("table", world("dining"))
    assert table.collisions[0].shape.kind == "mesh"


def test_an_obj_brings_its_colours() -> None:
    visuals = body_of("table", world("dining")).visuals
    assert [v.material.rgba[:3] for v in visuals] == [(0.8, 0.68, 0.48)] + [(0.2, 0.16, 0.14)] * 4


def test_an_stl_is_scaled_and_takes_the_colour_of_the_sdf() -> None:
    (visual,) = body_of("stool_left", world("dining")).visuals
    assert visual.material.rgba[:3] == pytest.approx((0.05, 0.18, 1.0))
    assert visual.shape.size == pytest.approx((0.001,) * 3)
    high = slice_bodies(world("dining").bodies, 0.2).cast(1.2, -2.0, math.pi / 2, 0.1, 1, longest=50.0)[0]
    assert high == pytest.approx(1.1 - 0.2, abs=1e-3)


def test_a_dae_has_its_unit_its_nodes_and_its_colours_and_z_is_up_as_in_gazebo() -> None:
    parts = {part.name: part for part in load_parts(DATA / "models" / "lamp" / "meshes" / "lamp.dae")}
    assert set(parts) == {"lamp", "stand", "hood"}
    assert np.ptp(parts["stand"].vertices, axis=0) == pytest.approx([0.04, 0.04, 1.40])
    assert parts["hood"].vertices[:, 2].min() == pytest.approx(1.29)
    assert np.abs(parts["hood"].vertices[:, 0]).max() == pytest.approx(0.2 * math.sqrt(2))
    assert parts["hood"].rgba == pytest.approx((0.9, 0.85, 0.6, 1.0))
    vertices, faces = load_mesh(DATA / "models" / "lamp" / "meshes" / "lamp.dae")
    assert len(faces) == 36
    assert vertices[:, 2].max() == pytest.approx(1.59)


def test_a_submesh_can_be_taken_alone_and_centred(tmp_path: Path) -> None:
    mesh = "<uri>model://lamp/meshes/lamp.dae</uri><submesh><name>hood</name><center>true</center></submesh>"
    text = f"<geometry><mesh>{mesh}</mesh></geometry>"
    file = tmp_path / "a.world"
    file.write_text(
        "<sdf version='1.6'><world name='w'><model name='m'><link name='l'>"
        f"<collision name='c'>{text}</collision></link></model></world></sdf>"
    )
    shape = load_world(file, [DATA / "models"]).bodies[0].collisions[0].shape
    assert shape.vertices is not None
    assert shape.vertices[:, 2].min() == pytest.approx(-0.15)
    file.write_text(file.read_text().replace("hood", "hat"))
    (lost,) = load_world(file, [DATA / "models"]).lost
    assert "no part 'hat' (there: 'hood', 'lamp', 'stand')" in lost


def test_sdf_1_4_is_read_and_its_plugins_are_named_once(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        old = world("old")
    (record,) = caplog.records
    assert record.getMessage().endswith("<plugin>, <plugin> of a model")
    assert [body.name for body in old.bodies] == ["ground_plane", "pillar", "ball", "long_wall"]
    assert range_at("old", (0.0, 0.0), math.pi / 4) == pytest.approx(math.sqrt(2) - 0.3)


def test_poses_relative_to_frames_of_sdf_1_7() -> None:
    frames = world("frames")
    cupboard, vase = body_of("cupboard/body", frames), body_of("cupboard/vase", frames)
    assert to_pose2d(cupboard.pose) == pytest.approx((2.0, 2.0, math.pi / 2))
    assert vase.pose[:3, 3] == pytest.approx((2.0, 2.2, 1.15))
    lid = vase.pose @ vase.visuals[1].pose
    assert lid[:3, 3] == pytest.approx((2.0, 2.2, 1.35))
    tray, jar = body_of("trolley", frames), body_of("trolley::jar", frames)
    assert tray.pose[:3, 3] == pytest.approx((3.5, 2.6, 0.4))  # its handle, 0.6 behind it, is what is placed
    assert jar.pose[:3, 3] == pytest.approx((3.5, 2.9, 0.525))


def test_an_actor_walks_its_waypoints() -> None:
    (guest,) = world("frames").actors
    assert (guest.name, guest.model, guest.loop) == ("guest", "person", True)
    assert guest.pose == pytest.approx((-1.0, -1.0, 0.0))
    assert guest.speed == pytest.approx(6.0 / 9.0)
    engine = Engine(world("frames"))
    for _ in range(400):
        engine.step()
    assert engine.population.walkers[0].pose.x > -0.5
    engine.close()


@pytest.mark.parametrize(
    ("name", "place", "colour"),
    [
        ("building", (3.2, 1.2), (0, 0, 1)),
        ("building", (2.0 - 3.0 * math.cos(0.5), 1.0 - 3.0 * math.sin(0.5)), (1.0, 0.94, 0.8)),
        ("dining", (1.0, 0.0), (0.8, 0.68, 0.48)),
        ("dining", (1.2, -0.9), (0.05, 0.18, 1.0)),
        ("dining", (2.4, 0.6), (0.9, 0.85, 0.6)),
        ("dining", (2.2, -1.4), (0.57, 0.41, 0.26)),
        ("old", (1.0, 1.0), (0.8, 0.2, 0.2)),
        ("old", (-1.0, 0.5), (1.0, 0.51, 0.06)),
        ("old", (0.0, 2.0), (0.60, 0.33, 0.26)),
        ("frames", (2.0, 1.7), (0.5, 0.4, 0.3)),
        ("frames", (3.5, 2.3), (0.7, 0.7, 0.75)),
    ],
)
def test_from_above_each_thing_shows_its_colour(
    name: str, place: tuple[float, float], colour: tuple[float, ...]
) -> None:
    renderer = make_renderer()
    picture = draw_world(world(name), renderer, width=500)
    renderer.close()
    column, row = picture.pixel_of(*place)
    seen = picture.pixels[round(row), round(column)] / 255.0
    hue, wanted = seen / seen.max(), np.array(colour) / max(colour)
    assert hue == pytest.approx(wanted, abs=0.12), f"{seen} for {colour}"
