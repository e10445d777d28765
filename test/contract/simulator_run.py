"""One run through the house with all that a simulation has: what every sensor gave, sample by sample.

As a program, `simulator_run.py FILE SECONDS SEED [SENSOR...]` leaves it in an archive of arrays; with sensors named,
nobody listens to the others.
"""

from __future__ import annotations

import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.actors.doors import plain_door
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import load_world
from rosbot_patrol.simulation.sensors.camera import CameraParams
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

ROOT = Path(__file__).resolve().parents[2]
Data = dict[str, np.ndarray]
CAMERA = CameraParams(width=160, height=120)


def make_engine(seed: int) -> Engine:
    """The house with its motion sensors, the robot, two people, a cat, a dog and a door."""
    engine = Engine(
        load_world(ROOT / "worlds" / "house.world"),
        EngineParams(seed=seed, camera=CAMERA),
        sensors=read_sensors(str(ROOT / "config" / "house_sensors.yaml")),
        make_renderer=make_renderer,
    )
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    engine.population.spawn_door(plain_door("door", Pose2D(0.9, 1.3, 0.0), width=0.7))
    engine.population.spawn_actor("ann", "person", "", Pose2D(2.0, 0.5, 0.0))
    engine.population.move_actor("ann", [Pose2D(3.0, -0.5), Pose2D(2.0, 0.5)], 0.8, True, pause=0.5)
    engine.population.spawn_actor("bob", "person", "", Pose2D(2.5, 0.0, 0.0))
    for name, model in (("tom", "cat"), ("rex", "dog")):
        engine.population.spawn_actor(name, model, "", Pose2D(1.0 if model == "cat" else 2.8, -0.2, 0.0))
        engine.population.roam_actor(name, 1.5, 0.7)
    return engine


def act(engine: Engine, i: int) -> None:
    """What is done to the engine before step `i`."""
    if i % 20 == 0:
        t = i * STEP
        engine.command(Twist2D(0.3 * math.cos(t / 7.0), 0.0, 0.6 * math.sin(t / 3.0)))
    if i % 1000 == 200:
        engine.population.set_door("door", 1.0 if i % 2000 == 200 else 0.0)
    if i == 3000:
        engine.population.roam_actor("bob", 1.0, 1.2)


def _readings(engine: Engine) -> dict[str, tuple[int, Callable[[], Iterable[float] | np.ndarray]]]:
    """Sensor -> (steps between two samples, what it gives)."""
    battery = engine.robot.battery
    return {
        "lidar": (20, lambda: engine.scan().ranges),
        "ranges": (40, lambda: list(engine.ranges().values())),
        "imu": (20, lambda: [engine.imu().yaw, *engine.imu().rates, *engine.imu().accelerations]),
        "odometry": (10, lambda: [*engine.robot.odometry.pose, *engine.robot.odometry.twist]),
        "wheels": (20, lambda: [v for part in engine.robot.wheels for v in part]),
        "truth": (10, lambda: [*engine.pose, *engine.twist]),
        "contacts": (4, lambda: [float(len(engine.touches())), *(t.force for t in engine.touches())]),
        "motion": (20, lambda: [float(level) for level in engine.motion_sensors.levels(engine.now).values()]),
        "battery": (200, lambda: [battery.charge, battery.voltage, battery.current]),
        "actors": (20, lambda: [v for a in engine.population.walkers for v in (*a.pose, a.speed)]),
        "doors": (20, lambda: [d.opening for d in engine.population.doors]),
        "colour": (400, lambda: engine.picture().colour.ravel()),
        "depth": (400, lambda: engine.picture().depth.ravel()),
    }


SENSORS = (
    "lidar", "ranges", "imu", "odometry", "wheels", "truth", "contacts", "motion", "battery", "actors", "doors",
    "colour", "depth",
)  # fmt: skip


def record(
    engine: Engine,
    steps: int,
    listen: Iterable[str] = SENSORS,
    *,
    act: Callable[[Engine, int], None] = act,
    between: Callable[[Engine, int], object] | None = None,
) -> Data:
    """Run and listen.

    Args:
        engine: advanced by `steps`.
        steps: how many.
        listen: sensors that are asked, in this order.
        act: called before each step.
        between: called after each step, something that shall leave no trace.
    """
    readings = _readings(engine)
    heard: dict[str, list[np.ndarray]] = defaultdict(list)
    for i in range(steps):
        act(engine, i)
        engine.step()
        if between is not None:
            between(engine, i)
        for name in listen:
            every, read = readings[name]
            if i % every == 0:
                heard[name].append(np.asarray(read()))
    return {name: np.concatenate([part.ravel() for part in parts]) for name, parts in heard.items()}


def main() -> None:
    """Run as a program."""
    file, seconds, seed, *listen = sys.argv[1:]
    engine = make_engine(int(seed))
    data = record(engine, round(float(seconds) / STEP), listen or SENSORS)
    engine.close()
    np.savez(file, **data)


if __name__ == "__main__":
    main()
