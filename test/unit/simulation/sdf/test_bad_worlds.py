"""Worlds that make no sense: one sentence each, with the file and the element."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.meshes.files import load_parts
from rosbot_patrol.simulation.sdf.world import World, load_world

BOX = "<geometry><box><size>1 2 3</size></box></geometry>"


def sdf(inside: str, *, version: str = "1.6") -> str:
    return f"<?xml version='1.0'?><sdf version='{version}'><world name='w'>{inside}</world></sdf>"


def model(inside: str, *, name: str = "m") -> str:
    return f"<model name='{name}'>{inside}</model>"


def part(geometry: str, *, kind: str = "collision", more: str = "") -> str:
    return sdf(model(f"<link name='l'><{kind} name='c'><geometry>{geometry}</geometry>{more}</{kind}></link>"))


def read(folder: Path, text: str) -> World:
    file = folder / "a.world"
    file.write_text(text, encoding="utf-8")
    return load_world(file)


def include(folder: Path, name: str, content: str) -> None:
    """A model in folder/models."""
    home = folder / "models" / name
    home.mkdir(parents=True, exist_ok=True)
    (home / "model.sdf").write_text(content)


WHOLE = sdf(model(f"<link name='l'><collision name='c'>{BOX}</collision></link>"))
STANDING = "<geometry><mesh><uri>model://person_standing/meshes/s.dae</uri></mesh></geometry>"
NESTED = "model 'm', link 'l', collision 'c'"
SEEN = "model 'm', link 'l', visual 'c'"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is not XML, or not all of it: no element found: line 1, column 0"),
        ("hello", "is not XML, or not all of it: syntax error: line 1, column 0"),
        (WHOLE[: len(WHOLE) // 2], "is not XML, or not all of it: "),
        ("<?xml version='1.0' encoding='klingon'?><sdf/>", "is not XML, or not all of it: "),
        ("<robot name='r'/>", "is no SDF file, its first element is <robot>"),
        ("<sdf version='1.6'><model name='m'/></sdf>", "has no <world> element"),
        (part("<box><size>1 nan 1</size></box>"), f"{NESTED}, <size>: expected 3 numbers, got '1 nan 1'"),
        (part("<box><size>1 inf 1</size></box>"), f"{NESTED}, <size>: expected 3 numbers, got '1 inf 1'"),
        (part("<box><size>1 -2 1</size></box>"), f"{NESTED}, <size>: expected positive numbers, got '1 -2 1'"),
        (part("<sphere><radius>0</radius></sphere>"), f"{NESTED}, <radius>: expected positive numbers, got '0'"),
        (part("<sphere><radius>a</radius></sphere>"), f"{NESTED}, <radius>: expected one number, got 'a'"),
        (part("<cylinder><radius>1</radius></cylinder>"), f"{NESTED}: <cylinder> has no <length>"),
        (part("<plane><normal>0 0 0</normal></plane>"), f"{NESTED}, <normal>: expected a direction, got '0 0 0'"),
        (part("<plane><size>-1 1</size></plane>"), f"{NESTED}, <size>: expected positive numbers, got '-1 1'"),
        (part(""), f"{NESTED}: has no geometry"),
        (
            part(
                "<sphere><radius>1</radius></sphere>",
                kind="visual",
                more="<material><diffuse>1 x 0</diffuse></material>",
            ),
            f"{SEEN}, <diffuse>: expected 3 or 4 numbers, got '1 x 0'",
        ),
        (
            part("<sphere><radius>1</radius></sphere>", kind="visual", more="<transparency>much</transparency>"),
            f"{SEEN}, <transparency>: expected one number, got 'much'",
        ),
        (
            sdf(model("<pose>0 0 0 0 0</pose><link name='l'/>")),
            "model 'm', <pose>: expected 6 numbers, got '0 0 0 0 0'",
        ),
        (sdf(model("<link name='l'><pose>0 0 0 0 0 nan</pose></link>")), "link 'l', <pose>: expected 6 numbers"),
        (sdf("<model><link name='l'/></model>"), "a <model> has no name"),
        (
            sdf(model("<link name='l'/>") + "<state><model name='m'><pose>1 2</pose></model></state>"),
            "state of model 'm', <pose>: expected 6 numbers, got '1 2'",
        ),
        (
            sdf(model("<link name='l'/>") + "<state><model name='m'><scale>1 0 1</scale></model></state>"),
            "state of model 'm', <scale>: expected positive numbers, got '1 0 1'",
        ),
        (
            sdf(
                "<actor name='a'><script><trajectory><waypoint><time>x</time><pose>0 0 0 0 0 0</pose></waypoint>"
                "</trajectory></script></actor>"
            ),
            "actor 'a', waypoint 0, <time>: expected one number, got 'x'",
        ),
        (
            sdf(
                model(
                    "<frame name='a'><pose relative_to='b'>0 0 0 0 0 0</pose></frame>"
                    "<frame name='b'><pose relative_to='a'>0 0 0 0 0 0</pose></frame>"
                    "<link name='l'><pose relative_to='a'>0 0 0 0 0 0</pose></link>"
                ),
                version="1.7",
            ),
            "the frames are relative to each other in a circle: a -> b -> a",
        ),
        (
            sdf("<model name='m' placement_frame='nothing'><link name='l'/></model>", version="1.7"),
            "model 'm': there is no frame 'nothing'",
        ),
    ],
)
def test_a_sentence_with_file_and_element(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(WorldError, match=r"a\.world: ") as caught:
        read(tmp_path, text)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (
            "<sdf version='1.6'><model name='c'><link name='l'><collision name='s'><geometry><box/></geometry>"
            "</collision></link></model></sdf>",
            "chair/model.sdf: model 'chair_1', link 'l', collision 's': <box> has no <size>",
        ),
        (
            "<sdf version='1.6'><model name='c'><include><uri>model://chair</uri></include></model></sdf>",
            "the models include each other in a circle: chair -> chair",
        ),
    ],
)
def test_an_included_model_that_makes_no_sense(tmp_path: Path, content: str, sentence: str) -> None:
    include(tmp_path, "chair", content)
    with pytest.raises(WorldError) as caught:
        read(tmp_path, sdf("<include><uri>model://chair</uri><name>chair_1</name></include>"))
    assert sentence in str(caught.value)


def test_models_that_include_each_other_are_a_circle(tmp_path: Path) -> None:
    for name, other in (("hen", "egg"), ("egg", "hen")):
        text = f"<sdf version='1.6'><model name='{name}'><include><uri>model://{other}</uri></include></model></sdf>"
        include(tmp_path, name, text)
    with pytest.raises(WorldError, match=r"in a circle: hen -> egg -> hen"):
        read(tmp_path, sdf("<include><uri>model://hen</uri></include>"))


def test_a_missing_colour_library_costs_the_colours_only(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with caplog.at_level(logging.WARNING):
        (mesh,) = load_parts(tmp_path / "a.obj")
    assert mesh.rgba is None
    assert "gone.mtl: the colours of the mesh cannot be read" in caplog.text


def test_a_frame_that_is_not_known_is_told_and_taken_as_the_parent(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = sdf(model("<link name='l'><pose relative_to='moon'>1 0 0 0 0 0</pose></link>"), version="1.7")
    with caplog.at_level(logging.WARNING):
        world = read(tmp_path, text)
    assert world.bodies[0].pose[0, 3] == 1.0
    assert "model 'm', link 'l': the pose is relative to 'moon', which is not known" in caplog.text


def test_what_is_unknown_is_named_once_for_the_whole_world(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    inside = (
        "<blimp name='r'/><population name='p'/>"
        + model("<link name='l'><projector name='x'/><inertial/></link><gripper name='g'/>", name="a")
        + model(
            "<link name='l'><projector name='x'/><visual name='v'><geometry><heightmap/></geometry></visual>"
            "<visual name='u'><geometry><sphere><radius>1</radius></sphere></geometry>"
            "<material><script><name>My/Own</name></script></material></visual></link>",
            name="b",
        )
    )
    with caplog.at_level(logging.WARNING):
        read(tmp_path, sdf(inside))
    (record,) = caplog.records
    named = "<blimp>, <gripper> of a model, <heightmap> geometry (make it a mesh), <population>, <projector> of a link"
    assert record.getMessage().endswith(f"skipped, not simulated here: {named}, the material script 'My/Own'")


def test_lights_are_noted_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        read(tmp_path, sdf("<light name='a'/><light name='b'/><include><uri>model://sun</uri></include>"))
    (record,) = caplog.records
    assert record.levelno == logging.INFO
    assert "3 lights are not simulated" in record.getMessage()


def test_a_model_that_was_deleted_or_inserted_while_gazebo_ran(tmp_path: Path) -> None:
    new = model("<link name='l'/>", name="new")
    state = f"<state><insertions>{new}</insertions><deletions><name>m</name></deletions></state>"
    world = read(tmp_path, sdf(model("<link name='l'/>") + state))
    assert [body.name for body in world.bodies] == ["new"]


@pytest.mark.parametrize(
    ("name", "inside", "is_actor"),
    [
        ("person_walking_clone", "", True),
        ("visitor", f"<link name='l'><visual name='v'>{STANDING}</visual></link>", True),
        ("Fire Hydrant 2", "", True),
        ("personal_locker", "<link name='l'/>", False),
    ],
)
def test_who_becomes_an_actor(tmp_path: Path, name: str, inside: str, is_actor: bool) -> None:
    world = read(tmp_path, sdf(model(inside, name=name)))
    assert len(world.actors) == is_actor
    assert len(world.bodies) == (not is_actor)
