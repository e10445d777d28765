"""The RGB-D camera: a renderer's pictures with the real camera's limits and noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, Twist2D, compose
from rosbot_patrol.params import param
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.scene.scene import Body, Intrinsics, Matrix, Mover, SceneRenderer
from rosbot_patrol.simulation.sensors import picture_kernels as kernels

_BANK = 8
_BLUR_VIEWS = 4, 16  # number of pictures averaged for motion blur: least, most
_BLUR_TURN = 0.006  # rotation between two of them [rad]
_BRIGHT = 115.0  # target mean colour of the automatic exposure, of 255
_GAINS = (0.4, 2.5)
_NO_DEPTH_NOISE = np.zeros(0, np.float32)
_ROBOT = "the robot, in the window"


@dataclass(frozen=True, kw_only=True)
class CameraParams:
    """Parameters of the camera; defaults as Gazebo's openni_kinect plug-in for the ROSbot, with a little noise."""

    width: int = param(640, unit="px", lo=16, hi=4096, doc="width of the image")
    height: int = param(480, unit="px", lo=16, hi=4096, doc="height of the image")
    horizontal_fov: float = param(1.047, unit="rad", lo=0.1, hi=3.0, doc="horizontal field of view")
    depth_min: float = param(0.4, unit="m", lo=0.0, doc="minimum depth; smaller ones are NaN")
    depth_max: float = param(5.0, unit="m", lo=0.1, doc="maximum depth; larger ones are NaN")
    noise: float = param(2.0, lo=0.0, hi=50.0, doc="standard deviation of a colour value (0 to 255)")
    depth_noise: float = param(
        0.0012, lo=0.0, doc="standard deviation of depth at 1 m [m]; it grows with the square of the depth"
    )
    exposure: float = param(1.0, lo=0.01, hi=20.0, doc="gain of the colours; at 1 a white surface in full light is 255")
    auto_exposure: bool = param(False, doc="choose the gain from each image's brightness")
    blur: float = param(0.0, unit="s", lo=0.0, hi=0.2, doc="exposure time; motion blurs the colours")
    renderer: str = param("egl", choices=("egl", "tiny"), doc="egl: OpenGL without a display; tiny: PyBullet's own")

    @property
    def intrinsics(self) -> Intrinsics:
        """The pinhole model of the optics."""
        focal = self.width / 2.0 / np.tan(self.horizontal_fov / 2.0)
        return Intrinsics(
            width=self.width,
            height=self.height,
            fx=float(focal),
            fy=float(focal),
            cx=(self.width - 1.0) / 2.0,
            cy=(self.height - 1.0) / 2.0,
        )


@dataclass(frozen=True)
class Picture:
    """Colour (height, width, 3) and depth [m] (height, width), NaN where the sensor measures none."""

    colour: NDArray[np.uint8]
    depth: NDArray[np.float32]


