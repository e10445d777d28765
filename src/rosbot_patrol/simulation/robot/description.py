"""The robot from its URDF: shapes, wheels, mass, and the poses of frames and sensors on the base.

The base is the link without a parent joint. Driven wheels are named by their joints, by a parameter or by the drive
plug-in in the file. Otherwise they are the continuous joints with an axis across the robot, left or right of its
middle, and without another moving joint above them; this excludes the swivel and the wheel of a caster. Poses are for
all joints at zero.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import WorldError
from rosbot_patrol.params import param
from rosbot_patrol.simulation.robot.urdf import FindPackage, Joint, Urdf, lateral, read_urdf
from rosbot_patrol.simulation.scene.scene import Body, Collision, Matrix, Visual
from rosbot_patrol.simulation.scene.shapes import triangles_of

log = logging.getLogger(__name__)

_ACROSS = 0.7  # smallest sideways component of an axle's direction
_MIDDLE = 1e-3  # a wheel closer to the middle is on no side [m]
_LASER = ("laser", "lidar", "scan")
_CAMERA = ("camera", "kinect", "realsense", "astra")
_COLOUR = ("rgb", "color", "colour")
_RANGE = {"range", "sonar", "ultrasonic"}
_RAYS = ("ray", "gpu_ray", "lidar", "gpu_lidar")
_FAN = 1.0  # a sensor with a narrower fan of beams measures one distance, and is no lidar [rad]
_STANDS = 0.01  # a base this much below its wheels' axles stands on the floor [m]
# Rows: the camera's axes (x right, y down, z forward) in a frame with x forward, y left, z up.
_BODY_FROM_OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


@dataclass(frozen=True, kw_only=True)
class FrameParams:
    """Links of the sensors; needed if their names do not identify them."""

    laser: str = param("", doc="link of the lidar; empty: found by its name")
    camera: str = param("", doc="link of the camera; empty: found by its name")
    imu: str = param("", doc="link of the IMU; empty: found by its name")
    ranges: tuple[str, ...] = param((), doc="links of the range sensors; empty: found by their names")


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """A moving joint, with its wheel if it has one.

    Attributes:
        joint: its name.
        radius: radius of the wheel [m], 0 if no shape gives it.
        x, y, z: position of the joint on the base [m].
        contact_y: y of the wheel's middle [m].
        forward: 1 if a positive turn drives forward, -1 if backward.
    """

    joint: str
    radius: float
    x: float
    y: float
    z: float
    contact_y: float
    forward: int = 1


@dataclass(frozen=True, kw_only=True)
class Mount:
    """A sensor's mounting: the frame of its messages, and base_from_sensor."""

    frame: str
    pose: Matrix


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """The parts of a URDF that the simulator needs.

    Attributes:
        source: origin of the description, for messages.
        base: the base's link.
        frames: base_from_frame of every link, shape (4, 4) each.
        hinges: every moving joint, in the order of the file.
        left, right: joints of the driven wheels, on each side.
        body: visuals and collisions in the base frame.
        mass: total mass [kg].
        laser, camera, imu: mounting of each sensor, None if the robot has none. The camera looks along z.
        ranges: the range sensors.
    """

    name: str
    source: str
    base: str
    frames: dict[str, Matrix]
    hinges: tuple[Hinge, ...]
    left: tuple[str, ...]
    right: tuple[str, ...]
    body: Body
    mass: float
    laser: Mount | None = None
    camera: Mount | None = None
    imu: Mount | None = None
    ranges: tuple[Mount, ...] = ()

    @property
    def wheels(self) -> tuple[Hinge, ...]:
        """The driven wheels, in the order of the file."""
        return tuple(h for h in self.hinges if h.joint in self.left or h.joint in self.right)

    @property
    def base_height(self) -> float:
        """Height of the base frame above the floor [m], with the driven wheels on it."""
        return max((w.radius - w.z for w in self.wheels), default=0.0)

    @property
    def wheel_radius(self) -> float:
        """Radius of the driven wheels [m], 0 if no shape gives it."""
        return max((w.radius for w in self.wheels), default=0.0)

    @property
    def track(self) -> float:
        """Distance between the contact lines of left and right wheels [m]."""
        left = [w.contact_y for w in self.wheels if w.joint in self.left]
        right = [w.contact_y for w in self.wheels if w.joint in self.right]
        return float(np.mean(left) - np.mean(right)) if left and right else 0.0

    @property
    def is_skid_steered(self) -> bool:
        """Whether a side has several wheels, so that turning drags them sideways."""
        return max(len(self.left), len(self.right)) > 1

    def fitted(self, left: Sequence[str], right: Sequence[str], frames: FrameParams) -> RobotDescription:
        """The same robot with the named wheels and sensors; others stay as found.

        Raises:
            WorldError: a name does not exist, or a side has no driven wheels left.
        """
        self._check_joints(left, right)
        chosen = replace(self, left=tuple(left) or self.left, right=tuple(right) or self.right)
        if not chosen.left and not chosen.right:
            raise WorldError(self.source, "has no continuous joint across the robot, so no wheels to drive by")
        if not chosen.left or not chosen.right or chosen.track <= 0.0:
            raise WorldError(self.source, "has wheels on one side only")
        return replace(
            chosen,
            laser=self._mount(frames.laser, "laser") or self.laser,
            camera=_looking(self._mount(frames.camera, "camera")) or self.camera,
            imu=self._mount(frames.imu, "imu") or self.imu,
            ranges=tuple(m for f in frames.ranges if (m := self._mount(f, "ranges"))) or self.ranges,
        )

    def _check_joints(self, left: Sequence[str], right: Sequence[str]) -> None:
        known = [hinge.joint for hinge in self.hinges]
        for side, names in (("left", left), ("right", right)):
            missing = next((name for name in names if name not in known), None)
            if missing is not None:
                there = ", ".join(known) or "none"
                problem = f"drive.{side}_joints names '{missing}', which is no joint that moves (there: {there})"
                raise WorldError(self.source, problem)
        if set(left) & set(right):
            raise WorldError(self.source, f"'{min(set(left) & set(right))}' is named as a left and as a right joint")

    def _mount(self, link: str, key: str) -> Mount | None:
        if not link:
            return None
        if link not in self.frames:
            raise WorldError(self.source, f"frames.{key} names '{link}', which is no link of robot '{self.name}'")
        return Mount(frame=link, pose=self.frames[link])


