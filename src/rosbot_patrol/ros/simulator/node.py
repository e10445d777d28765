"""simulator: the house, the robot and its sensors, in place of Gazebo.

Matches what gazebo_ros and rosbot_description publish for the ROSbot: topics, types, frames (see the tables in the
README), `/clock` and the transform odom -> base_link.

Differs:
- /clock comes at 100 Hz of simulated time, not 1 kHz.
- /odom comes at 20 Hz from wheel encoders that drift (`odometry: ground_truth` gives Gazebo's).
- The lidar turns at 10 Hz; the base stops 0.5 s after the last command; all sensors have a little noise.
- Ranges below the lidar's minimum are -inf (REP 117).
- Additional: /range, /battery, ground truth on /ground_truth/odom and /ground_truth/contacts, services for actors,
  faults and control, and scenarios.
- Of Gazebo's services there are /gazebo/pause_physics, unpause_physics, reset_simulation and reset_world. A reset puts
  the robot back to its start and does not change the time.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import rospy
from geometry_msgs.msg import Twist

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ParamError, WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.convert import twist_from_msg
from rosbot_patrol.ros.models.packages import model_folders, package_finder
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import load_params, now, run_node
from rosbot_patrol.ros.runtime.process import Priority
from rosbot_patrol.ros.simulator.doors import DoorServices
from rosbot_patrol.ros.simulator.faults import FaultServices
from rosbot_patrol.ros.simulator.outputs import STEPS_PER_TICK, TICK, Outputs
from rosbot_patrol.ros.simulator.pace import Lockstep, LockstepParams, Pace, SharedClock, refuse_second_clock
from rosbot_patrol.ros.simulator.readings import RateParams, Readings
from rosbot_patrol.ros.simulator.requests import Requests
from rosbot_patrol.ros.simulator.scenario import ScenarioRunner
from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.keys import read_keys
from rosbot_patrol.rosserial.server.settings import DEFAULT_TCP_PORT
from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.hardware import Hardware, HardwareParams, mounted
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.robot.description import RobotDescription, load_robot, parse_robot
from rosbot_patrol.simulation.scenario.file import Scenario, Start, read_scenario
from rosbot_patrol.simulation.scenario.furniture import move_furniture
from rosbot_patrol.simulation.sdf.world import World, load_world
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

if TYPE_CHECKING:
    from rosbot_patrol.ros.simulator.window import Window

log = logging.getLogger(__name__)

_HEALTH_PERIOD = 1.0
_PAUSED_PERIOD = 0.05
_FOLLOW_PERIOD = 0.002  # period of checking a clock of 100 Hz [s]
_BEHIND = 0.5  # messages farther behind the clock are too late for other nodes [s]


@dataclass(frozen=True, kw_only=True)
class SimulatorParams(EngineParams):
    """Parameters of the node simulator: its own, and those of the engine's parts."""

    world: str = param("", doc="SDF file of the world; empty: a floor without walls")
    model_path: tuple[str, ...] = param(
        (), doc="folders of model://, searched before GAZEBO_MODEL_PATH and ~/.gazebo/models"
    )
    robot: bool = param(True, doc="place the robot at the start; false: wait for ~spawn_robot")
    urdf: str = param("", doc="URDF file of the robot; empty: the parameter /robot_description")
    x: float = param(0.0, unit="m", doc="initial position")
    y: float = param(0.0, unit="m", doc="initial position")
    yaw: float = param(0.0, unit="rad", doc="initial heading")
    rate: float = param(1.0, lo=0.0, doc="real-time factor; 0: as fast as possible")
    seed: int = param(1, lo=0, doc="seed of all noise")
    paused: bool = param(False, doc="start paused")
    gui: bool = param(False, doc="window with the house from above, if there is a display")
    odometry: str = param("encoder", choices=("encoder", "ground_truth"), doc="source of /odom")
    motion_sensors: str = param("", doc="file of the motion sensors; empty: none")
    prewarmed: bool = param(True, doc="motion sensors are warm at the start")
    bridge_host: str = param("localhost", doc="host of the motion sensors' bridge")
    bridge_port: int = param(
        DEFAULT_TCP_PORT, lo=1, hi=65535, doc="TCP port of the first bridge, which is 11411 in the sensors' file"
    )
    clock: bool = param(True, doc="publish /clock; false: follow another node's clock")
    key_file: str = param(
        "", doc="keys with which the motion sensors prove themselves to a bridge that asks; empty: none"
    )
    scenario: str = param("", doc="file of a scenario to play; its world, sensors, seed and start take precedence")
    scenario_watched: bool = param(False, doc="start the scenario only when somebody listens to ~scenario")
    rates: RateParams = field(default_factory=RateParams)
    lockstep: LockstepParams = field(default_factory=LockstepParams)
    hardware: HardwareParams = field(default_factory=HardwareParams)

    @property
    def engine(self) -> EngineParams:
        """The engine's part of the parameters."""
        return dataclasses.replace(
            self, motion=dataclasses.replace(self.motion, prewarmed=self.prewarmed and self.motion.prewarmed)
        )


