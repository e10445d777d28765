"""SDF worlds: what is read, what is skipped, and the sentence for what makes no sense."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.scene.matrices import to_pose2d
from rosbot_patrol.simulation.sdf.world import World, load_world

HOUSE = Path(__file__).parents[4] / "worlds" / "house.world"

BOX = "<geometry><box><size>1 2 3</size></box></geometry>"


def sdf(inside: str, *, version: str = "1.6") -> str:
    return f"<?xml version='1.0'?><sdf version='{version}'><world name='w'>{inside}</world></sdf>"


def model(inside: str, *, name: str = "thing", pose: str = "0 0 0 0 0 0") -> str:
    return f"<model name='{name}'><static>1</static><pose>{pose}</pose>{inside}</model>"


def link(inside: str, *, name: str = "link", pose: str = "0 0 0 0 0 0") -> str:
    return f"<link name='{name}'><pose>{pose}</pose>{inside}</link>"


def read(tmp_path: Path, text: str, **options: object) -> World:
    file = tmp_path / "a.world"
    file.write_text(text, encoding="utf-8")
    return load_world(file, **options)  # type: ignore[arg-type]


def collision(geometry: str = BOX, pose: str = "0 0 0 0 0 0") -> str:
    return f"<collision name='c'><pose>{pose}</pose>{geometry}</collision>"


def test_poses_of_model_link_and_shape_add_up(tmp_path: Path) -> None:
    text = model(link(collision(pose="1 0 0 0 0 0"), pose="0 1 0 0 0 0"), pose=f"10 0 0 0 0 {math.pi / 2}")
    body = read(tmp_path, sdf(text)).bodies[0]
    assert body.name == "thing"
    assert body.kind == "furniture"
    placed = body.pose @ body.collisions[0].pose
    assert np.allclose(placed[:3, 3], (9.0, 1.0, 0.0))


def test_every_shape_is_read(tmp_path: Path) -> None:
    shapes = [
        ("<cylinder><radius>0.5</radius><length>2</length></cylinder>", "cylinder", (0.5, 2.0)),
        ("<sphere><radius>0.3</radius></sphere>", "sphere", (0.3,)),
        ("<plane><normal>0 0 1</normal><size>4 5</size></plane>", "plane", (4.0, 5.0)),
    ]
    for geometry, kind, size in shapes:
        shape = (
            read(tmp_path, sdf(model(link(collision(f"<geometry>{geometry}</geometry>")))))
            .bodies[0]
            .collisions[0]
            .shape
        )
        assert (shape.kind, shape.size) == (kind, size)


def test_a_model_of_several_links_gives_a_body_each(tmp_path: Path) -> None:
    text = model(link(collision(), name="Wall_1") + link(collision(), name="Wall_2"), name="house")
    world = read(tmp_path, sdf(text))
    assert [(b.name, b.kind) for b in world.bodies] == [("house/Wall_1", "wall"), ("house/Wall_2", "wall")]


def test_state_overrides_poses(tmp_path: Path) -> None:
    state = "<state world_name='w'><model name='thing'><pose>3 4 0 0 0 1</pose></model></state>"
    body = read(tmp_path, sdf(model(link(collision())) + state)).bodies[0]
    assert to_pose2d(body.pose) == pytest.approx((3.0, 4.0, 1.0))


def test_a_mesh_is_looked_up_beside_the_world_and_by_model_path(tmp_path: Path) -> None:
    (tmp_path / "m" / "chair" / "meshes").mkdir(parents=True)
    file = tmp_path / "m" / "chair" / "meshes" / "a.stl"
    file.write_bytes(bytes(80) + (1).to_bytes(4, "little") + bytes(50))
    geometry = "<geometry><mesh><uri>model://chair/meshes/a.stl</uri><scale>2 2 2</scale></mesh></geometry>"
    world = read(tmp_path, sdf(model(link(collision(geometry)))), model_path=[tmp_path / "m"])
    shape = world.bodies[0].collisions[0].shape
    assert shape.mesh == file
    assert shape.size == (2.0, 2.0, 2.0)


def test_an_included_model_is_found_and_renamed(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "box"
    folder.mkdir(parents=True)
    (folder / "model.sdf").write_text(f"<sdf version='1.6'>{model(link(collision()), name='box')}</sdf>")
    text = sdf("<include><uri>model://box</uri><name>mine</name><pose>1 2 0 0 0 0</pose></include>")
    body = read(tmp_path, text, model_path=[tmp_path / "models"]).bodies[0]
    assert body.name == "mine"
    assert to_pose2d(body.pose) == (1.0, 2.0, 0.0)


@pytest.mark.parametrize(
    "text",
    [
        "<include><uri>model://person_walking</uri><pose>7 5 0 0 0 0.5</pose></include>",
        model(link(collision()), name="person_walking", pose="7 5 0 0 0 0.5"),
    ],
)
def test_a_person_becomes_an_actor(tmp_path: Path, text: str) -> None:
    world = read(tmp_path, sdf(text))
    assert not world.bodies
    (actor,) = world.actors
    assert (actor.name, actor.model) == ("person_walking", "person")
    assert actor.pose == pytest.approx((7.0, 5.0, 0.5))


def test_unknown_elements_are_named_in_one_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    text = "<light name='l'/><gravity>0 0 -9.8</gravity><blimp name='r'/>" + model(link("<sensor name='s'/>"))
    with caplog.at_level(logging.WARNING):
        read(tmp_path, sdf(text))
    (record,) = caplog.records
    assert "<blimp>" in record.getMessage()
    assert "<sensor> of a link" in record.getMessage()
    assert "light" not in record.getMessage()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("no xml at all", "is not XML"),
        ("<robot name='r'/>", "is no SDF file"),
        ("<sdf version='1.6'/>", "has no <world>"),
        (sdf(model(link(collision(pose="1 2 x 0 0 0")))), "model 'thing', link 'link', collision 'c', <pose>"),
        (sdf(model(link(collision("<geometry><box><size>1 2</size></box></geometry>")))), "expected 3 numbers"),
        (sdf(model(link(collision("<geometry><box><size>1 -2 1</size></box></geometry>")))), "positive"),
        (sdf(model(link(collision("<geometry><box/></geometry>")))), "has no <size>"),
        (sdf(model(link(collision("")))), "has no geometry"),
        (sdf("<model/>"), "has no name"),
    ],
)
def test_what_makes_no_sense_is_told_with_file_and_element(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(WorldError, match=r"a\.world") as caught:
        read(tmp_path, text)
    assert words in str(caught.value)


def test_a_missing_world_is_told() -> None:
    with pytest.raises(WorldError, match=r"/nowhere\.world: cannot be read"):
        load_world("/nowhere.world")


def test_the_house_has_its_walls_and_furniture() -> None:
    world = load_world(HOUSE)
    kinds = [b.kind for b in world.bodies]
    assert sum(len(b.collisions) for b in world.bodies if b.kind == "wall") == 33
    assert kinds.count("floor") == 1
    assert kinds.count("furniture") == 27