def load_robot(path: str | Path, find_package: FindPackage = lambda _: None) -> RobotDescription:
    """Read a URDF file; raises WorldError."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as err:
        raise WorldError(path, f"cannot be read: {err.strerror}") from err
    except UnicodeDecodeError as err:
        raise WorldError(path, f"is no text in UTF-8 ({err.reason} at byte {err.start})") from err
    return parse_robot(text, source=str(path), find_package=find_package)


def parse_robot(
    text: str, *, source: str = "robot_description", find_package: FindPackage = lambda _: None
) -> RobotDescription:
    """Parse a URDF text.

    Args:
        text: the URDF (expanded, no xacro).
        source: origin of the text, for messages.
        find_package: folder of a package or model by name, None if it is unknown.

    Raises:
        WorldError: it is not URDF, its joints form no tree, or a number is invalid.
    """
    urdf = read_urdf(text, source, find_package)
    for sentence in urdf.lost:
        log.warning("%s", sentence)
    if urdf.lost:
        log.warning("%s: %s left out", source, count_of(len(urdf.lost), "mesh is", "meshes are"))
    frames = urdf.frames()
    visuals = [replace(v, pose=frames[n] @ v.pose) for n, link in urdf.links.items() for v in link.visuals]
    collisions = [replace(c, pose=frames[n] @ c.pose) for n, link in urdf.links.items() for c in link.collisions]
    left, right = _sides(urdf, frames)
    return RobotDescription(
        name=urdf.name,
        source=source,
        base=urdf.root,
        frames=frames,
        hinges=tuple(_hinge(j, urdf, frames) for j in urdf.joints if _moves(j)),
        left=left,
        right=right,
        body=Body(name=urdf.name, kind="robot", static=False, visuals=tuple(visuals), collisions=tuple(collisions)),
        mass=sum(link.mass for link in urdf.links.values()) or 5.0,
        laser=_laser(urdf, frames),
        camera=_camera(urdf, frames),
        imu=_imu(urdf, frames),
        ranges=_ranges(urdf, frames),
    )


def _moves(joint: Joint) -> bool:
    return joint.kind in ("continuous", "revolute")


def _sides(urdf: Urdf, frames: dict[str, Matrix]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if all(urdf.drive):
        return urdf.drive
    carrier = {j.child: j for j in urdf.joints}

    def is_carried(link: str) -> bool:
        while link in carrier:
            if carrier[link].kind != "fixed":
                return True
            link = carrier[link].parent
        return False

    found = [
        j
        for j in urdf.joints
        if j.kind == "continuous" and abs(lateral(frames[j.child], j.axis)) > _ACROSS and not is_carried(j.parent)
    ]
    y = {j.name: float(frames[j.child][1, 3]) for j in found}
    return tuple(n for n in y if y[n] > _MIDDLE), tuple(n for n in y if y[n] < -_MIDDLE)


def _hinge(joint: Joint, urdf: Urdf, frames: dict[str, Matrix]) -> Hinge:
    pose, link = frames[joint.child], urdf.links[joint.child]
    radius, middle = _wheel(link.collisions or link.visuals, joint.axis, pose)
    if not radius and joint.kind == "continuous" and pose[2, 3] > _STANDS:
        radius = float(pose[2, 3])
        log.warning(
            "wheel '%s' has no shape: its radius is its height above '%s', %.3f m", joint.name, urdf.root, radius
        )
    return Hinge(
        joint=joint.name,
        radius=radius,
        x=float(pose[0, 3]),
        y=float(pose[1, 3]),
        z=float(pose[2, 3]),
        contact_y=float(pose[1, 3]) + middle,
        forward=1 if lateral(pose, joint.axis) >= 0.0 else -1,
    )


def _wheel(parts: Iterable[Collision | Visual], axis: tuple[float, ...] | None, pose: Matrix) -> tuple[float, float]:
    """Radius of a wheel's shapes about its axle, and their middle to the left of its joint [m]; 0, 0 without shapes."""
    parts = tuple(parts)
    for part in parts:
        if part.shape.kind in ("cylinder", "sphere"):
            return part.shape.size[0], float((pose[:3, :3] @ part.pose[:3, 3])[1])
    if not parts:
        return 0.0, 0.0
    points = np.vstack([triangles_of(p.shape)[0] @ p.pose[:3, :3].T + p.pose[:3, 3] for p in parts])
    axle = pose[:3, :3].T @ [0.0, 1.0, 0.0] if axis is None else np.asarray(axis, float)
    axle = axle / max(float(np.linalg.norm(axle)), 1e-9)
    across = points - np.outer(points @ axle, axle)
    sideways = (points @ pose[:3, :3].T)[:, 1]
    return float(np.linalg.norm(across, axis=1).max()), float(sideways.min() + sideways.max()) / 2.0