class Simulator:
    """Run the engine on one thread, in step with wall time or with the nodes that listen."""

    def __init__(self, p: SimulatorParams) -> None:
        scenario = read_scenario(p.scenario) if p.scenario else None
        if scenario is not None:
            p = _set_by(scenario, p)
        folders, packages = model_folders(p.model_path), package_finder(p.model_path)
        world = load_world(p.world, folders, packages) if p.world else World()
        if scenario is not None:
            world = dataclasses.replace(world, bodies=move_furniture(world.bodies, scenario.furniture, scenario.file))
        places = read_sensors(p.motion_sensors)
        self._params = p
        renderer = partial(make_renderer, p.camera.renderer, p.camera.light)
        self._engine = Engine(world, p.engine, sensors=places, make_renderer=renderer)
        if p.robot:
            robot = _description(p)
            self._place(mounted(robot) if p.hardware.folder else robot, is_given=scenario is not None)
        self._paused = p.paused
        self._tick = 0
        self._command: Latest[Twist] = Latest()
        self._pace = Pace(p.rate)
        self._shared = None if p.clock else SharedClock(now)
        if self._shared is None:
            refuse_second_clock()
        self._hardware: Hardware | None = None
        readings = None
        if p.hardware.folder:
            self._hardware = Hardware(self._engine, p.hardware)
        else:
            readings = Readings(self._engine, p.rates, exact_odometry=p.odometry == "ground_truth")
            rospy.Subscriber("cmd_vel", Twist, lambda m: self._command.set(m, 0.0), queue_size=1, tcp_nodelay=True)
        self._outputs = Outputs(self._engine, p.rates, readings, shared=self._shared)
        self._requests = Requests(self._engine, self._set_paused, self._step_ticks)
        self._lockstep = Lockstep(p.lockstep, lambda: self._engine.now)
        if p.rate == 0.0 and p.clock:
            self._lockstep.subscribe()
        keys = read_keys(p.key_file) if p.key_file else {}
        self._clients = {s.id: EspClient(p.bridge_host, _port(s, p), s.id, key=keys.get(s.id)) for s in places}
        self._scenario = None
        if scenario is not None:
            self._scenario = ScenarioRunner(scenario, self._engine, self._clients, is_watched=p.scenario_watched)
        for client in self._clients.values():
            client.start()
        self._window = _open_window(self._engine) if p.gui else None
        self._health = Health("simulation")
        self._report_world(world)
        self._doors = DoorServices(self._engine, self._requests.ask)
        self._faults = FaultServices(self._engine, self._clients, self._requests.ask, self._health, p.seed)
        log.info("world '%s': bodies: %d, motion sensors: %d", world.name, len(world.bodies), len(places))

    def run(self) -> None:
        """Simulate until shutdown."""
        if self._engine.has_robot:
            self._engine.warm_up()
        self._restart_pace()
        report_at, report_sim = time.monotonic(), self._engine.now
        while not rospy.is_shutdown():
            self._requests.serve()
            if self._paused:
                self._faults.follow()
                time.sleep(_PAUSED_PERIOD)
                self._restart_pace()
            elif self._shared is not None:
                self._follow(self._shared)
            else:
                self._advance()
                self._lockstep.wait()
                self._pace.wait(self._engine.now)
            if self._window is not None:
                self._window.show()
            wall = time.monotonic()
            if wall - report_at >= _HEALTH_PERIOD:
                self._report((self._engine.now - report_sim) / (wall - report_at))
                report_at, report_sim = wall, self._engine.now
        self.close()

    def close(self) -> None:
        """Close the sensors' links and the engine."""
        for client in self._clients.values():
            client.stop(0.0)
        if self._hardware is not None:
            self._hardware.close()
        self._engine.close()

    def _place(self, robot: RobotDescription, *, is_given: bool) -> None:
        """Place the robot at its start; if nobody has said where, at the free place nearest to the origin."""
        p = self._params
        start = Pose2D(p.x, p.y, p.yaw)
        if is_given or rospy.has_param("~x") or rospy.has_param("~y"):
            self._engine.spawn_robot(robot, start)
            return
        place = self._engine.spawn_near(robot, start)
        if place != start:
            text = "because the origin is no place for it; x:= and y:= place it elsewhere"
            rospy.logwarn("the robot starts at (%.2f, %.2f), %s", place.x, place.y, text)

    def _restart_pace(self) -> None:
        self._pace.restart(self._engine.now)
        if self._shared is not None:
            self._shared.restart(self._engine.now)

    def _follow(self, shared: SharedClock) -> None:
        """Advance once the shared clock is far enough."""
        if shared.is_due(self._engine.now + TICK):
            self._advance()
        else:
            time.sleep(_FOLLOW_PERIOD)

    def _advance(self) -> None:
        command = self._command.take()
        if command is not None and not self._engine.faults.is_silent("base"):
            self._engine.command(twist_from_msg(command))
        for _ in range(STEPS_PER_TICK):
            if self._scenario is not None:
                self._scenario.advance()
            self._engine.step()
        self._tick += 1
        if self._hardware is not None:
            self._hardware.advance()
        self._outputs.publish(self._tick)
        self._faults.follow()
        for sensor, is_high in self._engine.motion_sensors.changes(self._engine.now):
            self._clients[sensor].set_motion(is_high)

    def _step_ticks(self, ticks: int) -> None:
        if not self._paused:
            raise WorldError("simulation", "runs: pause it before you step it")
        for _ in range(ticks):
            self._advance()

    def _set_paused(self, paused: bool) -> None:
        self._paused = paused
        log.info("the simulation %s", "is paused" if paused else "goes on")

    def _report_world(self, world: World) -> None:
        files = count_of(len(world.lost), "file")
        text = f"{files} of the world cannot be used" if world.lost else "every file of the world was found"
        values = {f"file {number}": sentence for number, sentence in enumerate(world.lost, 1)}
        self._health.set("world", WARN if world.lost else OK, text, values)

    def _report(self, factor: float) -> None:
        slow = self._params.rate > 0.0 and factor < 0.9 * self._params.rate and not self._paused
        text = f"paused at {self._engine.now:.1f} s" if self._paused else f"{factor:.2f} x real time"
        if self._shared is not None and not self._paused:
            behind = self._shared.behind(self._engine.now)
            slow, text = behind > _BEHIND, f"{text}, {max(behind, 0.0):.2f} s behind /clock"
        values = {
            "real-time factor": f"{factor:.2f}",
            "simulated time": f"{self._engine.now:.1f}",
            "actors": len(self._engine.population.walkers),
            "motion sensors linked": sum(c.connected for c in self._clients.values()),
        }
        self._health.set("", WARN if slow else OK, text, values)
        if self._params.rate == 0.0 and self._shared is None:
            self._report_lockstep()

    def _report_lockstep(self) -> None:
        waited = {name: f"{seconds:.2f} s of the last second" for name, seconds in self._lockstep.take_waited().items()}
        idle = self._lockstep.idle
        if idle:
            text = f"goes on without {', '.join(idle)}"
        else:
            text = f"waits for {', '.join(waited)}" if waited else "waits for nobody"
        self._health.set("lockstep", WARN if idle else OK, text, waited)


