from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.actors.people_meshes import loft
from rosbot_patrol.simulation.meshes.files import load_mesh
from rosbot_patrol.simulation.scene.scene import Shape
from rosbot_patrol.simulation.scene.shapes import Mesh, mesh_of, smooth_normals
from rosbot_patrol.simulation.scene.textures import NAMES, SIDE, standard_textures

SHAPES = [
    Shape(kind="box", size=(1.0, 2.0, 3.0)),
    Shape(kind="cylinder", size=(0.5, 2.0)),
    Shape(kind="sphere", size=(0.7,)),
    Shape(kind="capsule", size=(0.3, 1.0)),
]
VOLUMES = [6.0, np.pi * 0.25 * 2, 4 / 3 * np.pi * 0.343, np.pi * 0.09 * 1.0 + 4 / 3 * np.pi * 0.027]


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.positions[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize(
    ("shape", "expected"), list(zip(SHAPES, VOLUMES, strict=True)), ids=lambda s: getattr(s, "kind", "")
)
def test_triangles_enclose_the_volume_and_face_outwards(shape: Shape, expected: float) -> None:
    mesh = mesh_of(shape)
    assert volume(mesh) == pytest.approx(expected, rel=0.06)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
    assert (np.einsum("ij,ij->i", mesh.normals, mesh.positions) >= -1e-9).all()
    assert mesh.uv.shape == mesh.span.shape == (len(mesh.positions), 2)
    assert (np.abs(mesh.uv) <= mesh.span / 2 + 1e-9).all()


def test_a_shape_with_too_few_sizes_is_named() -> None:
    with pytest.raises(WorldError, match="box: needs 3 sizes"):
        mesh_of(Shape(kind="box", size=(1.0,)))
    with pytest.raises(WorldError, match="neither a file nor triangles"):
        mesh_of(Shape(kind="mesh"))


def test_binary_and_text_stl_and_obj_give_the_same_triangle(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    binary = bytes(80) + (1).to_bytes(4, "little") + bytes(12) + corners.tobytes() + bytes(2)
    (tmp_path / "a.stl").write_bytes(binary)
    lines = "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners)
    (tmp_path / "b.stl").write_text(f"solid t\nfacet normal 0 0 1\nouter loop\n{lines}endloop\nendfacet\nendsolid\n")
    (tmp_path / "c.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1/1/1 2/2/2 -1\n")
    for name in ("a.stl", "b.stl", "c.obj"):
        vertices, faces = load_mesh(tmp_path / name)
        assert np.array_equal(vertices[faces[0]], corners), name
    mesh = mesh_of(Shape(kind="mesh", mesh=tmp_path / "c.obj", size=(2.0, 1.0, 1.0)))
    assert mesh.positions[:, 0].max() == 2.0
    assert np.allclose(mesh.normals, [0, 0, 1])


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("short.stl", bytes(80) + (5).to_bytes(4, "little") + bytes(50), "134 bytes do not fit 5 triangles"),
        ("empty.obj", b"# nothing\n", "has no triangles"),
        ("wrong.obj", b"v 0 0 0\nf 1 2 3\n", "names a vertex that is not there"),
        ("words.obj", b"v a b c\n", "is broken"),
        ("mesh.ply", b"ply", "no mesh that can be read"),
    ],
)
def test_a_bad_mesh_file_is_named_with_its_problem(tmp_path: Path, name: str, content: bytes, problem: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(WorldError, match=f"{name}.*{problem}"):
        load_mesh(tmp_path / name)


def test_a_missing_mesh_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match=r"gone\.stl: the mesh cannot be read: No such file"):
        load_mesh(tmp_path / "gone.stl")


def test_textures_are_pictures_and_repeat_with_the_seed() -> None:
    textures = standard_textures(3)
    assert set(textures) == set(NAMES)
    for name, texture in textures.items():
        assert texture.pixels.shape == (SIDE, SIDE, 3), name
        assert np.array_equal(texture.pixels, standard_textures(3)[name].pixels)


def plain_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """What `smooth_normals` says of itself, vertex by vertex."""
    normals = np.zeros_like(vertices)
    for i, vertex in enumerate(vertices):
        for face in faces:
            a, b, c = vertices[face]
            meets = sum(bool((np.round(corner, 5) == np.round(vertex, 5)).all()) for corner in (a, b, c))
            normals[i] += meets * np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_normals_are_the_mean_of_all_triangles_that_meet() -> None:
    limb = loft([(0.5, 0.1, 0.08, 0.01), (0.2, 0.2, 0.1, 0.0), (-0.4, 0.05, 0.05, 0.02)], y=0.1)
    assert limb.vertices is not None
    assert limb.faces is not None
    expected = plain_normals(limb.vertices, limb.faces)
    assert smooth_normals(limb.vertices, limb.faces) == pytest.approx(expected, abs=1e-12)


def test_the_faces_of_a_box_have_their_own_corners_and_their_size() -> None:
    mesh = mesh_of(Shape(kind="box", size=(1.0, 2.0, 3.0)))
    for i in range(6):
        corners, span = mesh.positions[4 * i : 4 * i + 4], mesh.span[4 * i]
        axis = i // 2
        assert np.abs(corners).max(axis=0) == pytest.approx([0.5, 1.0, 1.5])
        assert (mesh.normals[4 * i : 4 * i + 4] * corners)[:, axis] == pytest.approx(mesh.positions.max(axis=0)[axis])
        assert span == pytest.approx(np.delete([1.0, 2.0, 3.0], axis))
        assert mesh.uv[4 * i : 4 * i + 4].max(axis=0) == pytest.approx(span / 2)


@pytest.mark.parametrize(("kind", "size"), [("box", (1.0, 1.0, 1.0)), ("cylinder", (0.5, 1.0)), ("sphere", (1.0,))])
def test_what_shapes_share_cannot_be_written_into(kind, size) -> None:
    with pytest.raises(ValueError, match="read-only"):
        mesh_of(Shape(kind=kind, size=size)).faces[0] = 0
