"""The simulation engine: a world, a robot in it, its sensors and the actors, advanced step by step.

It is deterministic: the same seed and the same calls at the same simulated times give the same data bit for bit. Noise
depends on the number of a sample, not on earlier readers. The engine does not know wall time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D, compose
from rosbot_patrol.params import param
from rosbot_patrol.scan import LaserScan, LevelScan, level_scan
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.physics.world import Physics, Touch
from rosbot_patrol.simulation.population import Population
from rosbot_patrol.simulation.robot.battery import BatteryParams
from rosbot_patrol.simulation.robot.description import FrameParams, RobotDescription
from rosbot_patrol.simulation.robot.drive import DriveParams
from rosbot_patrol.simulation.robot.equipment import Equipment
from rosbot_patrol.simulation.robot.imu import ImuParams, ImuReading
from rosbot_patrol.simulation.robot.odometry import OdometryParams
from rosbot_patrol.simulation.scenario.fault_board import FaultBoard
from rosbot_patrol.simulation.scenario.faults import Doorway
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.scene.scene import SceneRenderer
from rosbot_patrol.simulation.scene.ways import Ways
from rosbot_patrol.simulation.sdf.world import World
from rosbot_patrol.simulation.sensors.camera import Camera, CameraParams, Picture
from rosbot_patrol.simulation.sensors.lidar import LidarParams, measure_scan
from rosbot_patrol.simulation.sensors.motion_sensors import MotionSensorParams, SensorPlace
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams, measure_range
from rosbot_patrol.simulation.sensors.sensor_net import SensorNet
from rosbot_patrol.simulation.start_place import places_around

STEP = 0.005  # [s]
HOME = Pose2D()

_ODOMETRY_EVERY = 10  # steps
_MOTION_EVERY = 20
_BATTERY_EVERY = 20
_ROOM = 0.3  # free space around a start that was looked for [m]


@dataclass(frozen=True, kw_only=True)
class EngineParams:
    """Parameters of everything that is simulated, part by part."""

    frames: FrameParams = field(default_factory=FrameParams)
    drive: DriveParams = field(default_factory=DriveParams)
    encoder: OdometryParams = field(default_factory=OdometryParams)
    lidar: LidarParams = field(default_factory=LidarParams)
    range: RangeParams = field(default_factory=RangeParams)
    imu: ImuParams = field(default_factory=ImuParams)
    battery: BatteryParams = field(default_factory=BatteryParams)
    camera: CameraParams = field(default_factory=CameraParams)
    motion: MotionSensorParams = field(default_factory=MotionSensorParams)
    seed: int = param(0, lo=0, doc="seed of all noise")
    figures: str = param(
        "plain",
        choices=("plain", "detailed"),
        doc="figures of people; detailed: with folds, face and hands, for networks that know real people",
    )


class Engine:
    """A running world.

    Attributes:
        ways: static bodies, and the free paths between them.
        population: actors, doors and boxes.
        motion_sensors: the sensors on the walls.
        faults: the active faults.

    Args:
        world: bodies, and the actors and doors at the start.
        params: parameters of every part.
        sensors: places of the motion sensors.
        doorways: places that a fault may name.
        make_renderer: builds the camera's renderer, in the thread that takes pictures.
    """

    def __init__(
        self,
        world: World,
        params: EngineParams | None = None,
        *,
        sensors: Sequence[SensorPlace] = (),
        doorways: Mapping[str, Doorway] | None = None,
        make_renderer: Callable[[], SceneRenderer] | None = None,
    ) -> None:
        self.world = world
        self.params = params or EngineParams()
        self._physics = Physics(STEP)
        for body in world.bodies:
            self._physics.add(body)
        self.ways = Ways(world.bodies)
        self.population = Population(
            self.ways, self._physics, self.params.seed, detailed=self.params.figures == "detailed"
        )
        self.faults = FaultBoard(self, doorways)
        self._robot: Equipment | None = None
        self._steps = 0
        self.motion_sensors = SensorNet(self.params.motion, sensors, self.faults.level)
        self._camera = None
        if make_renderer is not None:
            self._camera = Camera(
                self.params.camera, make_renderer, world.bodies, boxes=self.population.boxes, seed=self.params.seed
            )
        self.population.begin(world.actors, world.doors)

    # Time ------------------------------------------------------------------------------------------------------------

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self._steps * STEP

    def step(self) -> None:
        """Advance by one step."""
        self.faults.advance(self.now)
        robot = self._robot
        where = self._physics.pose if robot is not None else None
        self.population.step(STEP, where, robot.radius if robot is not None else 0.0)
        if robot is None:
            self._physics.step(Twist2D())
        else:
            robot.drive.stuck = self.faults.stuck_wheels
            self._physics.step(self.faults.driven(robot.drive.step(self.now, STEP)))
            robot.turned += np.array([robot.drive.left, robot.drive.right]) * STEP
            robot.imu.step(self._physics.twist, STEP)
        self._steps += 1
        self._slow_parts(robot)

    def _slow_parts(self, robot: Equipment | None) -> None:
        if robot is not None and self._steps % _ODOMETRY_EVERY == 0:
            robot.odometry.update(float(robot.turned[0]), float(robot.turned[1]), self.now)
        if robot is not None and self._steps % _BATTERY_EVERY == 0:
            robot.battery.step(robot.drive.load, _BATTERY_EVERY * STEP)
        if self._steps % _MOTION_EVERY == 0:
            self.motion_sensors.update(self.now, self.population.walkers, self.population.sight)

    def reset(self) -> None:
        """Reset the robot to its start, at rest, with odometry zero; time, actors and battery stay."""
        if self._robot is not None:
            self.carry(self._robot.start)
            self._robot.odometry.reset(float(self._robot.turned[0]), float(self._robot.turned[1]), self.now)
            self._robot.imu.reset(self._robot.start.yaw)

    def close(self) -> None:
        """Release physics and renderer."""
        if self._camera is not None:
            self._camera.close()
        self._physics.close()

    # The robot -------------------------------------------------------------------------------------------------------

    @property
    def has_camera(self) -> bool:
        """Whether there is a renderer for pictures."""
        return self._camera is not None

    @property
    def has_robot(self) -> bool:
        """Whether there is a robot."""
        return self._robot is not None

    def spawn_robot(self, description: RobotDescription, pose: Pose2D = HOME) -> None:
        """Put the robot into the world; raises WorldError if there is one already, or no room for it."""
        if self._robot is not None:
            raise WorldError(f"robot '{description.name}'", f"'{self._robot.description.name}' is there already")
        if not all(map(math.isfinite, pose)):
            raise WorldError(f"robot '{description.name}'", f"{tuple(pose)} is no pose")
        robot = Equipment(self.params, description, pose)
        self._physics.add_robot(robot.description, pose, self.params.drive.traction)
        self._robot = robot

    def spawn_near(self, description: RobotDescription, pose: Pose2D = HOME, reach: float = 10.0) -> Pose2D:
        """Put the robot at a pose, or at the nearest free place with some room around it.

        Args:
            description: of the robot.
            pose: the wanted one; its heading stays.
            reach: how far away the place may be [m].

        Returns:
            Where it is.

        Raises:
            WorldError: there is a robot already, or no such place; the text says what stands at the wanted one.
        """
        try:
            self.spawn_robot(description, pose)
        except WorldError as err:
            if self._robot is not None:
                raise
            for place in places_around(pose, reach):
                if self._is_roomy(description, place):
                    return place
            raise err from None
        return pose

    def _is_roomy(self, description: RobotDescription, place: Pose2D) -> bool:
        """Put the robot at a place, if it and its surroundings are free."""
        try:
            self.spawn_robot(description, place)
        except WorldError:
            return False
        steps = (-_ROOM, 0.0, _ROOM)
        around = (Pose2D(place.x + dx, place.y + dy, place.yaw) for dx in steps for dy in steps)
        if any(self._physics.blocker_at(each) for each in around):
            self.remove_robot()
            return False
        return True

    @property
    def robot(self) -> Equipment:
        """The robot's parts; raises WorldError if there is no robot."""
        if self._robot is None:
            raise _no_robot()
        return self._robot

    def command(self, twist: Twist2D) -> None:
        """Drive at a velocity until the next command, or until the time-out."""
        if self._robot is not None:
            self._robot.drive.command(twist, self.now)

    def remove_robot(self) -> None:
        """Remove the robot; raises WorldError if there is none."""
        if self._robot is None:
            raise _no_robot()
        self._physics.remove_robot()
        self._robot = None

    def carry(self, pose: Pose2D) -> None:
        """Move the robot elsewhere without a change of its odometry; raises WorldError if there is no room for it."""
        robot = self.robot
        name = f"robot '{robot.description.name}'"
        if not all(map(math.isfinite, pose)):
            raise WorldError(name, f"{tuple(pose)} is no pose")
        stuck = self._physics.blocker_at(pose)
        if stuck:
            raise WorldError(name, f"({pose.x:.2f}, {pose.y:.2f}) is no place for it, '{stuck}' is there")
        self._physics.set_pose(pose)
        robot.drive.stop()

    @property
    def pose(self) -> Pose2D:
        """True pose of the base in the world."""
        return self._physics.pose if self._robot is not None else Pose2D()

    @property
    def twist(self) -> Twist2D:
        """True velocity of the base in its own frame."""
        return self._physics.twist if self._robot is not None else Twist2D()

    def touches(self) -> list[Touch]:
        """Contacts of the robot, except with the floor."""
        return self._physics.touches()

    # Sensors ---------------------------------------------------------------------------------------------------------

    def scan(self) -> LaserScan:
        """Take one sweep of the lidar."""
        robot = self.robot
        frame, base_from_laser = robot.laser
        scene = self.ways.cut(robot.lidar_height).plus(self.population.cut(robot.lidar_height))
        return measure_scan(
            self.params.lidar, scene, compose(self.pose, base_from_laser), self.now, self._noise("lidar"),
            frame=frame, twist=robot.laser_twist(self.twist), flipped=robot.is_laser_flipped,
        )  # fmt: skip

    def level_scan(self) -> LevelScan:
        """Take one sweep of the lidar, projected level into base_link; raises LaserTilted if that is impossible."""
        return level_scan(self.scan(), self.robot.laser_transform, "base_link")

    def ranges(self) -> dict[str, float]:
        """Read the distance [m] of each range sensor, by frame."""
        robot = self.robot
        scene = self.ways.cut(robot.range_height).plus(self.population.cut(robot.range_height))
        noise = self._noise("range")
        return {
            frame: measure_range(self.params.range, scene, compose(self.pose, place), noise)
            for frame, place in robot.base_from_ranges.items()
        }

    def imu(self) -> ImuReading:
        """Take one sample of the inertial unit."""
        return self.robot.imu.read(self._noise("imu"))

    def picture(self, *, colour: bool = True, depth: bool = True) -> Picture:
        """Take one picture with the camera; call always from the same thread.

        Args:
            colour: add exposure and noise to the colour; otherwise it may stay as drawn.
            depth: add limits and noise to the depth; otherwise it may stay as drawn.

        Raises:
            WorldError: the engine has no renderer, or the robot no camera.
        """
        if not self.faults.active:
            return self._picture(colour, depth)
        return self.faults.seen(lambda: self._picture(True, True))

    def _picture(self, colour: bool, depth: bool) -> Picture:
        robot = self.robot
        if self._camera is None or robot.base_from_optical is None:
            raise WorldError("simulation", "has no camera")
        return self._camera.take(
            from_pose2d(self.pose, robot.description.base_height) @ robot.base_from_optical,
            self.population,
            self._steps,
            now=self.now,
            turning=self.twist.wz,
            colour=colour,
            depth=depth,
        )

    def view_from_above(self, height: float = 9.0) -> NDArray[np.uint8]:
        """Draw the house from a height [m] above the robot, north up; call from the thread of `picture`."""
        if self._camera is None:
            raise WorldError("simulation", "has no camera")
        robot = self._robot
        shown = None
        if robot is not None:
            shown = replace(robot.description.body, pose=from_pose2d(self.pose, robot.description.base_height))
        above = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y down, z into the picture
        above[:3, 3] = self.pose.x, self.pose.y, height
        return self._camera.view(above, self.population, shown)

    def warm_up(self) -> None:
        """Take one of each measurement, so that the first real ones are not late."""
        robot = self.robot
        if robot.base_from_laser is not None:
            self.scan()
        self.ranges()
        if self._camera is not None and robot.base_from_optical is not None:
            self.picture()

    def _noise(self, sensor: str) -> np.random.Generator:
        return noise_of(self.params.seed, sensor, self._steps)


def _no_robot() -> WorldError:
    return WorldError("simulation", "has no robot yet")
