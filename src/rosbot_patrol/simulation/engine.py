"""The simulation itself: a world, a robot in it, its sensors and the actors, advanced step by step.

Exact: the same seed and the same calls at the same simulated times give the same data bit for bit. Noise belongs to a
sample's number, not to who asked before. Nothing here knows of wall time.
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
from rosbot_patrol.simulation.actors.doors import SPEED, Door, DoorPlace
from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.boxes import box_body
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.physics.world import Physics, Touch
from rosbot_patrol.simulation.population import Population
from rosbot_patrol.simulation.robot.battery import Battery, BatteryParams
from rosbot_patrol.simulation.robot.description import FrameParams, RobotDescription
from rosbot_patrol.simulation.robot.drive import DriveParams
from rosbot_patrol.simulation.robot.equipment import Equipment
from rosbot_patrol.simulation.robot.imu import ImuParams, ImuReading
from rosbot_patrol.simulation.robot.odometry import OdometryParams
from rosbot_patrol.simulation.scenario.fault_board import FaultBoard
from rosbot_patrol.simulation.scenario.faults import Doorway
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.scene.scene import Body, SceneRenderer
from rosbot_patrol.simulation.scene.slices import Slice
from rosbot_patrol.simulation.scene.ways import Ways
from rosbot_patrol.simulation.sdf.world import World
from rosbot_patrol.simulation.sensors.camera import Camera, CameraParams, Picture, poses_before
from rosbot_patrol.simulation.sensors.lidar import LidarParams, measure_scan
from rosbot_patrol.simulation.sensors.motion_sensors import MotionSensorParams, SensorPlace
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams, measure_range
from rosbot_patrol.simulation.sensors.sensor_net import SensorNet

STEP = 0.005  # [s]
HOME = Pose2D()

_ODOMETRY_EVERY = 10  # steps
_MOTION_EVERY = 20
_BATTERY_EVERY = 20


@dataclass(frozen=True, kw_only=True)
class EngineParams:
    """Everything that is simulated, part by part."""

    frames: FrameParams = field(default_factory=FrameParams)
    drive: DriveParams = field(default_factory=DriveParams)
    encoder: OdometryParams = field(default_factory=OdometryParams)
    lidar: LidarParams = field(default_factory=LidarParams)
    range: RangeParams = field(default_factory=RangeParams)
    imu: ImuParams = field(default_factory=ImuParams)
    battery: BatteryParams = field(default_factory=BatteryParams)
    camera: CameraParams = field(default_factory=CameraParams)
    motion: MotionSensorParams = field(default_factory=MotionSensorParams)
    seed: int = param(0, lo=0, doc="of all noise")


class Engine:
    """A running world.

    Args:
        world: what stands in it.
        params: of every part.
        sensors: motion sensors on the walls.
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
        self.sensors = tuple(sensors)
        self._physics = Physics(STEP)
        for body in world.bodies:
            self._physics.add(body)
        self._ways = Ways(world.bodies)
        self.population = Population(self._ways, self._physics, self.params.seed)
        self._boxes: dict[str, Body] = {}
        self.faults = FaultBoard(self, doorways)
        self._robot: Equipment | None = None
        self._steps = 0
        self._motion = SensorNet(self.params.motion, self.sensors, self.faults)
        self._camera = None
        if make_renderer is not None:
            self._camera = Camera(self.params.camera, make_renderer, world.bodies, self.params.seed)
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
            self._motion.update(self.now, self.population.walkers, self.population.sight)

    def reset(self) -> None:
        """Robot back to its start at rest, odometry to zero; time, actors and battery stay as they are."""
        if self._robot is not None:
            self.set_pose(self._robot.start)
            self._robot.odometry.reset(float(self._robot.turned[0]), float(self._robot.turned[1]), self.now)
            self._robot.imu.reset(self._robot.start.yaw)

    def close(self) -> None:
        """Give physics and renderer back."""
        if self._camera is not None:
            self._camera.close()
        self._physics.close()

    # The robot -------------------------------------------------------------------------------------------------------

    @property
    def has_camera(self) -> bool:
        """Whether there is a renderer to take pictures by."""
        return self._camera is not None

    @property
    def has_robot(self) -> bool:
        """Whether a robot is there."""
        return self._robot is not None

    def spawn_robot(self, description: RobotDescription, pose: Pose2D = HOME) -> None:
        """Put the robot into the world; raises WorldError where there is one, or no room for it."""
        if self._robot is not None:
            raise WorldError(f"robot '{description.name}'", f"'{self._robot.description.name}' is there already")
        if not all(map(math.isfinite, pose)):
            raise WorldError(f"robot '{description.name}'", f"{tuple(pose)} is no pose")
        robot = Equipment(self.params, description, self.bodies, pose)
        self._physics.add_robot(robot.description, pose, self.params.drive.traction)
        self._robot = robot

    @property
    def description(self) -> RobotDescription:
        """The robot's description."""
        return self._need_robot().description

    def command(self, twist: Twist2D) -> None:
        """Drive at a velocity until the next command, or until the time-out."""
        if self._robot is not None:
            self._robot.drive.command(twist, self.now)

    def remove_robot(self) -> None:
        """Take the robot out; raises WorldError where there is none."""
        self._need_robot()
        self._physics.remove_robot()
        self._robot = None

    def carry(self, pose: Pose2D) -> None:
        """Carry the robot elsewhere; its odometry does not notice. Raises WorldError where there is no room for it."""
        robot = self._need_robot()
        name = f"robot '{robot.description.name}'"
        if not all(map(math.isfinite, pose)):
            raise WorldError(name, f"{tuple(pose)} is no pose")
        stuck = self._physics.blocker_at(pose)
        if stuck:
            raise WorldError(name, f"({pose.x:.2f}, {pose.y:.2f}) is no place for it, '{stuck}' is there")
        self._physics.set_pose(pose)
        robot.drive.stop()

    set_pose = carry

    @property
    def pose(self) -> Pose2D:
        """True pose of the base in the world."""
        return self._physics.pose if self._robot is not None else Pose2D()

    @property
    def start_pose(self) -> Pose2D:
        """Where the robot was put when it was spawned."""
        return self._need_robot().start

    @property
    def twist(self) -> Twist2D:
        """True velocity of the base in its own frame."""
        return self._physics.twist if self._robot is not None else Twist2D()

    @property
    def odometry(self) -> tuple[Pose2D, Twist2D]:
        """What the wheel encoders believe, every 0.05 s anew."""
        robot = self._need_robot()
        return robot.odometry.pose, robot.odometry.twist

    @property
    def wheels(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Angles [rad] and speeds [rad/s] of the left and the right wheels."""
        robot = self._need_robot()
        return (float(robot.turned[0]), float(robot.turned[1])), (robot.drive.left, robot.drive.right)

    @property
    def battery(self) -> Battery:
        """The robot's battery."""
        return self._need_robot().battery

    def touches(self) -> list[Touch]:
        """What the robot touches, the floor apart."""
        return self._physics.touches()

    def _need_robot(self) -> Equipment:
        if self._robot is None:
            raise WorldError("simulation", "has no robot yet")
        return self._robot

    # Sensors ---------------------------------------------------------------------------------------------------------

    def scan(self) -> LaserScan:
        """One sweep of the lidar."""
        robot = self._need_robot()
        scene = robot.lidar_slice.plus(self.population.cut(robot.lidar_height))
        frame, base_from_laser = robot.laser
        return measure_scan(
            self.params.lidar, scene, compose(self.pose, base_from_laser), self.now, self._noise("lidar"),
            frame=frame, twist=robot.laser_twist(self.twist), flipped=robot.is_laser_flipped,
        )  # fmt: skip

    def level_scan(self) -> LevelScan:
        """One sweep of the lidar, laid level in base_link; raises LaserTilted where it cannot be."""
        return level_scan(self.scan(), self._need_robot().laser_transform, "base_link")

    def ranges(self) -> dict[str, float]:
        """Frame and distance [m] of each range sensor."""
        robot = self._need_robot()
        scene = robot.range_slice.plus(self.population.cut(robot.range_height))
        noise = self._noise("range")
        return {
            frame: measure_range(self.params.range, scene, compose(self.pose, place), noise)
            for frame, place in robot.base_from_ranges.items()
        }

    def imu(self) -> ImuReading:
        """One sample of the inertial unit."""
        return self._need_robot().imu.read(self._noise("imu"))

    def picture(self, *, colour: bool = True, depth: bool = True) -> Picture:
        """One picture of the camera; always from the same thread.

        Args:
            colour: whether the colour is wanted with its noise; else it may stay as it was drawn.
            depth: whether the depth is wanted with its limits and noise.

        Raises:
            WorldError: the engine has no renderer, or the robot no camera.
        """
        if not self.faults.active:
            return self._picture(colour, depth)
        return self.faults.seen(lambda: self._picture(True, True))

    def _picture(self, colour: bool, depth: bool) -> Picture:
        robot = self._need_robot()
        if self._camera is None or robot.base_from_optical is None:
            raise WorldError("simulation", "has no camera")
        *earlier, pose = (
            from_pose2d(base, robot.description.base_height) @ robot.base_from_optical
            for base in (*poses_before(self.pose, self.twist, self.params.camera.blur), self.pose)
        )
        return self._camera.take(pose, self.population, self._steps, colour=colour, depth=depth, earlier=earlier)

    def view_from_above(self, height: float = 9.0) -> NDArray[np.uint8]:
        """A picture of the house from a height [m] above the robot, north up; same thread as `picture`."""
        if self._camera is None:
            raise WorldError("simulation", "has no camera")
        robot = self._robot
        shown = None
        if robot is not None:
            shown = replace(robot.description.body, pose=from_pose2d(self.pose, robot.description.base_height))
        above = np.diag([1.0, -1.0, -1.0, 1.0])  # x right, y down, z into the picture
        above[:3, 3] = self.pose.x, self.pose.y, height
        return self._camera.view(above, self.population, shown)

    def motion(self) -> dict[int, bool]:
        """Whether each motion sensor's output is high, by id."""
        return self._motion.levels(self.now)

    def motion_changes(self) -> list[tuple[int, bool]]:
        """Id and level of each motion sensor whose output has changed since this was last asked."""
        return self._motion.changes(self.now)

    def restart_sensor(self, sensor: int) -> None:
        """Switch a motion sensor off and on: it warms up anew."""
        self._motion.restart(sensor, self.now)

    def restarted_sensors(self) -> list[int]:
        """Ids of the motion sensors that were switched off and on since this was last asked."""
        return self._motion.restarted()

    def warm_up(self) -> None:
        """Take one of each measurement, so that the first that counts does not come late."""
        robot = self._need_robot()
        if robot.base_from_laser is not None:
            self.scan()
        self.ranges()
        if self._camera is not None and robot.base_from_optical is not None:
            self.picture()

    def _noise(self, sensor: str) -> np.random.Generator:
        return noise_of(self.params.seed, sensor, self._steps)

    # What is put there -----------------------------------------------------------------------------------------------

    @property
    def bodies(self) -> tuple[Body, ...]:
        """What stands still."""
        return (*self.world.bodies, *self._boxes.values())

    def place_box(self, name: str, pose: Pose2D, size: tuple[float, float, float]) -> None:
        """Put a box of a length, depth and height [m] on the floor; raises WorldError where the robot stands."""
        if name in self.population or name in {b.name for b in self.bodies}:
            raise WorldError(f"box '{name}'", "the name is taken")
        body = box_body(name, pose, size)
        free = self._physics.blocker() is None
        self._physics.add(body)
        if free and self._physics.blocker() == name:
            self._physics.remove(name)
            raise WorldError(f"box '{name}'", f"cannot stand at ({pose.x:.2f}, {pose.y:.2f}), the robot is there")
        self._boxes[name] = body
        if self._camera is not None:
            self._camera.put(body)
        self._cut()

    def remove_box(self, name: str) -> None:
        """Take a box away; raises WorldError where there is none of that name."""
        if name not in self._boxes:
            raise WorldError(f"box '{name}'", f"is not there (there: {', '.join(self._boxes) or 'none'})")
        del self._boxes[name]
        self._physics.remove(name)
        if self._camera is not None:
            self._camera.take_away(name)
        self._cut()

    def _cut(self) -> None:
        self._ways.stand(self.bodies)
        if self._robot is not None:
            self._robot.cut(self.bodies)

    # Who and what moves there ----------------------------------------------------------------------------------------

    @property
    def actors(self) -> tuple[Walker, ...]:
        """Who is there."""
        return self.population.walkers

    @property
    def doors(self) -> tuple[Door, ...]:
        """The doors that open and close."""
        return self.population.doors

    @property
    def slices(self) -> tuple[Slice, Slice]:
        """The cuts through what stands still, at the height of the lidar and of the range sensors."""
        robot = self._need_robot()
        return robot.lidar_slice, robot.range_slice

    def spawn_actor(self, name: str, model: str, look: str, pose: Pose2D, *, posture: str = "") -> str:
        """Place an actor; returns its name, made up where it is ""; raises WorldError as `Population` does."""
        return self.population.spawn_actor(name, model, look, pose, posture=posture)

    def move_actor(
        self,
        name: str,
        path: Sequence[Pose2D],
        speed: float,
        loop: bool = False,
        *,
        pause: float = 0.0,
        yields: bool = True,
    ) -> None:
        """Let an actor walk along points, or put it somewhere; raises WorldError, also for a path through a wall."""
        self.population.move_actor(name, path, speed, loop, pause=pause, yields=yields)

    def roam_actor(self, name: str, radius: float, speed: float, *, pause: float = 2.0) -> None:
        """Let an actor wander within a radius [m] of where it is; raises WorldError."""
        self.population.roam_actor(name, radius, speed, pause=pause)

    def remove_actor(self, name: str) -> None:
        """Take an actor or a door out; raises WorldError where there is none of that name."""
        self.population.remove(name)

    def spawn_door(self, place: DoorPlace) -> None:
        """Hang a door, closed; raises WorldError where the name is taken."""
        self.population.spawn_door(place)

    def set_door(self, name: str, opening: float, speed: float = SPEED) -> None:
        """Begin to open (1) or close (0) a door at a speed [rad/s], 0 at once; raises WorldError."""
        self.population.set_door(name, opening, speed)
