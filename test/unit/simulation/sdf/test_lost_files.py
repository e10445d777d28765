"""Models and meshes that are missing or broken: Gazebo reports them and goes on, and so does the simulator."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import World, load_world

DATA = Path(__file__).parents[1] / "data"
LAMP = (DATA / "models" / "lamp" / "meshes" / "lamp.dae").read_bytes()
ROBOT = Path(__file__).parents[4] / "urdf" / "rosbot.urdf"
BOX = "<geometry><box><size>1 1 1</size></box></geometry>"
CRATE = f"<model name='crate'><link name='l'><collision name='c'>{BOX}</collision></link></model>"


def sdf(inside: str) -> str:
    return f"<sdf version='1.6'><world name='w'>{inside}</world></sdf>"


def mesh(uri: str, kind: str = "collision", name: str = "thing") -> str:
    part = f"<{kind} name='c'><geometry><mesh><uri>{uri}</uri></mesh></geometry></{kind}>"
    return f"<model name='{name}'><link name='l'>{part}</link></model>"


def include(uri: str) -> str:
    return f"<include><uri>{uri}</uri></include>"


def read(folder: Path, inside: str) -> World:
    """A world with a crate and more in it: the crate always stands there."""
    file = folder / "a.world"
    file.write_text(sdf(inside + CRATE), encoding="utf-8")
    world = load_world(file, [DATA / "models"])
    assert any(body.name == "crate" and body.collisions for body in world.bodies)
    return world


def put(folder: Path, name: str, **files: str) -> None:
    """A model in folder/models, with its files by their names (_ for a dot)."""
    home = folder / "models" / name
    home.mkdir(parents=True)
    for file, text in files.items():
        (home / file.replace("_", ".")).write_text(text)


@pytest.mark.parametrize(
    ("inside", "sentence"),
    [
        (mesh("no.dae"), "model 'thing', link 'l', collision 'c', mesh: 'no.dae' is missing (looked for "),
        (mesh("model://x/no.dae"), "'model://x/no.dae' is missing (looked for "),
        (mesh("file:///no.stl"), "'file:///no.stl' is missing (looked for /no.stl)"),
        (mesh("file://meshes/no.stl"), "'file://meshes/no.stl' is missing (looked for "),
        (mesh(""), "collision 'c': <mesh> has no <uri>"),
        (mesh("x" * 300 + ".stl"), "is missing (looked for "),
        (include("model://chair"), "<include> of model://chair: 'model://chair' is missing (looked for "),
        (include("file://models/chair"), "<include> of file://models/chair: 'file://models/chair' is missing"),
        (include("https://fuel.example.org/models/chair"), "models of the web are not fetched: download it"),
        (include(""), "<include> of : has no <uri>"),
    ],
)
def test_what_is_missing_is_left_out(
    tmp_path: Path, inside: str, sentence: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, inside)
    (lost,) = world.lost
    assert lost.startswith(f"{tmp_path}/a.world: ")
    assert sentence in lost
    assert "\n" not in lost
    told, count = (record.getMessage() for record in caplog.records)
    assert told == lost
    assert count.startswith(f"{tmp_path}/a.world: 1 file cannot be used: 1 ")


@pytest.mark.parametrize(
    ("files", "sentence"),
    [
        ({}, "models/chair is no model, it has neither model.config nor model.sdf"),
        ({"model_sdf": "<sdf version='1.6'/>"}, "chair/model.sdf: has no <model> element"),
        ({"model_sdf": "<sdf version='1.6'><model"}, "chair/model.sdf: is not XML, or not all of it"),
        ({"model_sdf": ""}, "chair/model.sdf: is not XML, or not all of it"),
        ({"model_sdf": "<robot name='r'/>"}, "chair/model.sdf: is no SDF file"),
        ({"model_config": "<model/>"}, "chair/model.config: has no <sdf> that names the model's file"),
        ({"model_config": "<model><sdf version='1.5'>a.sdf</sdf></model>"}, "names the file 'a.sdf', which is missing"),
        ({"model_config": "<model><sdf"}, "chair/model.config: is not XML, or not all of it"),
        ({"model_config": "name = chair", "model_sdf": sdf(CRATE)}, "chair/model.config: is not XML"),
    ],
)
def test_a_broken_model_is_left_out(tmp_path: Path, files: dict[str, str], sentence: str) -> None:
    put(tmp_path, "chair", **files)
    world = read(tmp_path, include("model://chair"))
    (lost,) = world.lost
    assert sentence in lost
    assert "a.world: <include> of model://chair: " in lost
    assert len(world.bodies) == 1


@pytest.mark.parametrize("kind", ["collision", "visual"])
@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.stl", b"solid x\nvertex 0 0\n", "the mesh is broken"),
        ("a.stl", b"", "the mesh is broken: 0 bytes do not fit"),
        ("a.stl", b"solid \xff\xfe\nvertex a b c\n", "the mesh is broken"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "the mesh is broken: a vertex is not finite"),
        ("a.obj", b"v 0 0 0\nf 1 2 99999999999999999999\n", "the mesh is broken"),
        ("a.dae", b"", "the mesh is broken"),
        ("a.dae", b"<COLLADA", "the mesh is broken"),
        ("a.dae", LAMP[:2000], "the mesh is broken"),
        ("a.dae", LAMP.replace(b'count="24">', b'count="24">x '), "the mesh is broken"),
        ("a.dae", LAMP.replace(b"#scene", b"#nowhere"), "the mesh"),
        ("a.fbx", b"x", "is no mesh that can be read here (stl, obj and dae are)"),
    ],
)
def test_a_broken_mesh_is_left_out(tmp_path: Path, name: str, content: bytes, sentence: str, kind: str) -> None:
    (tmp_path / name).write_bytes(content)
    (lost,) = read(tmp_path, mesh(name, kind)).lost
    assert f"a.world: model 'thing', link 'l', {kind} 'c': {tmp_path / name}: " in lost
    assert sentence in lost
    assert "\n" not in lost


def test_a_folder_in_the_place_of_a_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.stl").mkdir()
    (lost,) = read(tmp_path, mesh("a.stl")).lost
    assert "the mesh cannot be read: Is a directory" in lost


def test_an_include_of_an_include(tmp_path: Path) -> None:
    """The outer model stands without the inner one."""
    put(
        tmp_path, "room", model_sdf=f"<sdf version='1.6'><model name='r'>{include('model://gone')}{CRATE}</model></sdf>"
    )
    world = read(tmp_path, include("model://room"))
    assert any(body.name == "r::crate" for body in world.bodies)
    (lost,) = world.lost
    assert "room/model.sdf: model 'r', <include> of model://gone: 'model://gone' is missing" in lost


def test_a_file_beside_the_world_is_found(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "lamp.dae").write_bytes(LAMP)
    world = read(tmp_path, mesh("file://meshes/lamp.dae"))
    assert not world.lost
    assert all(body.collisions for body in world.bodies)


def test_each_file_is_one_line_and_the_last_line_counts(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    parts = "".join(
        f"<{kind} name='c'><geometry><mesh><uri>model://sofa/sofa.dae</uri></mesh></geometry></{kind}>"
        for kind in ("visual", "collision")
    )
    sofas = "".join(f"<model name='sofa_{i}'><link name='l'>{parts}</link></model>" for i in range(3))
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, sofas + "".join(map(include, ("model://pr2", "sun", "model://house_1", "model://pr2"))))
    sofa, pr2, house = world.lost
    assert "model 'sofa_0', link 'l', visual 'c', mesh: 'model://sofa/sofa.dae' is missing" in sofa
    assert sofa.endswith("(wanted in 5 more places)")
    assert pr2.endswith("(wanted in 1 more place)")
    assert "GAZEBO_MODEL_PATH or the parameter model_path" in house
    assert [record.getMessage() for record in caplog.records[:-1]] == [sofa, pr2, house]
    assert caplog.records[-1].getMessage() == (
        f"{tmp_path}/a.world: 3 files cannot be used: 3 models left out, 3 collisions left out, "
        "3 visuals shown by collision shapes"
    )


@pytest.mark.parametrize("uri", ["meshes/a.stl", "file://meshes/a.stl"])
def test_files_of_one_name_in_two_models_are_two(tmp_path: Path, uri: str) -> None:
    for name in ("cup", "jug"):
        put(tmp_path, name, model_sdf=f"<sdf version='1.6'>{mesh(uri, name=name)}</sdf>")
    world = read(tmp_path, include("model://cup") + include("model://jug"))
    assert len(world.lost) == 2


def test_a_visual_without_its_mesh_shows_the_collisions(tmp_path: Path) -> None:
    lost = "<geometry><mesh><uri>model://sofa/sofa.dae</uri></mesh></geometry>"
    seen = f"<visual name='v'><pose>9 9 9 0 0 0</pose>{lost}</visual>"
    inside = f"<model name='sofa'><link name='l'><collision name='c'>{BOX}</collision>{seen}</link></model>"
    world = read(tmp_path, inside + mesh("model://sofa/sofa.dae", "visual", "picture"))
    by_name = {body.name: body for body in world.bodies}
    (visual,) = by_name["sofa"].visuals
    assert (visual.shape.kind, visual.shape.size) == ("box", (1.0, 1.0, 1.0))
    assert not by_name["picture"].visuals


def test_the_robot_drives_where_a_collision_is_lost(tmp_path: Path) -> None:
    world = read(tmp_path, mesh("gone.stl", name="wall") + include("model://gone"))
    engine = Engine(world)
    try:
        engine.spawn_robot(load_robot(ROBOT), Pose2D(3.0, 0.0, 0.0))
        engine.step()
    finally:
        engine.close()


def test_the_world_itself_has_to_be_one(tmp_path: Path) -> None:
    (tmp_path / "a.world").write_text("no XML at all")
    with pytest.raises(WorldError, match="is not XML"):
        load_world(tmp_path / "a.world")


@pytest.mark.parametrize("world", sorted((ROBOT.parents[1] / "worlds").glob("*.world")), ids=lambda path: path.stem)
def test_our_own_worlds_lack_nothing(world: Path) -> None:
    assert load_world(world).lost == ()
