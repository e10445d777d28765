"""The engine is exact: same seed and same commands at the same simulated times, same data bit for bit, whatever the
machine is doing, whoever listens, however often it is stopped in between."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import simulator_run
from simulator_run import SENSORS, Data, make_engine, record

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.engine import STEP, Engine

RUN = Path(__file__).with_name("simulator_run.py")
SHORT = 800  # steps: 4 s


def differing(a: Data, b: Data) -> list[str]:
    """Sensors whose data are not the same in every bit."""
    assert a.keys() == b.keys()
    return [name for name in a if a[name].dtype != b[name].dtype or a[name].tobytes() != b[name].tobytes()]


def run(file: Path, seconds: float, seed: int, *listen: str, **environment: str) -> subprocess.Popen[bytes]:
    """A run in a process of its own."""
    command = [sys.executable, str(RUN), str(file), str(seconds), str(seed), *listen]
    return subprocess.Popen(command, env={**os.environ, **environment})


def finished(process: subprocess.Popen[bytes], file: Path, seconds: float = 200.0) -> Data:
    """What that run left."""
    assert process.wait(seconds) == 0
    with np.load(file) as archive:
        return {name: archive[name] for name in archive.files}


def fresh(
    seed: int = 1,
    listen: tuple[str, ...] = SENSORS,
    *,
    act: Callable[[Engine, int], None] = simulator_run.act,
    between: Callable[[Engine, int], object] | None = None,
) -> Data:
    """Four seconds in this process."""
    engine = make_engine(seed)
    try:
        return record(engine, SHORT, listen, act=act, between=between)
    finally:
        engine.close()


@pytest.fixture(scope="module")
def plain() -> Data:
    return fresh()


@pytest.mark.slow
def test_sixty_seconds_repeat_bit_for_bit_in_another_process_on_a_loaded_machine(tmp_path: Path) -> None:
    quiet = finished(run(tmp_path / "quiet.npz", 60.0, 7), tmp_path / "quiet.npz")
    load = [
        subprocess.Popen([sys.executable, "-c", "while True: sum(range(10000))"]) for _ in range(os.cpu_count() or 1)
    ]
    try:
        loaded = finished(run(tmp_path / "loaded.npz", 60.0, 7), tmp_path / "loaded.npz")
    finally:
        for process in load:
            process.kill()
            process.wait()
    assert not differing(quiet, loaded)
    assert set(quiet) == set(SENSORS)
    scans = quiet["lidar"].reshape(-1, 720)
    assert len(scans) == 600
    assert np.isfinite(scans).any(axis=1).all()
    assert quiet["contacts"].any()
    assert 0.0 < quiet["motion"].mean() < 1.0
    assert set(quiet["doors"]) >= {0.0, 1.0}
    moved = np.ptp(quiet["actors"].reshape(600, 4, 4), axis=0)
    assert (np.hypot(moved[:, 0], moved[:, 1]) > 0.3).all(), "everybody walks"


def test_another_seed_gives_other_noise_everywhere_that_there_is_some(plain: Data) -> None:
    noisy = {"lidar", "ranges", "imu", "truth", "actors", "colour", "depth"}
    assert noisy <= set(differing(plain, fresh(seed=2)))


@pytest.mark.parametrize("alone", SENSORS)
def test_a_sensor_gives_the_same_when_nobody_listens_to_the_others(plain: Data, alone: str) -> None:
    assert not differing({alone: plain[alone]}, fresh(listen=(alone,)))


def test_the_order_of_who_listens_does_not_matter(plain: Data) -> None:
    assert not differing({name: plain[name] for name in SENSORS[::-1]}, fresh(listen=SENSORS[::-1]))


def test_asking_at_other_times_too_changes_nothing(plain: Data) -> None:
    def curious(engine: Engine, i: int) -> None:
        if i % 7 == 0:
            engine.scan()
            engine.ranges()
            engine.imu()
            engine.touches()
        if i % 130 == 5:
            engine.picture(colour=False)
            engine.view_from_above()

    assert not differing(plain, fresh(between=curious))


def test_a_pause_of_the_wall_clock_leaves_no_trace(plain: Data) -> None:
    def nap(engine: Engine, i: int) -> None:
        if i % 200 == 0:
            time.sleep(0.05)

    assert not differing(plain, fresh(between=nap))


def into_a_wall(engine: Engine, i: int) -> None:
    if i % 20 == 0:
        engine.command(Twist2D(-0.4, 0.0, 0.1))


@pytest.mark.parametrize("act", [simulator_run.act, into_a_wall])
def test_what_is_refused_leaves_no_trace(act: Callable[[Engine, int], None]) -> None:
    def blunder(engine: Engine, i: int) -> None:
        if i % 100 != 3:
            return
        for wrong in (
            lambda: engine.population.spawn_actor("ann", "person", "", Pose2D()),
            lambda: engine.population.spawn_actor("", "elk", "", Pose2D()),
            lambda: engine.population.move_actor("ann", [Pose2D(30.0, 0.5)], 1.0),
            lambda: engine.population.move_actor("nobody", [Pose2D()], 1.0),
            lambda: engine.population.set_door("door", 3.0),
            lambda: engine.population.remove("nobody"),
            lambda: engine.carry(Pose2D(-0.9, -1.2)),
            lambda: engine.population.place_box("box", engine.pose, (0.5, 0.5, 0.5)),
            lambda: engine.spawn_robot(engine.robot.description),
        ):
            with pytest.raises(PatrolError):
                wrong()

    without = fresh(act=act)
    assert without["contacts"].any() == (act is into_a_wall)
    assert not differing(without, fresh(act=act, between=blunder))


def test_who_comes_and_goes_elsewhere_does_not_renumber_anybody_s_noise(plain: Data) -> None:
    def visitors(engine: Engine, i: int) -> None:
        simulator_run.act(engine, i)
        if i % 100 == 10:
            engine.population.spawn_actor("", "person", "", Pose2D(-40.0, -40.0))
            engine.population.spawn_actor("", "dog", "", Pose2D(-42.0, -40.0))
            engine.population.roam_actor("dog_1", 1.0, 1.0)
        if i % 100 == 60:
            engine.population.remove("dog_1")
            engine.population.remove("person_1")

    among = [name for name in SENSORS if name != "actors"]
    assert not differing({name: plain[name] for name in among}, fresh(listen=tuple(among), act=visitors))


def test_a_reset_robot_begins_as_a_new_one_does() -> None:
    """At its start, at rest, odometry at zero; what noise is left in the slip, the same for the same history."""

    def after_reset() -> tuple[list[object], Data]:
        engine = make_engine(5)
        record(engine, 400, ())
        engine.reset()
        state: list[object] = [
            engine.pose,
            engine.robot.odometry.pose,
            engine.robot.odometry.twist,
            engine.robot.wheels[1],
        ]
        data = record(engine, 400)
        engine.close()
        return state, data

    (state, first), (_, second) = after_reset(), after_reset()
    assert state == [Pose2D(), Pose2D(), (0.0, 0.0, 0.0), (0.0, 0.0)]
    assert not differing(first, second)


def test_kernels_give_the_same_without_being_compiled(tmp_path: Path) -> None:
    slow = run(tmp_path / "slow.npz", 0.75, 7, NUMBA_DISABLE_JIT="1")
    fast = finished(run(tmp_path / "fast.npz", 0.75, 7), tmp_path / "fast.npz")
    for name, data in finished(slow, tmp_path / "slow.npz").items():
        assert np.allclose(data, fast[name], rtol=0.0, atol=1e-12, equal_nan=True), name
    assert np.isfinite(fast["lidar"]).mean() > 0.5


def test_time_is_counted_in_steps() -> None:
    engine = make_engine(0)
    assert engine.now == 0.0
    record(engine, 333, ())
    assert engine.now == 333 * STEP
    engine.close()
