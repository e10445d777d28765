"""Motion and contacts of the robot's base among the bodies of a world, by PyBullet.

The base hangs on three joints (x, y, yaw), each driven at a speed with a bounded force, the limit of the tyres. So it
cannot climb, tip over or tunnel; a wall stops it, and it slides along a wall. The floor is not a body here. PyBullet's
world has only the static bodies near the robot, because its step time grows with their number.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.simulation.physics.bullet import pybullet
from rosbot_patrol.simulation.physics.bullet_shapes import bounds_of, shapes_of, single_shape, touchable
from rosbot_patrol.simulation.physics.near_bodies import NearBodies
from rosbot_patrol.simulation.robot.description import RobotDescription
from rosbot_patrol.simulation.scene.matrices import Matrix, to_quaternion
from rosbot_patrol.simulation.scene.scene import Body, identity

log = logging.getLogger(__name__)

GRAVITY = 9.8
_DEEP = 0.02  # a start position that penetrates deeper is refused [m]
_JOINTS = (0, 1, 2)


@dataclass(frozen=True, kw_only=True)
class Touch:
    """A contact of the robot: the other body and its kind, position, direction of the push on the robot, force.

    Attributes:
        position, normal: in the world frame, shape (3,).
        force: along the normal [N].
    """

    other: str
    kind: str
    position: tuple[float, float, float]
    normal: tuple[float, float, float]
    force: float


class Physics:
    """One PyBullet world; `close` releases it."""

    def __init__(self, dt: float) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise WorldError("pybullet", "cannot be started")
        self._bodies: dict[int, Body] = {}
        self._ids: dict[str, list[int]] = {}
        self._still: dict[str, Body] = {}
        self._shapes: dict[str, list[int]] = {}  # made once: PyBullet never frees them
        self._near = NearBodies()
        self._stepping_over: set[str] = set()
        self._robot: int | None = None
        self._limits = (0.0, 0.0, 0.0)
        self._height = 0.0
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=dt, deterministicOverlappingPairs=1, numSubSteps=0, physicsClientId=self._client
        )

    def add(self, body: Body) -> None:
        """Add an immovable body; planes and bodies without shapes are left out."""
        if body.name in self._ids or body.name in self._still:
            raise WorldError("world", f"the name '{body.name}' is used twice")
        if body.static:
            parts, bounds = touchable(body)
            if parts:
                self._still[body.name] = replace(body, collisions=tuple(parts))
                self._near.add(body.name, bounds)
                self._refresh()
        elif any(c.shape.kind != "plane" for c in body.collisions):
            self._put(body)

    def remove(self, name: str) -> None:
        """Remove a body."""
        if self._still.pop(name, None) is not None:
            self._near.remove(name)
        self._take(name)
        self._shapes.pop(name, None)
        self._stepping_over.discard(name)

    def move(self, name: str, world_from_body: Matrix) -> None:
        """Move a body; from now on a static body counts as a moving one."""
        still = self._still.pop(name, None)
        if still is not None:
            self._near.remove(name)
            self._take(name)
            self._shapes.pop(name, None)
            self._put(replace(still, static=False))
        for number in self._ids.get(name, ()):
            pybullet.resetBasePositionAndOrientation(
                number, world_from_body[:3, 3].tolist(), to_quaternion(world_from_body), physicsClientId=self._client
            )

    def let_step_over(self, name: str, is_so: bool = True) -> None:
        """Set whether a moved body steps over the robot: both report contacts, but neither stops the other."""
        (self._stepping_over.add if is_so else self._stepping_over.discard)(name)
        self._let_touch(name)

    def _let_touch(self, name: str) -> None:
        if self._robot is None:
            return
        pushes = int(name not in self._stepping_over)
        for number in self._ids.get(name, ()):
            for link in (-1, *_JOINTS):
                pybullet.setCollisionFilterPair(number, self._robot, -1, link, pushes, physicsClientId=self._client)

    def _put(self, body: Body) -> None:
        if body.name not in self._shapes:
            parts = [c for c in body.collisions if c.shape.kind != "plane"]
            self._shapes[body.name] = shapes_of(parts, self._client, body.pose if body.static else None)
        self._ids[body.name] = []
        for shape in self._shapes[body.name]:
            number = pybullet.createMultiBody(
                baseMass=0.0,
                baseCollisionShapeIndex=shape,
                basePosition=body.pose[:3, 3].tolist(),
                baseOrientation=to_quaternion(body.pose),
                useMaximalCoordinates=int(body.static),
                physicsClientId=self._client,
            )
            self._bodies[number] = body
            self._ids[body.name].append(number)
        self._let_touch(body.name)

    def _take(self, name: str) -> None:
        for number in self._ids.pop(name, ()):
            del self._bodies[number]
            pybullet.removeBody(number, physicsClientId=self._client)

    def _refresh(self) -> None:
        """Add the bodies that have come near the robot, remove those no longer near."""
        if self._robot is not None:
            (x, _), (y, _), _ = self._joint_states()
            self._refresh_at(x, y)

    def _refresh_at(self, x: float, y: float) -> None:
        come, gone = self._near.update(x, y)
        for name in gone:
            self._take(name)
        for name in come:
            self._put(self._still[name])

    def add_robot(self, robot: RobotDescription, pose: Pose2D, traction: float) -> None:
        """Put the robot at a pose.

        Raises:
            WorldError: it would overlap a body; the text names it.
        """
        parts = [c for c in robot.body.collisions if c.shape.kind != "plane"]
        if not parts:
            raise WorldError(f"robot '{robot.name}'", "has no collision shape made of box, cylinder or sphere")
        nothing = [0.0, 0.0, 0.0]
        level = [0.0, 0.0, 0.0, 1.0]
        self._height = robot.base_height
        corners = [np.abs(bounds_of(part, identity())[:, :2]).max(axis=0) for part in parts]
        self._near.set_reach(max(math.hypot(*corner) for corner in corners))
        self._robot = pybullet.createMultiBody(
            baseMass=0.0,
            basePosition=[0.0, 0.0, self._height],
            linkMasses=[1e-3, 1e-3, robot.mass],
            linkCollisionShapeIndices=[-1, -1, single_shape(parts, self._client)],
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
        for name in self._stepping_over:
            self._let_touch(name)
        self.set_pose(pose)
        stuck = self.blocker()
        if stuck:
            self.remove_robot()
            place = f"({pose.x:.2f}, {pose.y:.2f})"
            raise WorldError(f"robot '{robot.name}'", f"{place} is no place for it, '{stuck}' is there")

    def remove_robot(self) -> None:
        """Remove the robot."""
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
        """Move the robot elsewhere, at rest."""
        for joint, value in zip(_JOINTS, pose, strict=True):
            pybullet.resetJointState(self._robot, joint, value, 0.0, physicsClientId=self._client)
        self._refresh()

    def blocker_at(self, pose: Pose2D) -> str | None:
        """Name of a body that the robot would overlap at a pose, None if there is none; the robot does not move."""
        before = self._joint_states()
        self.set_pose(pose)
        stuck = self.blocker()
        for joint, (value, speed) in zip(_JOINTS, before, strict=True):
            pybullet.resetJointState(self._robot, joint, value, speed, physicsClientId=self._client)
        self._refresh()
        return stuck

    def step(self, wanted: Twist2D) -> None:
        """Advance by one time step, with the base driven at a velocity in its own frame."""
        if self._robot is not None:
            (x, _), (y, _), (yaw, _) = self._joint_states()
            self._refresh_at(x, y)
            c, s = math.cos(yaw), math.sin(yaw)
            speeds = (c * wanted.vx - s * wanted.vy, s * wanted.vx + c * wanted.vy, wanted.wz)
            pybullet.setJointMotorControlArray(
                self._robot, _JOINTS, pybullet.VELOCITY_CONTROL, targetVelocities=speeds, forces=self._limits,
                physicsClientId=self._client,
            )  # fmt: skip
        pybullet.stepSimulation(physicsClientId=self._client)

    def touches(self) -> list[Touch]:
        """Present contacts of the robot."""
        if self._robot is None:
            return []
        found = []
        contacts = list(pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client))
        contacts = [c for c in contacts if c[8] <= 1e-3 and c[9] > 0.0]
        for number in (n for name in sorted(self._stepping_over) for n in self._ids.get(name, ())):
            contacts += pybullet.getClosestPoints(self._robot, number, 0.0, physicsClientId=self._client)
        for contact in contacts:
            body = self._bodies.get(contact[2])
            if body is None:
                continue
            found.append(
                Touch(other=body.name, kind=body.kind, position=contact[5], normal=contact[7], force=contact[9])
            )
        return found

    def close(self) -> None:
        """Release everything."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def _joint_states(self) -> list[tuple[float, float]]:
        states = pybullet.getJointStates(self._robot, _JOINTS, physicsClientId=self._client)
        return [(s[0], s[1]) for s in states]

    def blocker(self) -> str | None:
        """Name of a body that the robot overlaps, None if there is none (or no robot)."""
        if self._robot is None:
            return None
        pybullet.performCollisionDetection(physicsClientId=self._client)
        for contact in pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client):
            if contact[8] < -_DEEP and contact[2] in self._bodies:
                return self._bodies[contact[2]].name
        return None
