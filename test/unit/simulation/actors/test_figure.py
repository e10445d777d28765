"""Detailed people and pets: closed smooth surfaces over their joints, drawn alike by both renderers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.actors.looks import LOOKS, Look, draw_look
from rosbot_patrol.simulation.actors.people import POSTURES, hip_height, person_body, person_pose_parts
from rosbot_patrol.simulation.actors.pets import PETS, pet_body, pet_pose_parts
from rosbot_patrol.simulation.render.egl import EglRenderer
from rosbot_patrol.simulation.render.vertices import MAX_PARTS
from rosbot_patrol.simulation.scene.scene import Body, Intrinsics, Matrix, Shape, Visual

CAMERA = np.array([[0, 0, 1, -3.0], [-1, 0, 0, 0], [0, -1, 0, 0.9], [0, 0, 0, 1.0]])
CHANCE = [draw_look(np.random.default_rng(seed)) for seed in range(12)]
EVERYONE = [replace(look, detailed=True) for look in (*LOOKS.values(), *CHANCE)]


def blended(body: Body, poses: Matrix) -> list[np.ndarray]:
    """Vertices of each visual in the body's frame, as the renderer places them."""
    placed = []
    for visual, pose in zip(body.visuals, poses, strict=True):
        detail, points = visual.shape.detail, visual.shape.vertices
        assert detail is not None
        assert points is not None
        other = poses[np.maximum(detail.partners, 0)]
        weight = detail.weights[:, None, None]
        mixed = pose * (1.0 - weight) + other * weight
        placed.append(np.einsum("vij,vj->vi", mixed[:, :3, :3], points) + mixed[:, :3, 3])
    return placed


def bodies() -> Iterator[tuple[Body, Matrix]]:
    for look in EVERYONE:
        for posture in POSTURES:
            yield person_body("p", look), person_pose_parts(look, 0.2, posture == "standing", posture)
    for looks in PETS.values():
        for pet in looks.values():
            yield pet_body("p", pet), pet_pose_parts(pet, 0.4, 1.0)


def test_every_vertex_has_a_unit_normal_a_colour_and_a_partner_of_its_body() -> None:
    for body, _ in bodies():
        assert len(body.visuals) <= MAX_PARTS
        for visual in body.visuals:
            detail = visual.shape.detail
            assert detail is not None
            assert np.allclose(np.linalg.norm(detail.normals, axis=1), 1.0, atol=1e-6)
            assert np.isfinite(detail.normals).all()
            assert ((detail.colours >= 0.0) & np.isfinite(detail.colours)).all()
            assert ((detail.weights >= 0.0) & (detail.weights <= 1.0)).all()
            assert (detail.partners[detail.weights > 0.0] >= 0).all()
            assert (detail.partners < len(body.visuals)).all()


def test_a_leg_is_whole_at_the_knee_in_every_posture() -> None:
    look = Look(detailed=True)
    body = person_body("p", look)
    rest = [visual.shape.vertices for visual in body.visuals]
    pairs = [
        (a, b, np.argwhere(np.linalg.norm(rest[a][:, None] - rest[b][None], axis=2) < 1e-9))
        for a in range(len(rest))
        for b in range(a)
    ]
    joints = [(a, b, shared) for a, b, shared in pairs if len(shared)]
    assert len(joints) >= 4  # both knees, both elbows
    for posture in POSTURES:
        placed = blended(body, person_pose_parts(look, 0.1, False, posture))
        for a, b, shared in joints:
            assert np.abs(placed[a][shared[:, 0]] - placed[b][shared[:, 1]]).max() < 1e-9


def test_people_are_as_tall_as_said_and_stand_on_their_soles() -> None:
    for look in EVERYONE:
        for walking in (False, True):
            points = np.vstack(blended(person_body("p", look), person_pose_parts(look, 0.3, walking)))
            assert points[:, 2].min() == pytest.approx(0.0, abs=0.03)
            assert points[:, 2].max() == pytest.approx(look.height, abs=0.09)


def test_the_same_look_is_the_same_person() -> None:
    look = replace(draw_look(np.random.default_rng(4)), detailed=True)
    one, other = person_body("p", look), person_body("p", replace(look))
    for a, b in zip(one.visuals, other.visuals, strict=True):
        assert np.array_equal(a.shape.vertices, b.shape.vertices)
        assert a.material == b.material


@pytest.mark.parametrize("detailed", [False, True])
def test_hips_are_lower_in_lower_postures(detailed: bool) -> None:
    look = Look(detailed=detailed)
    standing, sitting, crouching = (hip_height(look, posture=posture) for posture in POSTURES)
    assert standing == pytest.approx(0.52 * look.height, abs=0.04)
    assert max(sitting, crouching) < standing - 0.3


def test_nothing_is_seen_through_a_detailed_person() -> None:
    """Faces turned away are not drawn: the surfaces must be closed."""
    renderer = EglRenderer()
    try:
        for look in EVERYONE[:8]:
            renderer.add(person_body("p", look), label=1)
            renderer.pose_visuals("p", person_pose_parts(look, 0.3, True))
            renderer.render(CAMERA, Intrinsics(fy=500.0))
            seen = renderer.labels() == 1
            counts = np.diff(seen.astype(int), axis=1) == 1
            assert seen.sum() > 5000
            assert counts.sum(axis=1).max() <= 8  # a hole would cut rows into many pieces
            renderer.remove("p")
    finally:
        renderer.close()


def test_a_shadow_darkens_the_floor_and_is_in_neither_depth_nor_labels() -> None:
    floor = Body(name="floor", kind="floor", visuals=(Visual(shape=Shape(kind="plane", size=(20.0, 20.0))),))
    person = person_body("p", Look(detailed=True))
    pictures = []
    for body in (person, replace(person, kind="object")):
        renderer = EglRenderer()
        try:
            renderer.add(floor)
            renderer.add(body, label=1)
            colour, depth = renderer.render(CAMERA, Intrinsics(fy=450.0))
            pictures.append((colour.astype(int), depth, renderer.labels().copy()))
        finally:
            renderer.close()
    (with_shadow, depth, labels), (without, other_depth, other_labels) = pictures
    assert (depth == other_depth).all()
    assert (labels == other_labels).all()
    darker = (without - with_shadow).max(axis=2)
    assert darker.min() >= 0
    assert (darker[labels == 0] > 20).sum() > 300


@pytest.mark.parametrize("model", ["person", "poster"])
def test_only_a_world_with_detailed_figures_has_them(build, model: str) -> None:
    plain, detailed = build(), build(figures="detailed")
    sizes = []
    for engine in (plain, detailed):
        engine.population.spawn_actor("somebody", model, "visitor", Pose2D(2.0, 0.0, 0.0))
        (walker,) = engine.population.walkers
        sizes.append(sum(len(v.shape.vertices) for v in walker.body.visuals if v.shape.vertices is not None))
    assert sizes[1] > 2 * sizes[0]