@dataclass
class Camera:
    """Keep a renderer's scene in step with the world; the first picture makes the renderer.

    Args:
        params: optics and noise.
        make_renderer: makes the renderer, in the thread that takes pictures.
        bodies: the static bodies.
        boxes: further bodies by name, which the simulation's thread adds and removes.
        seed: seed of the noise.
    """

    params: CameraParams
    make_renderer: Callable[[], SceneRenderer]
    bodies: Iterable[Body]
    boxes: Mapping[str, Body] = field(default_factory=dict)
    seed: int = 0
    _renderer: SceneRenderer | None = None
    _shown: dict[str, Mover] = field(default_factory=dict)
    _boxes_shown: dict[str, Body] = field(default_factory=dict)
    _bank: list[NDArray[np.int8]] = field(default_factory=list)
    _depth_bank: list[NDArray[np.float32]] = field(default_factory=list)

    @property
    def renderer(self) -> SceneRenderer:
        """The renderer; made at the first access."""
        if self._renderer is None:
            self._renderer = self.make_renderer()
            for body in self.bodies:
                self._renderer.add(body)
            self._fill_banks()
        return self._renderer

    def take(
        self,
        world_from_optical: Matrix,
        walkers: Iterable[Mover],
        sample: int,
        *,
        colour: bool = True,
        depth: bool = True,
        earlier: Sequence[Matrix] = (),
    ) -> Picture:
        """Take one picture; its number `sample` selects the noise. Unrequested channels stay as drawn.

        Args:
            world_from_optical: pose of the camera, shape (4, 4).
            walkers: actors and doors.
            sample: number of the picture.
            colour: whether to add exposure and noise to the colour.
            depth: whether to add limits and noise to the depth.
            earlier: poses of the camera while the shutter was open.
        """
        self._show(list(walkers))
        optics = self.params.intrinsics
        blurred = [self.renderer.render(pose, optics)[0] for pose in earlier] if colour else []
        drawn, metres = self.renderer.render(world_from_optical, optics)
        if blurred:
            drawn = np.rint(np.mean([*blurred, drawn], axis=0, dtype=np.float32)).astype(np.uint8)
        return Picture(
            self._noisy_colour(self._exposed(drawn), sample) if colour else drawn,
            self._sensed_depth(metres, sample) if depth else metres,
        )

    def view(self, world_from_optical: Matrix, walkers: Iterable[Mover], robot: Body | None) -> NDArray[np.uint8]:
        """Draw a view from another pose without noise, shape (height, width, 3), with the robot in it."""
        self._show(list(walkers))
        if robot is not None:
            self.renderer.add(replace(robot, name=_ROBOT))
        try:
            return self.renderer.render(world_from_optical, self.params.intrinsics)[0]
        finally:
            if robot is not None:
                self.renderer.remove(_ROBOT)

    def close(self) -> None:
        """Release the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _show(self, walkers: list[Mover]) -> None:
        renderer = self.renderer
        self._show_boxes()
        present = {w.name: w for w in walkers}
        for name in [n for n, w in self._shown.items() if present.get(n) is not w]:
            renderer.remove(name)
            del self._shown[name]
        for name, walker in present.items():
            if name not in self._shown:
                renderer.add(walker.body)
                self._shown[name] = walker
            renderer.move(name, walker.matrix)
            parts = walker.pose_parts()
            if parts is not None:
                renderer.pose_visuals(name, parts)

    def _show_boxes(self) -> None:
        wanted = dict(self.boxes)
        for name in [n for n, body in self._boxes_shown.items() if wanted.get(n) is not body]:
            self.renderer.remove(name)
            del self._boxes_shown[name]
        for name in wanted.keys() - self._boxes_shown.keys():
            self.renderer.add(wanted[name])
            self._boxes_shown[name] = wanted[name]

    def _fill_banks(self) -> None:
        p = self.params
        if p.noise > 0.0:
            for i in range(_BANK):
                flat = noise_of(self.seed, "camera", i).standard_normal((p.height, p.width, 3), dtype=np.float32)
                self._bank.append(np.clip(np.rint(flat * p.noise), -127, 127).astype(np.int8))
        if p.depth_noise > 0.0:
            for i in range(_BANK):
                flat = noise_of(self.seed, "depth", i).standard_normal((p.height, p.width), dtype=np.float32)
                self._depth_bank.append(flat * np.float32(p.depth_noise))

    def _exposed(self, colour: NDArray[np.uint8]) -> NDArray[np.uint8]:
        gain = self.params.exposure
        if self.params.auto_exposure:
            mean = float(colour[::8, ::8].mean())
            gain = min(max(_BRIGHT / max(mean, 1.0), _GAINS[0]), _GAINS[1])
        if gain == 1.0:
            return colour
        table = np.clip(np.rint(np.arange(256) * gain), 0, 255).astype(np.uint8)
        return np.asarray(table[colour])

    def _noisy_colour(self, colour: NDArray[np.uint8], sample: int) -> NDArray[np.uint8]:
        if not self._bank:
            return colour
        noise = self._bank[sample % _BANK].ravel()
        drawn, seen = colour.ravel(), np.empty(colour.size, np.uint8)
        start = sample // _BANK * 37 % colour.shape[0] * colour.shape[1] * 3  # rows of a noise bank, shifted down
        kernels.add_noise(drawn[:start], noise[colour.size - start :], seen[:start])
        kernels.add_noise(drawn[start:], noise[: colour.size - start], seen[start:])
        return seen.reshape(colour.shape)

    def _sensed_depth(self, depth: NDArray[np.float32], sample: int) -> NDArray[np.float32]:
        p = self.params
        noise = self._depth_bank[sample % _BANK].ravel() if self._depth_bank else _NO_DEPTH_NOISE
        sensed = np.empty(depth.size, np.float32)
        exact = np.ascontiguousarray(depth, np.float32).ravel()
        kernels.sense_depth(exact, noise, p.depth_min, p.depth_max, sensed)
        return sensed.reshape(depth.shape)


def poses_before(pose: Pose2D, twist: Twist2D, seconds: float) -> list[Pose2D]:
    """Poses of a moving base while the shutter was open, without the last; the velocity is in its own frame."""
    if seconds <= 0.0 or (twist.vx == twist.vy == twist.wz == 0.0):
        return []
    views = min(max(math.ceil(abs(twist.wz) * seconds / _BLUR_TURN), _BLUR_VIEWS[0]), _BLUR_VIEWS[1])
    steps = [-seconds * k / views for k in range(views - 1, 0, -1)]
    return [compose(pose, Pose2D(twist.vx * t, twist.vy * t, twist.wz * t)) for t in steps]
