"""What worlds and models of other people hold, each as they write it: the files here are ours, the forms are theirs."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.render.from_above import draw_world
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.matrices import to_pose2d
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.scene.slices import slice_bodies
from rosbot_patrol.simulation.sdf.world import World, load_world, parse_model

DATA = Path(__file__).parents[1] / "data"
ROBOT = Path(__file__).parents[4] / "urdf" / "rosbot.urdf"
BOX = "<geometry><box><size>1 1 1</size></box></geometry>"
STL = bytes(80) + (1).to_bytes(4, "little") + np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1], "<f4").tobytes() + b"\0\0"


def sdf(inside: str, *, version: str = "1.6") -> str:
    return f"<sdf version='{version}'><world name='default'>{inside}</world></sdf>"


def model(inside: str, *, name: str = "thing", more: str = "") -> str:
    return f"<model name='{name}'><static>1</static>{more}<link name='link'>{inside}</link></model>"


def both(geometry: str, material: str = "") -> str:
    inside = f"<geometry>{geometry}</geometry>"
    return f"<collision name='c'>{inside}</collision><visual name='v'>{inside}{material}</visual>"


def read(folder: Path, text: str | bytes, name: str = "a.world") -> World:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_world(file, [DATA / "models"])


def put(folder: Path, name: str, sdf_text: str, *, mesh: bytes = b"") -> Path:
    """A model in folder/models."""
    home = folder / "models" / name
    (home / "meshes").mkdir(parents=True)
    (home / "model.sdf").write_text(sdf_text)
    if mesh:
        (home / "meshes" / f"{name}.STL").write_bytes(mesh)
    return home


def body_of(world: World, name: str) -> Body:
    return next(body for body in world.bodies if body.name == name)


def colour_of(folder: Path, material: str) -> tuple[float, ...]:
    world = read(folder, sdf(model(both("<sphere><radius>1</radius></sphere>", material))))
    return world.bodies[0].visuals[0].material.rgba[:3]


WORLD = sdf(model(f"<collision name='c'>{BOX}</collision>"))


@pytest.mark.parametrize(
    "text",
    [
        f"<!-- made from a template -->\n<?xml version='1.0' ?>\n{WORLD}",
        f"\n\n<?xml version='1.0' encoding='utf-8'?>\n{WORLD}",
        b"\xef\xbb\xbf<?xml version='1.0'?>" + WORLD.encode(),
        f"<?xml version='1.0' encoding='UTF-16'?>{WORLD}".encode("utf-16"),
        WORLD.replace("<world", "<!-- a -- b --><world"),
        WORLD.replace("<world name='default'>", "<world name='default'><gz:thing a='1'/>`"),
        WORLD.replace("<sdf", "<gazebo").replace("</sdf", "</gazebo"),
        WORLD + "\n<!-- the end -->\n",
        WORLD.replace("<world", "<!-- was <xacro:include filename='a'/> --><world"),
        WORLD.replace("</model>", "<plugin name='p'><origin pose='0 0 0 0 0 0'/></plugin></model>"),
        WORLD.replace("<world", "<author>Smith & Sons &c. &amp; more</author><world"),
        WORLD.replace("<world", "<!-- caf\xe9 --><author>caf\xe9</author><world").encode("latin-1"),
        WORLD.replace("<world", "<author>bell \x07</author><world"),
        WORLD + "\n</sdf>\nleft over",
    ],
    ids=[
        "comment first", "empty lines first", "byte order mark", "utf-16", "dashes", "prefix", "gazebo", "trailing",
        "macro in a comment", "origin of a plugin", "bare ampersand", "latin-1", "control character", "behind the end",
    ],
)  # fmt: skip
def test_xml_that_gazebo_reads_is_read(tmp_path: Path, text: str | bytes) -> None:
    assert [body.name for body in read(tmp_path, text).bodies] == ["thing"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (WORLD.replace("<world", "<% n = 3 %><world"), "is an ERB template, expand it first: erb "),
        (WORLD.replace("<world", "<xacro:property name='n' value='3'/><world"), "expand it first: rosrun xacro xacro "),
        (
            "<gazebo version='1.0'><world><model name='m'><origin pose='0 0 1 0 0 0'/></model></world></gazebo>",
            "is of SDF 1.0, with poses in <origin>: convert it with 'gz sdf -c'",
        ),
        (WORLD.replace("</world>", "<!-- -- -->"), "is not XML, or not all of it: "),
    ],
)
def test_what_has_to_be_expanded_first_says_so(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(WorldError, match=r"a\.world: ") as caught:
        read(tmp_path, text)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        ("<pose>\n   1.5e0\n   -2\n 0 0 0\n 1e-1\n</pose>", (1.5, -2.0, 0.1)),
        ("<pose frame=''>1 2 0 0 -0 0.5</pose>", (1.0, 2.0, 0.5)),
        ("<pose>1 2 0</pose>", (1.0, 2.0, 0.0)),
        ("<pose/>", (0.0, 0.0, 0.0)),
        ("<pose degrees='true'>1 2 0 0 0 90</pose>", (1.0, 2.0, math.pi / 2.0)),
        ("<pose rotation_format='quat_xyzw'>1 2 0 0 0 0.6 0.8</pose>", (1.0, 2.0, 2.0 * math.atan2(0.6, 0.8))),
    ],
)
def test_poses_in_every_form(tmp_path: Path, pose: str, expected: tuple[float, ...]) -> None:
    world = read(tmp_path, sdf(model(f"<collision name='c'>{BOX}</collision>", more=pose)))
    assert to_pose2d(world.bodies[0].pose) == pytest.approx(expected)


def test_the_first_of_several_worlds_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, WORLD.replace("</sdf>", "<world name='other'/></sdf>"))
    assert world.name == "default"
    assert "holds 2 worlds, only the first is read" in caplog.text


def test_two_models_of_one_name_both_stand_there(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    crate = model(f"<collision name='c'>{BOX}</collision>", name="crate")
    put(tmp_path, "crate", f"<sdf version='1.6'>{crate}</sdf>")
    one = "<include><uri>model://crate</uri><pose>{} 0 0 0 0 0</pose></include>"
    state = "<state world_name='default'><model name='crate'><pose>5 0 0 0 0 0</pose></model></state>"
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, sdf(one.format(1) + one.format(2) + state))
    assert [(b.name, b.pose[0, 3]) for b in world.bodies] == [("crate", 5.0), ("crate_1", 2.0)]
    assert "names used twice, the later one is called: crate_1" in caplog.text


def test_two_links_of_one_name_are_both_there(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    link = f"<link name='leg'><pose>{{}} 0 0 0 0 0</pose><collision name='c'>{BOX}</collision></link>"
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, sdf(f"<model name='table'>{link.format(1)}{link.format(2)}</model>"))
    assert [(b.name, b.pose[0, 3]) for b in world.bodies] == [("table/leg", 1.0), ("table/leg_1", 2.0)]
    assert "the later one is called: table/leg_1" in caplog.text


def test_a_model_s_text_is_a_world_of_its_own(tmp_path: Path) -> None:
    chair = model(both("<box><size>1 1 1</size></box>"), more="<pose>9 9 9 0 0 0</pose>")
    text = f"<sdf version='1.6'>{chair}</sdf>"
    world = parse_model(text, "chair_7", (1.0, 2.0, 0.5, 0.0, 0.0, 1.57))
    assert [(b.name, *to_pose2d(b.pose)) for b in world.bodies] == [("chair_7", 1.0, 2.0, pytest.approx(1.57))]
    assert world.bodies[0].pose[2, 3] == 0.5
    with pytest.raises(WorldError, match="has no <model> element"):
        parse_model("<sdf version='1.6'/>", "nothing", (0.0,) * 6)


def test_links_of_a_state_may_bear_the_name_of_their_model(tmp_path: Path) -> None:
    state = (
        "<state><model name='thing'><pose>1 0 0 0 0 0</pose>"
        "<link name='thing::link'><pose>1 3 0 0 0 0</pose><velocity>0 0 0 0 -0 0</velocity></link></model>"
        "<light name='sun'><pose>0 0 10 0 0 0</pose></light></state>"
    )
    world = read(tmp_path, sdf(model(f"<collision name='c'>{BOX}</collision>") + state))
    assert to_pose2d(world.bodies[0].pose)[:2] == (1.0, 3.0)


def test_what_fell_out_of_the_world_is_gone_and_harms_nothing(tmp_path: Path) -> None:
    fallen = model(both("<box><size>1 1 1</size></box>"), name="bed", more="<pose>4 -4 -7.54989e+08 0 -1e-06 0</pose>")
    wall = model(both("<box><size>0.1 8 2</size></box>"), name="wall", more="<pose>3 0 1 0 0 0</pose>")
    world = read(tmp_path, sdf(fallen + wall))
    engine = Engine(world)
    engine.spawn_robot(load_robot(ROBOT))
    for _ in range(50):
        engine.step()
    assert not engine.touches()
    assert np.isfinite(engine.scan().ranges).any()
    engine.close()
    renderer = make_renderer()
    picture = draw_world(world, renderer, width=300)
    renderer.close()
    column, row = picture.pixel_of(3.0, 0.0)
    assert picture.pixels[round(row), round(column)] == pytest.approx(picture.pixels[round(row) + 5, round(column)])


def test_inner_models_of_a_state_may_bear_their_whole_names(tmp_path: Path) -> None:
    inner = f"<model name='b'><link name='l'><collision name='c'>{BOX}</collision></link></model>"
    for name in ("b", "a::b"):
        state = f"<state><model name='a'><pose>1 0 0 0 0 0</pose><model name='{name}'><pose>7 0 0 0 0 0</pose></model>"
        world = read(tmp_path, sdf(f"<model name='a'>{inner}</model>{state}</model></state>"))
        assert body_of(world, "a::b").pose[0, 3] == 7.0


def test_versions_that_are_read_as_another_are_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    include = ""
    for name in ("crate", "barrel"):
        thing = model(f"<collision name='c'>{BOX}</collision>", name=name)
        put(tmp_path, name, f"<sdf version='1.3'>{thing}</sdf>")
        include += f"<include><uri>model://{name}</uri></include>"
    with caplog.at_level(logging.WARNING):
        read(tmp_path, sdf(include))
    (record,) = caplog.records
    assert record.getMessage().endswith("crate/model.sdf: SDF version 1.3, read as 1.7")


def test_meshes_as_sdf_1_2_named_and_scaled_them(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(STL)
    geometry = "<mesh><filename>a.stl</filename><scale>0.5</scale></mesh>"
    shape = read(tmp_path, sdf(model(both(geometry)))).bodies[0].collisions[0].shape
    assert shape.size == (0.5, 0.5, 0.5)


def test_a_room_with_a_person_in_it_is_no_person(tmp_path: Path) -> None:
    put(tmp_path, "person_standing_x", "<sdf/>", mesh=STL)
    put(tmp_path, "sofa", "<sdf/>", mesh=STL)
    meshes = "".join(
        f"<visual name='{name}'><geometry><mesh><uri>model://{name}/meshes/{name}.STL</uri></mesh></geometry></visual>"
        for name in ("person_standing_x", "sofa")
    )
    world = read(tmp_path, sdf(model(meshes, name="parlour")))
    assert not world.actors
    assert [body.name for body in world.bodies] == ["parlour"]


def test_a_road_lies_on_the_ground_and_stops_nobody(tmp_path: Path) -> None:
    points = "<point>-5 0 0</point><point>5 0 0</point><point>5 5 0</point>"
    look = "<material><script><name>Gazebo/Motorway</name></script></material>"
    world = read(tmp_path, sdf(f"<road name='drive'><width>2</width>{points}{look}</road>"))
    (road,) = world.bodies
    assert [visual.shape.kind for visual in road.visuals] == ["box", "box", "cylinder"]
    assert not road.collisions
    engine = Engine(world)
    engine.spawn_robot(load_robot(ROBOT))
    engine.step()
    assert not engine.touches()
    engine.close()
    with pytest.raises(WorldError, match="road 'drive': expected a width and at least 2 points, got 2 m and 1"):
        read(tmp_path, sdf("<road name='drive'><width>2</width><point>0 0 0</point></road>"))


def test_file_uris_start_from_the_folders_of_models_and_of_media(tmp_path: Path) -> None:
    for form in ("file://shelf/meshes/shelf.STL", "file://models/shelf/meshes/shelf.STL", "meshes/shelf.STL"):
        folder = tmp_path / form.replace("/", "_")
        geometry = f"<mesh><uri>{form}</uri></mesh>"
        put(folder, "shelf", f"<sdf version='1.6'>{model(both(geometry), name='shelf')}</sdf>", mesh=STL)
        (folder / "worlds").mkdir()
        world = read(folder / "worlds", sdf("<model name='a'><include><uri>model://shelf</uri></include></model>"))
        assert [body.name for body in world.bodies] == ["a::shelf"]


def test_an_absolute_path_of_another_s_home_is_found_by_its_end(tmp_path: Path) -> None:
    put(tmp_path, "shelf", "<sdf/>", mesh=STL)
    geometry = "<mesh><uri>file:///home/bob/.gazebo/models/shelf/meshes/shelf.STL</uri></mesh>"
    world = read(tmp_path, sdf(model(both(geometry))))
    assert world.bodies[0].collisions[0].shape.mesh == tmp_path / "models" / "shelf" / "meshes" / "shelf.STL"


def test_a_model_of_light_only_is_a_light(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    put(tmp_path, "lantern", "<sdf version='1.5'><light name='lantern' type='point'/></sdf>")
    with caplog.at_level(logging.INFO):
        read(tmp_path, sdf("<include><uri>model://lantern</uri></include>"))
    assert "1 light is not simulated" in caplog.text


@pytest.mark.parametrize(
    ("material", "colour"),
    [
        ("<material><script>Gazebo/Red</script></material>", (0.95, 0.0, 0.0)),
        ("<material><script><name>Gazebo/DarkGrey</name></script></material>", (0.175,) * 3),
        (
            "<material><script><name>Gazebo/Grey</name></script><ambient>.3 .5 .3 1</ambient>"
            "<diffuse>.7 .9 .7 1</diffuse></material>",
            (0.7, 0.9, 0.7),
        ),
        (
            "<material><script><uri>file://media/materials/scripts/gazebo.material</uri><name>Gazebo/Bricks</name>"
            "</script><ambient>1 1 1 1</ambient><diffuse>1 1 1 1</diffuse><emissive>0 0 0 1</emissive></material>",
            (0.60, 0.33, 0.26),
        ),
        (
            "<material><script><name>Gazebo/Wood</name></script><diffuse>.5 .5 .5 1</diffuse></material>",
            (0.285, 0.205, 0.13),
        ),
        ("<material><script><name>__default__</name></script></material>", (0.7, 0.7, 0.7)),
        ("<material><diffuse>0 0 0 1</diffuse><emissive>0 .8 0 1</emissive></material>", (0.0, 0.8, 0.0)),
        ("<material><diffuse>\n 1\n 1\n 0\n 1\n</diffuse><ambient>1 0 1 1</ambient></material>", (1.0, 1.0, 0.0)),
    ],
)
def test_colours_as_gazebo_shows_them(tmp_path: Path, material: str, colour: tuple[float, ...]) -> None:
    assert colour_of(tmp_path, material) == pytest.approx(colour)


def test_glass_is_seen_through_and_stops_the_robot(tmp_path: Path) -> None:
    text = model(
        f"<collision name='c'>{BOX}</collision><visual name='v'>{BOX}<transparency>0.8</transparency></visual>"
    )
    (body,) = read(tmp_path, sdf(text)).bodies
    assert not body.visuals
    assert body.collisions


def test_what_is_only_seen_or_only_felt(tmp_path: Path) -> None:
    seen, felt = f"<visual name='v'>{BOX}</visual>", f"<collision name='c'>{BOX}</collision>"
    world = read(tmp_path, sdf(model(seen, name="hologram") + model(felt, name="invisible")))
    assert [(len(b.visuals), len(b.collisions)) for b in world.bodies] == [(1, 0), (0, 1)]


def test_a_polyline_is_pulled_up_and_has_its_holes(tmp_path: Path) -> None:
    def ring(*points: str) -> str:
        return f"<polyline>{''.join(f'<point>{p}</point>' for p in points)}<height>2</height></polyline>"

    outer, hole = ring("-2 -2", "-2 2", "2 2 ", "2 -2"), ring("-1 -1", "1 -1", "0 1")
    world = read(tmp_path, sdf(model(both(outer + hole, "<material><script>Gazebo/Yellow</script></material>"))))
    cut = slice_bodies(world.bodies, 1.0)
    assert cut.cast(-5.0, 0.0, 0.0, 0.1, 1, longest=50.0)[0] == pytest.approx(3.0)
    assert cut.cast(0.0, 0.0, -math.pi / 2.0, 0.1, 1, longest=50.0)[0] == pytest.approx(1.0)
    assert slice_bodies(world.bodies, 2.1).cast(-5.0, 0.0, 0.0, 0.1, 1, longest=50.0)[0] == 50.0
    shape = world.bodies[0].visuals[0].shape
    assert shape.vertices is not None
    assert shape.faces is not None
    a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert np.linalg.norm(normals[normals[:, 2] > 0.0], axis=1).sum() / 2.0 == pytest.approx(16.0 - 2.0)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert volume == pytest.approx(2.0 * (16.0 - 2.0))  # so all of them face outwards


@pytest.mark.parametrize(
    ("geometry", "sentence"),
    [
        ("<polyline><point>0 0</point><point>1 0</point><height>1</height></polyline>", "at least 3 points, got 2"),
        (
            "<polyline><point>0 0</point><point>1 0</point><point>2 0</point><height>1</height></polyline>",
            "<polyline> encloses nothing",
        ),
        ("<polyline><point>0 0</point></polyline>", "<polyline> has no <height>"),
    ],
)
def test_a_polyline_that_is_no_outline(tmp_path: Path, geometry: str, sentence: str) -> None:
    with pytest.raises(WorldError, match=sentence):
        read(tmp_path, sdf(model(both(geometry))))


def test_capsules_ellipsoids_and_sheets(tmp_path: Path) -> None:
    world = read(
        tmp_path,
        sdf(
            model(both("<capsule><radius>0.2</radius><length>1</length></capsule>"), name="a")
            + model(both("<ellipsoid><radii>0.5 1 2</radii></ellipsoid>"), name="b", more="<pose>0 3 0 0 0 0</pose>")
            + model(both("<box><size>1 1 0</size></box>"), name="c")
        ),
    )
    capsule, ellipsoid, sheet = (body.collisions[0].shape for body in world.bodies)
    assert (capsule.kind, capsule.size) == ("capsule", (0.2, 1.0))
    assert ellipsoid.vertices is not None
    assert ellipsoid.vertices.max(axis=0) == pytest.approx((0.5, 1.0, 2.0))
    assert sheet.size == (1.0, 1.0, 0.001)
    assert slice_bodies(world.bodies, 0.1).cast(-5.0, 3.0, 0.0, 0.1, 1, longest=50.0)[0] == pytest.approx(4.5, abs=0.02)


CAN = model(both("<cylinder><radius>0.03</radius><length>0.12</length></cylinder>"), name="can")


@pytest.mark.parametrize(
    ("region", "count"),
    [
        ("<region><cuboid><min>3 3 0</min><max>4 4 0.1</max></cuboid></region>"
         "<model_count>10</model_count><distribution>random</distribution>", 10),
        ("<pose>3.5 3.5 0 0 0 0</pose><box><size>1 1 0.1</size></box>"
         "<model_count>7</model_count><distribution><type>uniform</type></distribution>", 7),
        ("<region><cylinder><center>3.5 3.5 0</center><radius>0.5</radius><height>0.1</height></cylinder></region>"
         "<model_count>9</model_count><distribution>uniform</distribution>", 9),
        ("<pose>3.5 3.5 0 0 0 0</pose><cylinder><radius>0.5</radius><length>0.1</length></cylinder>"
         "<model_count>6</model_count><distribution><type>linear-x</type></distribution>", 6),
        ("<pose>3.5 3.5 0 0 0 0</pose><distribution><type>grid</type><rows>4</rows><cols>5</cols><step>.25 .25 0</step>"
         "</distribution>", 20),
        ("<pose>3.5 3.5 0 0 0 1.5708</pose><box><size>1 1 0</size></box><model_count>3</model_count>"
         "<distribution><type>linear-y</type></distribution>", 3),
        ("<region><cuboid><min>3 3 0</min><rows>2</rows><cols>3</cols><step>.25 .25 0</step></cuboid></region>"
         "<distribution>grid</distribution>", 6),
    ],
)  # fmt: skip
def test_a_population_stands_in_its_region(tmp_path: Path, region: str, count: int) -> None:
    text = sdf(f"<population name='cans'>{CAN}{region}</population>")
    world = read(tmp_path, text)
    assert [body.name for body in world.bodies] == [f"can_clone_{i}" for i in range(count)]
    places = np.array([body.pose[:2, 3] for body in world.bodies])
    assert places.min() >= 3.0 - 1e-9
    assert places.max() <= 4.0 + 1e-9
    assert len(np.unique(places.round(6), axis=0)) == count
    assert all(np.array_equal(body.pose[:3, :3], np.eye(3)) for body in world.bodies)
    again = read(tmp_path, text)
    assert all(np.array_equal(a.pose, b.pose) for a, b in zip(world.bodies, again.bodies, strict=True))


@pytest.mark.parametrize(
    ("region", "sentence"),
    [
        ("<model_count>3</model_count>", "population 'p': has neither <box> nor <cylinder>"),
        ("<model_count>-1</model_count>", "<model_count>: expected 0 to 5000, got -1"),
        ("<box><size>1 1 1</size></box><distribution><type>heap</type></distribution>", "'heap' is not known"),
        ("<distribution><type>grid</type></distribution>", "a grid has no <rows>"),
    ],
)
def test_a_population_that_makes_no_sense(tmp_path: Path, region: str, sentence: str) -> None:
    with pytest.raises(WorldError, match=sentence):
        read(tmp_path, sdf(f"<population name='p'>{CAN}{region}</population>"))


def actor(*trajectories: str, more: str = "") -> str:
    skin = "<skin><filename>walk.dae</filename><scale>1.0</scale></skin>"
    animation = "<animation name='walking'><filename>walk.dae</filename><interpolate_x>true</interpolate_x></animation>"
    script = f"<script><loop>false</loop><delay_start>0</delay_start>{''.join(trajectories)}</script>"
    return f"<actor name='guest'><pose>9 9 1.2 0 0 0</pose>{skin}{animation}{script}{more}</actor>"


def trajectory(number: int, *points: tuple[float, float, float]) -> str:
    waypoints = "".join(f"<waypoint><time>{t}</time><pose>{x} {y} 1 0 0 0</pose></waypoint>" for t, x, y in points)
    return f"<trajectory id='{number}' type='walking'>{waypoints}</trajectory>"


def test_trajectories_follow_each_other_in_the_world_not_from_the_actor(tmp_path: Path) -> None:
    text = actor(trajectory(1, (0, 4, 0), (4, 4, 3)), trajectory(0, (0, 0, 0), (5, 4, 0), (6, 4, 0)))
    (guest,) = read(tmp_path, sdf(text)).actors
    assert [(p.x, p.y) for p in guest.path] == [(0, 0), (4, 0), (4, 0), (4, 0), (4, 3)]
    assert guest.speed == pytest.approx(7.0 / 10.0)
    assert not guest.loop


def test_an_actor_without_script_stands_where_it_is(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    text = "<actor name='a'><static>false</static><pose>1 2 1.25 0 0 0</pose><plugin name='p' filename='x.so'/></actor>"
    with caplog.at_level(logging.WARNING):
        (standing,) = read(tmp_path, sdf(text)).actors
    assert (standing.pose, standing.path) == ((1.0, 2.0, 0.0), ())
    assert "<plugin> of an actor" in caplog.text


def test_a_model_may_be_an_actor(tmp_path: Path) -> None:
    walk = actor(trajectory(0, (0, 0, 1), (4, 0, -1)))
    put(tmp_path, "passer_by", f"<sdf version='1.6'>{walk}</sdf>")
    text = "<include><uri>model://passer_by</uri><name>anna</name><pose>5 5 0 0 0 0</pose></include>"
    (anna,) = read(tmp_path, sdf(text)).actors
    assert (anna.name, anna.pose[:2], anna.speed) == ("anna", (0.0, 1.0), 0.5)


def test_nobody_runs_faster_than_people_do(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, sdf(actor(trajectory(0, (0, 0, 0), (0.1, 50, 0)))))
    assert world.actors[0].speed == 8.0
    assert "actor 'guest' runs at 500.0 m/s, here at 8.0" in caplog.text
    engine = Engine(world)
    engine.step()
    engine.close()


HINGED = """<model name='side_door'>
<link name='frame'><collision name='c'><pose>0 -0.6 1 0 0 0</pose>
  <geometry><box><size>0.1 0.1 2</size></box></geometry></collision></link>