def _named(urdf: Urdf, words: Iterable[str]) -> list[str]:
    return [name for name in urdf.links if any(word in name.lower() for word in words)]


def _laser(urdf: Urdf, frames: dict[str, Matrix]) -> Mount | None:
    for tag in urdf.sensors:
        if tag.kind in _RAYS and tag.fan >= _FAN:
            frame = tag.frame if tag.frame in frames else tag.link
            return Mount(frame=frame, pose=frames[tag.link] @ tag.pose)
    names = _named(urdf, _LASER)
    best = next((n for n in ("laser", "laser_frame", "base_scan") if n in names), names[0] if names else None)
    return None if best is None else Mount(frame=best, pose=frames[best])


def _ranges(urdf: Urdf, frames: dict[str, Matrix]) -> tuple[Mount, ...]:
    """The range sensors: links of that name, and those with a sensor that has a narrow fan of beams."""
    narrow = {tag.link for tag in urdf.sensors if tag.kind == "sonar" or (tag.kind in _RAYS and tag.fan < _FAN)}
    named = [name for name in urdf.links if name in narrow or _RANGE & set(re.split("[^a-z]+", name.lower()))]
    return tuple(Mount(frame=name, pose=frames[name]) for name in named)


def _camera(urdf: Urdf, frames: dict[str, Matrix]) -> Mount | None:
    for tag in urdf.sensors:
        if tag.kind in ("camera", "depth", "multicamera"):
            frame = tag.frame if tag.frame in frames else tag.link
            return Mount(frame=frame, pose=frames[tag.link] @ tag.pose @ _BODY_FROM_OPTICAL)

    def rank(name: str) -> tuple[bool, ...]:
        low, pose = name.lower(), frames[name]
        is_optical = abs(float(pose[2, 2])) < _ACROSS
        return (
            is_optical and low == "camera_depth_frame",
            is_optical,
            "optical" in low,
            any(word in low for word in _COLOUR),
            low.endswith("camera_link"),
        )

    names = _named(urdf, _CAMERA)
    best = max(names, key=rank, default=None)
    return None if best is None else _looking(Mount(frame=best, pose=frames[best]))


def _looking(mount: Mount | None) -> Mount | None:
    """The camera with z forward: a frame with its z axis up looks along x."""
    if mount is None or abs(float(mount.pose[2, 2])) < _ACROSS:
        return mount
    return replace(mount, pose=mount.pose @ _BODY_FROM_OPTICAL)


def _imu(urdf: Urdf, frames: dict[str, Matrix]) -> Mount | None:
    tagged = [tag.link for tag in urdf.sensors if tag.kind == "imu"]
    names = tagged or _named(urdf, ("imu",))
    return Mount(frame=names[0], pose=frames[names[0]]) if names else None
