"""Camera's picture by PyBullet's TinyRenderer, for machines without EGL: the same content, some 20 times slower.

Differs from `egl.EglRenderer`: plain colours instead of textures, and PyBullet's own light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.physics.bullet import pybullet
from rosbot_patrol.simulation.scene.matrices import to_quaternion
from rosbot_patrol.simulation.scene.scene import Body, Intrinsics, Matrix, SceneRenderer, Visual
from rosbot_patrol.simulation.scene.shapes import mesh_of

# Rows of the camera's frame in OpenGL (x right, y up, z backward) from the optical one (x right, y down, z forward).
_GL_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass
class _Item:
    pose: Matrix
    visuals: Matrix
    numbers: list[int]


class TinyRenderer(SceneRenderer):
    """PyBullet renderer with a world of its own and a multi-body per visual."""

    def __init__(self) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._items: dict[str, _Item] = {}

    def add(self, body: Body) -> None:
        """Add a body to the scene; its name must be new.

        Raises:
            WorldError: the name is taken, or a shape cannot be drawn.
        """
        if body.name in self._items:
            raise WorldError(body.name, "is in the scene already")
        poses = np.array([v.pose for v in body.visuals], float).reshape(-1, 4, 4)
        item = _Item(body.pose, poses, [self._make(visual) for visual in body.visuals])
        self._items[body.name] = item
        self._place(item)

    def remove(self, name: str) -> None:
        """Remove a body from the scene."""
        for number in self._item(name).numbers:
            pybullet.removeBody(number, physicsClientId=self._client)
        del self._items[name]

    def move(self, name: str, world_from_body: Matrix) -> None:
        """Move a body."""
        item = self._item(name)
        item.pose = world_from_body
        self._place(item)

    def pose_visuals(self, name: str, body_from_visuals: Matrix) -> None:
        """Set the poses of a body's visuals relative to it, shape (number of visuals, 4, 4)."""
        item = self._item(name)
        if body_from_visuals.shape != item.visuals.shape:
            raise WorldError(name, f"has visuals {item.visuals.shape}, was given poses {body_from_visuals.shape}")
        item.visuals = body_from_visuals
        self._place(item)

    def render(
        self, world_from_optical: Matrix, intrinsics: Intrinsics
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Draw a picture: colour (height, width, 3) and depth [m] (height, width), inf where nothing was hit."""
        view = _GL_FROM_OPTICAL @ np.linalg.inv(world_from_optical)
        drawn = pybullet.getCameraImage(
            intrinsics.width,
            intrinsics.height,
            viewMatrix=view.T.ravel().tolist(),
            projectionMatrix=_projection(intrinsics).T.ravel().tolist(),
            shadow=0,
            lightDirection=[-0.55, -0.35, 0.75],
            lightAmbientCoeff=0.6,
            lightDiffuseCoeff=0.4,
            lightSpecularCoeff=0.0,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        shape = (intrinsics.height, intrinsics.width)
        colour = np.ascontiguousarray(np.asarray(drawn[2], np.uint8).reshape(*shape, 4)[:, :, :3])
        raw = np.asarray(drawn[3], np.float32).reshape(shape)
        near, far = np.float32(intrinsics.near), np.float32(intrinsics.far)
        depth = near * far / (far - raw * (far - near))
        depth[depth > 0.999 * far] = np.inf  # empty pixels are a little nearer than the far clip
        return colour, depth

    def close(self) -> None:
        """Release PyBullet's world."""
        self._items.clear()
        pybullet.disconnect(self._client)

    def _make(self, visual: Visual) -> int:
        mesh = mesh_of(visual.shape)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=mesh.positions.tolist(),
            indices=mesh.faces.ravel().tolist(),
            normals=mesh.normals.tolist(),
            rgbaColor=list(visual.material.rgba),
            physicsClientId=self._client,
        )
        if shape < 0:
            raise WorldError(visual.shape.kind, "PyBullet cannot draw this shape")
        return int(pybullet.createMultiBody(0, -1, shape, physicsClientId=self._client))

    def _place(self, item: _Item) -> None:
        for number, visual in zip(item.numbers, item.visuals, strict=True):
            matrix = item.pose @ visual
            pybullet.resetBasePositionAndOrientation(
                number, matrix[:3, 3].tolist(), list(to_quaternion(matrix)), physicsClientId=self._client
            )

    def _item(self, name: str) -> _Item:
        if name not in self._items:
            raise WorldError(name, "is not in the scene")
        return self._items[name]


def _projection(camera: Intrinsics) -> NDArray[np.float64]:
    # TinyRenderer samples a pixel at its lower left corner, not at its centre.
    near, far, width, height = camera.near, camera.far, camera.width, camera.height
    return np.array(
        [
            [2 * camera.fx / width, 0, 1 - 2 * camera.cx / width, 0],
            [0, 2 * camera.fy / height, 2 * (camera.cy + 1) / height - 1, 0],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )
