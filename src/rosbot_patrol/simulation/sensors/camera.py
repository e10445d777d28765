"""The RGB-D camera: a renderer's pictures with the real camera's limits and noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from rosbot_patrol.params import param
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.scene.scene import Body, Intrinsics, Matrix, Mover, SceneRenderer
from rosbot_patrol.simulation.sensors import picture_kernels as kernels
from rosbot_patrol.simulation.sensors.exposure import AutoExposure

_BANK = 8
_LEAST_MOTION = 0.5  # of the scene in the picture that is worth computing [px]
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
    auto_exposure: bool = param(True, doc="choose the gain from the images' brightness")
    settling: float = param(0.3, unit="s", lo=0.0, hi=10.0, doc="time constant of the automatic exposure")
    blur: float = param(0.02, unit="s", lo=0.0, hi=0.2, doc="exposure time; a turn blurs the colours")
    readout: float = param(
        0.025, unit="s", lo=-0.2, hi=0.2, doc="time from the first row to the last; a turn slants the colours"
    )
    jpeg_quality: int = param(80, lo=0, hi=100, doc="compression of the colours, as of a USB camera; 0: none")
    light: str = param(
        "day",
        choices=("day", "noon", "evening", "lamps", "torch"),
        doc="light of the scene; torch: the robot carries the only lamp",
    )
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
    _exposure: AutoExposure | None = None

    def __post_init__(self) -> None:
        if self.params.auto_exposure:
            self._exposure = AutoExposure(self.params.settling)

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
        now: float = 0.0,
        turning: float = 0.0,
        colour: bool = True,
        depth: bool = True,
    ) -> Picture:
        """Take one picture; its number `sample` selects the noise. Unrequested channels stay as drawn.

        Args:
            world_from_optical: pose of the camera, shape (4, 4).
            walkers: actors and doors.
            sample: number of the picture.
            now: time of the picture [s].
            turning: speed of the camera about its vertical axis, positive to the left [rad/s].
            colour: whether to add shutter, exposure, noise and compression to the colour.
            depth: whether to add limits and noise to the depth.
        """
        self._show(list(walkers))
        drawn, metres = self.renderer.render(world_from_optical, self.params.intrinsics)
        return Picture(
            self._sensed_colour(drawn, sample, now, turning) if colour else drawn,
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

    def _sensed_colour(self, drawn: NDArray[np.uint8], sample: int, now: float, turning: float) -> NDArray[np.uint8]:
        """Colours after shutter, exposure, noise and compression, in the order of a real camera."""
        gain = self.params.exposure
        if self._exposure is not None:
            gain = self._exposure.gain(float(drawn[::8, ::8].mean()), now)
        exposed = np.clip(np.rint(np.arange(256) * gain), 0, 255).astype(np.uint8)
        seen = self._noisy_colour(self._shuttered(drawn, turning), exposed, sample)
        quality = self.params.jpeg_quality
        if not quality:
            return seen
        packed = simplejpeg.encode_jpeg(np.ascontiguousarray(seen), quality, "RGB", "420")
        return np.asarray(simplejpeg.decode_jpeg(packed))

    def _shuttered(self, drawn: NDArray[np.uint8], turning: float) -> NDArray[np.uint8]:
        moving = turning * self.params.intrinsics.fx  # the middle of the picture [px/s]
        smear, slant = abs(moving) * self.params.blur, moving * self.params.readout
        if max(smear, abs(slant)) < _LEAST_MOTION:
            return drawn
        rows = np.ascontiguousarray(drawn).reshape(len(drawn), -1)
        seen = np.empty(rows.shape, np.uint8)
        kernels.roll_and_smear(rows, slant, smear, seen)
        return seen.reshape(drawn.shape)

    def _noisy_colour(self, drawn: NDArray[np.uint8], exposed: NDArray[np.uint8], sample: int) -> NDArray[np.uint8]:
        if not self._bank:
            return np.asarray(exposed[drawn])
        noise = self._bank[sample % _BANK].ravel()
        colours, seen = drawn.ravel(), np.empty(drawn.size, np.uint8)
        start = sample // _BANK * 37 % drawn.shape[0] * drawn.shape[1] * 3  # rows of a noise bank, shifted down
        kernels.expose(colours[:start], exposed, noise[colours.size - start :], seen[:start])
        kernels.expose(colours[start:], exposed, noise[: colours.size - start], seen[start:])
        return seen.reshape(drawn.shape)

    def _sensed_depth(self, depth: NDArray[np.float32], sample: int) -> NDArray[np.float32]:
        p = self.params
        noise = self._depth_bank[sample % _BANK].ravel() if self._depth_bank else _NO_DEPTH_NOISE
        sensed = np.empty(depth.size, np.float32)
        exact = np.ascontiguousarray(depth, np.float32).ravel()
        kernels.sense_depth(exact, noise, p.depth_min, p.depth_max, sensed)
        return sensed.reshape(depth.shape)
