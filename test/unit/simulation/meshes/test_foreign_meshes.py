"""COLLADA as the programs write it that Gazebo's models come from: the files here are ours, the forms are theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.simulation.meshes.files import load_mesh, load_parts
from rosbot_patrol.simulation.scene.shapes import sharp_normals

QUADS = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
INPUTS = (
    "<input semantic='VERTEX' source='#ver' offset='0'/><input semantic='NORMAL' source='#nor' offset='1'/>"
    "<input semantic='TEXCOORD' source='#tex' offset='2' set='0'/>"
)
SCENE = "<scene><instance_visual_scene url='#S'/></scene>"
RED = "<diffuse><color>0.8 0.1 0.1 1</color></diffuse>"


def source(name: str, axes: str, numbers: np.ndarray) -> str:
    params = "".join(f"<param name='{axis}' type='float'/>" for axis in axes)
    rows, stride = numbers.shape
    return (
        f"<source id='{name}'><float_array id='{name}-a' count='{numbers.size}'>\n"
        f"{' '.join(map(str, numbers.ravel()))}\n</float_array><technique_common><accessor source='#{name}-a' "
        f"count='{rows}' stride='{stride}'>{params}</accessor></technique_common></source>"
    )


def cube(side: float = 1.0) -> str:
    """Sources of a cube that stands on z = 0."""
    low = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    points = np.vstack([np.column_stack((low, np.full(4, z))) for z in (0.0, 1.0)]) * side
    normals = np.array([(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)], float)
    return (
        source("pos", "XYZ", points) + source("nor", "XYZ", normals) + source("tex", "ST", np.zeros((1, 2)))
        + "<vertices id='ver'><input semantic='POSITION' source='#pos'/></vertices>"
    )  # fmt: skip


def indices(corners: tuple[int, ...]) -> str:
    return "".join("<p>" + " ".join(f"{quad[k]} {i} 0" for k in corners) + "</p>" for i, quad in enumerate(QUADS))


def joined(corners: tuple[int, ...]) -> str:
    return indices(corners).replace("</p><p>", " ")


FACES = {
    "triangles": f"<triangles material='M' count='12'>{INPUTS}{joined((0, 1, 2, 0, 2, 3))}</triangles>",
    "polylist": f"<polylist material='M' count='6'>{INPUTS}<vcount>{'4 ' * 6}</vcount>"
    f"{joined((0, 1, 2, 3))}</polylist>",
    "polygons": f"<polygons material='M' count='6'>{INPUTS}{indices((0, 1, 2, 3))}</polygons>",
    "tristrips": f"<tristrips material='M' count='6'>{INPUTS}{indices((0, 1, 3, 2))}</tristrips>",
    "trifans": f"<trifans material='M' count='6'>{INPUTS}{indices((0, 1, 2, 3))}</trifans>",
    "lines as well": f"<lines count='1'>{INPUTS}<p>0 0 0 1 0 0</p></lines>"
    f"<triangles material='M' count='12'>{INPUTS}{joined((0, 1, 2, 0, 2, 3))}</triangles>",
}
SHOWN = (
    "<instance_geometry url='#geo'><bind_material><technique_common><instance_material symbol='M' target='#Mat #1'>"
    "<bind_vertex_input semantic='UVSET0' input_semantic='TEXCOORD' input_set='0'/></instance_material>"
    "</technique_common></bind_material></instance_geometry>"
)
MATERIAL = (
    "<library_materials><material id='Mat #1' name='paint'><instance_effect url='#E'/></material></library_materials>"
)


def effect(inside: str, *, params: str = "") -> str:
    return (
        f"<library_effects><effect id='E'><profile_COMMON>{params}<technique sid='common'><phong>{inside}</phong>"
        "</technique></profile_COMMON></effect></library_effects>"
    )


def write(
    folder: Path,
    *,
    faces: str = FACES["triangles"],
    nodes: str = f"<node id='N' name='cube'>{SHOWN}</node>",
    looks: str = effect(RED) + MATERIAL,
    unit: str = "<unit meter='1' name='meter'/>",
    side: float = 1.0,
    more: str = "",
    up: str = "Z_UP",
    scene: str = SCENE,
) -> Path:
    file = folder / "cube.DAE"
    file.write_text(
        "<?xml version='1.0' encoding='utf-8'?><COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' "
        f"version='1.4.1'><asset><created>2020-01-01T00:00:00Z</created><modified>2020-01-01T00:00:00Z</modified>{unit}"
        f"<up_axis>{up}</up_axis></asset>{looks}<library_geometries><geometry id='geo' name='geo'><mesh>{cube(side)}"
        f"{faces}</mesh></geometry></library_geometries>{more}<library_visual_scenes><visual_scene id='S'>{nodes}"
        f"</visual_scene></library_visual_scenes>{scene}</COLLADA>"
    )
    return file


def assert_cube(
    file: Path, low: tuple[float, ...] = (-0.5, -0.5, 0.0), high: tuple[float, ...] = (0.5, 0.5, 1.0)
) -> None:
    vertices, faces = load_mesh(file)
    assert len(faces) == 12
    assert vertices.min(axis=0) == pytest.approx(low, abs=1e-6)
    assert vertices.max(axis=0) == pytest.approx(high, abs=1e-6)


@pytest.mark.parametrize("form", FACES)
def test_faces_of_every_form(tmp_path: Path, form: str) -> None:
    file = write(tmp_path, faces=FACES[form])
    assert_cube(file)
    assert load_parts(file)[0].rgba == pytest.approx((0.8, 0.1, 0.1, 1.0))


@pytest.mark.parametrize(
    ("unit", "side"),
    [
        ("<unit meter='0.02539999969303608' name='inch'/>", 1.0 / 0.0254),
        ("<unit meter='0.010000' name='centimeter'></unit>", 100.0),
        ("<unit meter='1.000000' name='centimeter'/>", 1.0),
        ("", 1.0),
    ],
)
def test_a_unit_is_what_it_is_in_metres_not_what_it_is_called(tmp_path: Path, unit: str, side: float) -> None:
    assert_cube(write(tmp_path, unit=unit, side=side))


def test_y_up_changes_nothing_as_in_gazebo(tmp_path: Path) -> None:
    assert_cube(write(tmp_path, up="Y_UP"))


def test_nodes_of_sketchup_are_instances_of_instances(tmp_path: Path) -> None:
    outer = "<matrix>1 0 0 4 0 0 -1 0 0 1 0 0 0 0 0 1</matrix>"
    inner = "<matrix>1 0 0 0 0 1 0 0 0 0 1 2 0 0 0 1</matrix>"
    nodes = f"<node name='SketchUp'><node name='instance_0'>{outer}<instance_node url='#one'/></node></node>"
    library = (
        f"<library_nodes><node id='one' name='skp'><node>{inner}<instance_node url='#two'/></node></node>"
        f"<node id='two' name='component'>{SHOWN}</node></library_nodes>"
    )
    for file in (write(tmp_path, nodes=nodes, more=library), write(tmp_path, nodes=nodes, scene=library + SCENE)):
        assert_cube(file, (3.5, -3.0, -0.5), (4.5, -2.0, 0.5))


def test_nodes_of_3ds_max_shift_turn_and_scale_in_their_order(tmp_path: Path) -> None:
    nodes = (
        "<node name='Box001' id='Box001' sid='Box001'><translate sid='translate'>10 0 0</translate>"
        "<rotate sid='rotateZ'>0 0 1 90</rotate><rotate sid='rotateX'>1 0 0 0</rotate><scale>1 1 2</scale>"
        f"<translate>3 0 0</translate>{SHOWN}<extra><technique profile='FCOLLADA'><visibility>1.0</visibility>"
        "</technique></extra></node>"
    )
    assert_cube(write(tmp_path, nodes=nodes), (9.5, 2.5, 0.0), (10.5, 3.5, 2.0))


def test_a_mirrored_instance_and_its_twin(tmp_path: Path) -> None:
    nodes = (
        f"<node name='a'>{SHOWN}</node><node name='b'><matrix>-1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix>{SHOWN}</node>"
    )
    assert [part.name for part in load_parts(write(tmp_path, nodes=nodes))] == ["a", "b"]


def test_lamps_cameras_and_animations_may_be_broken(tmp_path: Path) -> None:
    more = (
        "<library_lights><light id='L'><technique_common><point/></technique_common></light></library_lights>"
        "<library_cameras><camera id='C'/></library_cameras><library_animations><animation/></library_animations>"
    )
    nodes = (
        f"<node name='cube'>{SHOWN}</node><node id='Light'><instance_light url='#L'/></node>"
        "<node id='Camera'><instance_camera url='#C'/></node>"
    )
    assert_cube(write(tmp_path, nodes=nodes, more=more))


@pytest.mark.parametrize(
    "looks",
    [
        "",
        effect(RED),
        MATERIAL,
        effect("<diffuse><texture texture='nothing' texcoord='UV'/></diffuse>") + MATERIAL,
        "<library_images><image id='I'><init_from>file:///C:/x/gone%20away.png</init_from></image></library_images>"
        + effect(
            "<diffuse><texture texture='sa' texcoord='UV'/></diffuse>",
            params="<newparam sid='su'><surface type='2D'><init_from>I</init_from></surface></newparam>"
            "<newparam sid='sa'><sampler2D><source>su</source></sampler2D></newparam>",
        )
        + MATERIAL,
    ],
    ids=["nothing", "no material", "no effect", "no picture named", "no picture there"],
)
def test_looks_that_are_not_there_cost_the_colour_only(tmp_path: Path, looks: str) -> None:
    file = write(tmp_path, looks=looks)
    assert_cube(file)
    assert load_parts(file)[0].rgba is None


def test_a_file_that_names_no_scene_shows_its_first(tmp_path: Path) -> None:
    assert_cube(write(tmp_path, scene=""))


def test_a_skin_stands_as_it_was_bound_to_its_bones(tmp_path: Path) -> None:
    def words(name: str, tag: str, kind: str, stride: int, numbers: str) -> str:
        count = len(numbers.split())
        return (
            f"<source id='{name}'><{tag} id='{name}-a' count='{count}'>{numbers}</{tag}><technique_common><accessor "
            f"source='#{name}-a' count='{count // stride}' stride='{stride}'><param type='{kind}'/></accessor>"
            "</technique_common></source>"
        )

    skin = (
        "<library_controllers><controller id='K'><skin source='#geo'>"
        "<bind_shape_matrix>1 0 0 0 0 1 0 0 0 0 1 3 0 0 0 1</bind_shape_matrix>"
        + words("cj", "Name_array", "name", 1, "Hip")
        + words("cb", "float_array", "float4x4", 16, "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1")
        + words("cw", "float_array", "float", 1, "1")
        + "<joints><input semantic='JOINT' source='#cj'/><input semantic='INV_BIND_MATRIX' source='#cb'/></joints>"
        "<vertex_weights count='8'><input semantic='JOINT' source='#cj' offset='0'/>"
        f"<input semantic='WEIGHT' source='#cw' offset='1'/><vcount>{'1 ' * 8}</vcount><v>{'0 0 ' * 8}</v>"
        "</vertex_weights></skin></controller></library_controllers>"
    )
    nodes = (
        "<node id='Hip' name='Hip' sid='Hip' type='JOINT'/>"
        "<node name='body'><instance_controller url='#K'><skeleton>#Hip</skeleton></instance_controller></node>"
    )
    assert_cube(write(tmp_path, nodes=nodes, more=skin), (-0.5, -0.5, 3.0), (0.5, 0.5, 4.0))


def test_a_prism_shows_its_edges_and_a_cylinder_does_not() -> None:
    def sides(count: int) -> tuple[np.ndarray, np.ndarray]:
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        low = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(count)))
        i = np.arange(count)
        j = (i + 1) % count
        walls = np.vstack([np.column_stack((i, j, count + j)), np.column_stack((i, count + j, count + i))])
        lid = np.column_stack((np.full(count - 2, count), count + i[1:-1], count + i[2:]))
        return np.vstack((low, np.add(low, (0.0, 0.0, 2.0)))), np.vstack((walls, lid))

    for count, is_round in ((6, False), (12, True)):
        corners, normals = sharp_normals(*sides(count))
        lid = np.all(corners.reshape(-1, 3, 3)[:, :, 2] == 2.0, axis=1).repeat(3)
        assert normals[lid] == pytest.approx(np.tile([0.0, 0.0, 1.0], (lid.sum(), 1)))
        outwards = np.einsum("ij,ij->i", normals[~lid, :2], corners[~lid, :2])
        assert np.all(outwards > 0.95) if is_round else outwards == pytest.approx(np.cos(np.pi / count))
