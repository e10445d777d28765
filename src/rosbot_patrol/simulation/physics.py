"""Motion and contacts of the robot's base among the bodies of a world, by PyBullet.

The base hangs on three joints (x, y, yaw), each driven at a speed with a bounded force: what the tyres can give. So
it can neither climb, tip over nor tunnel, a wall stops it, and along a wall it slides. The floor is no body here.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np
import pybullet

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.simulation.matrices import Matrix, to_quaternion
from rosbot_patrol.simulation.meshes import mesh_of
from rosbot_patrol.simulation.robot import RobotDescription
from rosbot_patrol.simulation.scene import Body, Collision, Shape

log = logging.getLogger(__name__)

GRAVITY = 9.8
_DEEP = 0.02  # a start deeper than this in something is refused [m]
_JOINTS = (0, 1, 2)


@dataclass(frozen=True, kw_only=True)
class Touch:
    """A contact of the robot: with which body and of what kind, where, the direction that it pushes the robot, force.

    Attributes:
        position, normal: in the frame of the world, shape (3,).
        force: along the normal [N].
    """

    other: str
    kind: str
    position: tuple[float, float, float]
    normal: tuple[float, float, float]
    force: float


class Physics:
    """One PyBullet world; `close` gives it back."""

    def __init__(self, dt: float) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise WorldError("pybullet", "cannot be started")
        self._bodies: dict[int, Body] = {}
        self._ids: dict[str, int] = {}
        self._robot: int | None = None
        self._limits = (0.0, 0.0, 0.0)
        self._height = 0.0
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=dt, deterministicOverlappingPairs=1, numSubSteps=0, physicsClientId=self._client
        )

    def add(self, body: Body) -> None:
        """Put a body that nothing pushes away; planes and bodies without shapes are left out."""
        parts = [c for c in body.collisions if c.shape.kind != "plane"]
        if body.name in self._ids:
            raise WorldError("world", f"the name '{body.name}' is used twice")
        if not parts:
            return
        number = pybullet.createMultiBody(
            baseMass=0.0,
            baseCollisionShapeIndex=self._compound(parts),
            basePosition=body.pose[:3, 3].tolist(),
            baseOrientation=to_quaternion(body.pose),
            physicsClientId=self._client,
        )
        self._bodies[number] = body
        self._ids[body.name] = number

    def remove(self, name: str) -> None:
        """Take a body out."""
        number = self._ids.pop(name, None)
        if number is not None:
            del self._bodies[number]
            pybullet.removeBody(number, physicsClientId=self._client)

    def move(self, name: str, world_from_body: Matrix) -> None:
        """Put a body elsewhere."""
        number = self._ids.get(name)
        if number is not None:
            pybullet.resetBasePositionAndOrientation(
                number, world_from_body[:3, 3].tolist(), to_quaternion(world_from_body), physicsClientId=self._client
            )

    def add_robot(self, robot: RobotDescription, pose: Pose2D, traction: float) -> None:
        """Put the robot at a pose.

        Raises:
            WorldError: it would stand in something; names what.
        """
        parts = [c for c in robot.body.collisions if c.shape.kind != "plane"]
        if not parts:
            raise WorldError(f"robot '{robot.name}'", "has no collision shape made of box, cylinder or sphere")
        nothing = [0.0, 0.0, 0.0]
        level = [0.0, 0.0, 0.0, 1.0]
        self._height = robot.axle_height
        self._robot = pybullet.createMultiBody(
            baseMass=0.0,
            basePosition=[0.0, 0.0, self._height],
            linkMasses=[1e-3, 1e-3, robot.mass],
            linkCollisionShapeIndices=[-1, -1, self._compound(parts)],
            linkVisualShapeIndices=[-1, -1, -1],
            linkPositions=[nothing] * 3,
            linkOrientations=[level] * 3,
            linkInertialFramePositions=[nothing] * 3,
            linkInertialFrameOrientations=[level] * 3,
            linkParentIndices=[0, 1, 2],
            linkJointTypes=[pybullet.JOINT_PRISMATIC, pybullet.JOINT_PRISMATIC, pybullet.JOINT_REVOLUTE],
            linkJointAxis=[[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            physicsClientId=self._client,
        )
        for link in (-1, *_JOINTS):
            pybullet.changeDynamics(
                self._robot, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, lateralFriction=0.3,
                physicsClientId=self._client,
            )  # fmt: skip
        grip = traction * robot.mass * GRAVITY
        self._limits = (grip, grip, grip * robot.track / 2.0)
        self.set_pose(pose)
        stuck = self.blocker()
        if stuck:
            self.remove_robot()
            place = f"({pose.x:.2f}, {pose.y:.2f})"
            raise WorldError(f"robot '{robot.name}'", f"{place} is no place for it, '{stuck}' is there")

    def remove_robot(self) -> None:
        """Take the robot out."""
        if self._robot is not None:
            pybullet.removeBody(self._robot, physicsClientId=self._client)
            self._robot = None

    @property
    def pose(self) -> Pose2D:
        """world_from_base."""
        x, y, yaw = (s[0] for s in self._joint_states())
        return Pose2D(x, y, wrap_angle(yaw))

    @property
    def twist(self) -> Twist2D:
        """Velocity of the base in its own frame."""
        (_, vx), (_, vy), (yaw, wz) = self._joint_states()
        c, s = math.cos(yaw), math.sin(yaw)
        return Twist2D(c * vx + s * vy, c * vy - s * vx, wz)

    def set_pose(self, pose: Pose2D) -> None:
        """Put the robot elsewhere, at rest."""
        for joint, value in zip(_JOINTS, pose, strict=True):
            pybullet.resetJointState(self._robot, joint, value, 0.0, physicsClientId=self._client)

    def step(self, wanted: Twist2D) -> None:
        """Advance by one time step, the base driven at a velocity in its own frame."""
        if self._robot is not None:
            yaw = self._joint_states()[2][0]
            c, s = math.cos(yaw), math.sin(yaw)
            speeds = (c * wanted.vx - s * wanted.vy, s * wanted.vx + c * wanted.vy, wanted.wz)
            pybullet.setJointMotorControlArray(
                self._robot, _JOINTS, pybullet.VELOCITY_CONTROL, targetVelocities=speeds, forces=self._limits,
                physicsClientId=self._client,
            )  # fmt: skip
        pybullet.stepSimulation(physicsClientId=self._client)

    def touches(self) -> list[Touch]:
        """What the robot touches now."""
        if self._robot is None:
            return []
        found = []
        for contact in pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client):
            body = self._bodies.get(contact[2])
            if body is None or contact[8] > 1e-3 or contact[9] <= 0.0:
                continue
            found.append(
                Touch(other=body.name, kind=body.kind, position=contact[5], normal=contact[7], force=contact[9])
            )
        return found

    def close(self) -> None:
        """Give everything back."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def _joint_states(self) -> list[tuple[float, float]]:
        states = pybullet.getJointStates(self._robot, _JOINTS, physicsClientId=self._client)
        return [(s[0], s[1]) for s in states]

    def blocker(self) -> str | None:
        """Name of what the robot stands in, None where it has room (or is not there)."""
        if self._robot is None:
            return None
        pybullet.performCollisionDetection(physicsClientId=self._client)
        for contact in pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client):
            if contact[8] < -_DEEP and contact[2] in self._bodies:
                return self._bodies[contact[2]].name
        return None

    def _compound(self, parts: list[Collision]) -> int:
        if len(parts) == 1 or any(c.shape.kind == "mesh" for c in parts):
            return self._single_or_mesh(parts)
        boxes = [[s / 2.0 for s in c.shape.size] if c.shape.kind == "box" else [0.1] * 3 for c in parts]
        return int(
            pybullet.createCollisionShapeArray(
                shapeTypes=[_bullet_kind(c.shape) for c in parts],
                halfExtents=boxes,
                radii=[c.shape.size[0] if c.shape.kind != "box" else 0.1 for c in parts],
                lengths=[c.shape.size[1] if c.shape.kind in ("cylinder", "capsule") else 0.1 for c in parts],
                collisionFramePositions=[c.pose[:3, 3].tolist() for c in parts],
                collisionFrameOrientations=[to_quaternion(c.pose) for c in parts],
                physicsClientId=self._client,
            )
        )

    def _single_or_mesh(self, parts: list[Collision]) -> int:
        place = {
            "collisionFramePosition": parts[0].pose[:3, 3].tolist(),
            "collisionFrameOrientation": to_quaternion(parts[0].pose),
            "physicsClientId": self._client,
        }
        shape = parts[0].shape
        if shape.kind == "box" and len(parts) == 1:
            half = [s / 2.0 for s in shape.size]
            return int(pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, **place))
        if shape.kind != "mesh" and len(parts) == 1:
            length = shape.size[1] if len(shape.size) > 1 else 0.0
            return int(pybullet.createCollisionShape(_bullet_kind(shape), radius=shape.size[0], height=length, **place))
        vertices, faces = _merged(parts)
        return int(
            pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                vertices=vertices.tolist(),
                indices=faces.ravel().tolist(),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=self._client,
            )
        )


def _merged(parts: list[Collision]) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all parts in the frame of the body."""
    vertices, faces, count = [], [], 0
    for part in parts:
        mesh = mesh_of(part.shape)
        vertices.append(mesh.positions @ part.pose[:3, :3].T + part.pose[:3, 3])
        faces.append(mesh.faces + count)
        count += len(mesh.positions)
    return np.vstack(vertices), np.vstack(faces)


def _bullet_kind(shape: Shape) -> int:
    kinds = {
        "box": pybullet.GEOM_BOX,
        "cylinder": pybullet.GEOM_CYLINDER,
        "sphere": pybullet.GEOM_SPHERE,
        "capsule": pybullet.GEOM_CAPSULE,
    }
    return int(kinds[shape.kind])