def _port(place: SensorPlace, p: SimulatorParams) -> int:
    """TCP port of a sensor's bridge; the file's ports count from 11411. Raises ParamError."""
    port = place.port - DEFAULT_TCP_PORT + p.bridge_port
    if not 0 <= port <= 65535:
        problem = f"is {p.bridge_port}, but then sensor {place.id} of {p.motion_sensors} has port {port}"
        raise ParamError(f"{rospy.get_name()}/bridge_port", f"{problem}, expected 0 to 65535")
    return port


def _set_by(scenario: Scenario, p: SimulatorParams) -> SimulatorParams:
    """The parameters, with the scenario's values replacing their own."""
    setting, start = scenario.setting, scenario.robot or Start(x=p.x, y=p.y, yaw=p.yaw)
    return dataclasses.replace(
        p,
        world=setting.world or p.world,
        motion_sensors=setting.motion_sensors or p.motion_sensors,
        seed=p.seed if setting.seed is None else setting.seed,
        camera=dataclasses.replace(p.camera, light=setting.light or p.camera.light),
        x=start.x,
        y=start.y,
        yaw=start.yaw,
    )


def _open_window(engine: Engine) -> Window:
    from rosbot_patrol.ros.simulator.window import Window  # OpenCV takes 100 MB; only the window needs it

    return Window(engine)


def _description(p: SimulatorParams) -> RobotDescription:
    if p.urdf:
        return load_robot(p.urdf, package_finder(p.model_path))
    name = rospy.search_param("robot_description") or rospy.resolve_name("robot_description")
    text = rospy.get_param(name, "")
    if not text:
        raise WorldError(name, "is missing: give the robot's URDF there, or a file in ~urdf")
    return parse_robot(text, source=name, find_package=package_finder(p.model_path))


def main() -> None:
    """Load parameters, world and robot; simulate."""
    run_node("simulator", lambda: Simulator(load_params(SimulatorParams)).run(), priority=Priority.RAISED)
