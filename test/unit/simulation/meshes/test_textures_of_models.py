"""What textures and material scripts of models come to here: a mean colour."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rosbot_patrol.simulation.meshes.colours import mean_colour
from rosbot_patrol.simulation.meshes.files import load_parts
from rosbot_patrol.simulation.sdf.world import load_world

LAMP = Path(__file__).parents[1] / "data" / "models" / "lamp" / "meshes" / "lamp.dae"
SPHERE = "<geometry><sphere><radius>1</radius></sphere></geometry>"
SCRIPT = """
// wood of ours
material Ours/Wood { // not like this: the brace is on its own line
}
material Ours/Oak
{
  technique
  {
    pass
    {
      ambient 0.1 0.1 0.1 1
      diffuse 1 1 1 1
      texture_unit { texture none }
      texture_unit
      {
        texture oak.png
      }
    }
  }
}
material Ours/Paint
{
  technique
  {
    pass
    {
      ambient 0.9 0.9 0.9 1.0
      diffuse 0.2 0.4 0.6 1.0
    }
  }
}
"""


def paint(file: Path, *colours: tuple[int, ...]) -> Path:
    """A picture of one column for each colour."""
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.array([colours], np.uint8)).save(file)
    return file


def colour_of(tmp_path: Path, name: str, uris: str) -> tuple[float, ...]:
    script = f"<material><script>{uris}<name>{name}</name></script></material>"
    visual = f"<visual name='v'>{SPHERE}{script}</visual>"
    file = tmp_path / "worlds" / "a.world"
    file.parent.mkdir(exist_ok=True)
    file.write_text(
        f"<sdf version='1.6'><world name='w'><model name='m'><link name='l'>{visual}</link></model></world></sdf>"
    )
    return load_world(file).bodies[0].visuals[0].material.rgba


def test_the_mean_of_a_picture_leaves_out_what_is_transparent(tmp_path: Path) -> None:
    opaque = paint(tmp_path / "a.png", (200, 0, 0), (0, 100, 0))
    assert mean_colour(opaque) == pytest.approx((100 / 255, 50 / 255, 0, 1), abs=0.01)
    half = paint(tmp_path / "b.png", (200, 100, 0, 255), (0, 0, 255, 0))
    assert mean_colour(half) == pytest.approx((200 / 255, 100 / 255, 0, 1), abs=0.02)


def test_a_texture_that_is_no_picture_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "c.png").write_bytes(b"no picture")
    with caplog.at_level(logging.WARNING):
        assert mean_colour(tmp_path / "c.png") is None
    assert "c.png: the texture cannot be read" in caplog.text


def test_a_model_s_own_material_script(tmp_path: Path) -> None:
    materials = tmp_path / "models" / "cupboard" / "materials"
    (materials / "scripts").mkdir(parents=True)
    (materials / "scripts" / "ours.material").write_text(SCRIPT)
    paint(materials / "textures" / "oak.png", (150, 100, 50))
    uris = "<uri>model://cupboard/materials/scripts</uri><uri>model://cupboard/materials/textures</uri>"
    assert colour_of(tmp_path, "Ours/Oak", uris) == pytest.approx((150 / 255, 100 / 255, 50 / 255, 1), abs=0.01)
    assert colour_of(tmp_path, "Ours/Paint", uris) == pytest.approx((0.2, 0.4, 0.6, 1.0))
    one = "<uri>model://cupboard/materials/scripts/ours.material</uri>"
    assert colour_of(tmp_path, "Ours/Paint", one) == pytest.approx((0.2, 0.4, 0.6, 1.0))


def test_a_script_that_is_not_there_is_named_and_drawn_grey(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        assert colour_of(tmp_path, "Ours/Gone", "<uri>model://gone/scripts</uri>")[:3] == (0.7, 0.7, 0.7)
    assert "the material script 'Ours/Gone'" in caplog.text


def test_an_obj_with_a_texture(tmp_path: Path) -> None:
    paint(tmp_path / "tex.png", (10, 200, 100))
    (tmp_path / "a.mtl").write_text("newmtl x\nKd 1 1 1\nmap_Kd tex.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (part,) = load_parts(tmp_path / "a.obj")
    assert part.rgba == pytest.approx((10 / 255, 200 / 255, 100 / 255, 1), abs=0.01)


@pytest.mark.parametrize("folder", ["meshes", "materials/textures"])
def test_a_dae_with_a_texture_beside_it_or_among_the_materials(tmp_path: Path, folder: str) -> None:
    paint(tmp_path / folder / "cloth.png", (200, 180, 120))
    effect = (
        '<newparam sid="s"><surface type="2D"><init_from>cloth</init_from></surface></newparam>'
        '<newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>'
        '<technique sid="t"><lambert><diffuse><texture texture="p" texcoord="UV"/></diffuse></lambert></technique>'
    )
    plain = '<technique sid="t"><lambert><diffuse><color>0.9 0.85 0.6 1</color></diffuse></lambert></technique>'
    images = '<library_images><image id="cloth"><init_from>cloth.png</init_from></image></library_images>'
    text = LAMP.read_text().replace(plain, effect).replace("<library_effects>", images + "<library_effects>")
    file = tmp_path / "meshes" / "lamp.dae"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    parts = {part.name: part for part in load_parts(file)}
    assert parts["hood"].rgba == pytest.approx((200 / 255, 180 / 255, 120 / 255, 1), abs=0.01)
    assert parts["stand"].rgba == pytest.approx((0.1, 0.1, 0.1, 1.0))