<link name='door'><pose>0 0 2 3.14159265 0 0</pose>
  <collision name='c'><pose>0 -0.4 1 0 0 0</pose>
  <geometry><box><size>0.04 0.8 2</size></box></geometry></collision></link>
<link name='handles'><pose>0 0.7 1 0 0 0</pose>
  <visual name='v'><geometry><box><size>0.2 0.05 0.05</size></box></geometry></visual></link>
<joint name='handle' type='revolute'><parent>door</parent><child>handles</child>
  <axis><xyz>1 0 0</xyz><use_parent_model_frame>true</use_parent_model_frame></axis></joint>
<joint name='hinge' type='revolute'><parent>frame</parent><child>door</child>
  <axis><xyz>0 0 1</xyz><limit><lower>0</lower><upper>1.2</upper></limit>%s</axis></joint>
</model>"""


@pytest.mark.parametrize(
    ("version", "more", "swing"),
    [
        ("1.5", "<use_parent_model_frame>true</use_parent_model_frame>", 1.2),
        ("1.4", "", 1.2),
        ("1.6", "", -1.2),
    ],
)
def test_a_door_opens_about_the_axis_of_the_frame_that_its_version_means(
    tmp_path: Path, version: str, more: str, swing: float
) -> None:
    world = read(tmp_path, sdf(HINGED % more, version=version))
    (door,) = world.doors
    assert door.swing == pytest.approx(swing)
    assert [body.name for body in world.bodies] == ["side_door/frame"]
    (handle,) = door.body.visuals
    assert (door.body.pose @ handle.pose)[:3, 3] == pytest.approx((0.0, 0.7, 1.0))


def test_a_door_s_axis_may_be_of_another_frame(tmp_path: Path) -> None:
    text = (HINGED % "").replace("<xyz>0 0 1<", "<xyz expressed_in='__model__'>0 0 1<")
    (door,) = read(tmp_path, sdf(text, version="1.7")).doors
    assert door.swing == pytest.approx(1.2)


def test_a_leaf_may_be_a_mesh(tmp_path: Path) -> None:
    points = [(x, y, z) for z in (0.0, 2.0) for x, y in ((-0.02, 0.0), (0.02, 0.0), (0.02, -0.8), (-0.02, -0.8))]
    faces = "".join(f"f {i} {j} {j + 4}\nf {i} {j + 4} {i + 4}\n" for i, j in ((1, 2), (2, 3), (3, 4), (4, 1)))
    (tmp_path / "leaf.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in points) + faces)
    leaf = "<collision name='c'><geometry><mesh><uri>leaf.obj</uri></mesh></geometry></collision>"
    text = (HINGED % "").replace("<pose>0 0 2 3.14159265 0 0</pose>", "")
    begin = text.index("<collision name='c'><pose>0 -0.4")
    text = text[:begin] + leaf + text[text.index("</link>", begin) :]
    engine = Engine(read(tmp_path, sdf(text)))
    engine.population.set_door("side_door/door", 1.0, 0.0)
    engine.step()
    assert engine.population.doors[0].opening == 1.0
    engine.close()


def test_a_locked_joint_is_no_door(tmp_path: Path) -> None:
    text = (HINGED % "").replace("<upper>1.2<", "<upper>0<")
    world = read(tmp_path, sdf(text))
    assert not world.doors
    assert len(world.bodies) == 3


def test_a_house_on_a_slab_is_let_down_to_the_ground(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    walls = "".join(
        f"<collision name='{i}'><pose>{x} {y} 1.4 0 0 0</pose><geometry><box><size>{size} 2.8</size></box></geometry>"
        "</collision>"
        for i, (x, y, size) in enumerate([(-3, 0, "0.1 8"), (3, 0, "0.1 8"), (0, -4, "6 0.1"), (0, 4, "6 0.1")])
    )
    slab = "<collision name='floor'><geometry><box><size>7 9 0.19</size></box></geometry></collision>"
    ground = model("<collision name='c'><geometry><plane/></geometry></collision>", name="ground_plane")
    with caplog.at_level(logging.INFO):
        world = read(tmp_path, sdf(ground + model(slab + walls, name="tea_room")))
    assert body_of(world, "tea_room").pose[2, 3] == pytest.approx(-0.095)
    assert "stands on a floor of 0.095 m" in caplog.text
    engine = Engine(world)
    engine.spawn_robot(load_robot(ROBOT))
    for _ in range(20):
        engine.step()
    assert not engine.touches()
    engine.close()


def test_a_stage_in_a_hall_stays_a_stage(tmp_path: Path) -> None:
    stage = model(both("<box><size>4 4 0.3</size></box>"), name="stage", more="<pose>10 0 0.15 0 0 0</pose>")
    chairs = "".join(
        model(both("<box><size>.5 .5 .5</size></box>"), name=f"chair_{i}", more=f"<pose>{i} 0 .25 0 0 0</pose>")
        for i in range(4)
    )
    assert body_of(read(tmp_path, sdf(stage + chairs)), "stage").pose[2, 3] == 0.15
