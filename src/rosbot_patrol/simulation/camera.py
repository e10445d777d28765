"""The RGB-D camera: a renderer's pictures with the limits and the noise of the real one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.params import param
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.scene import Body, Intrinsics, Matrix, SceneRenderer
from rosbot_patrol.simulation.walkers import Walker

_BANK = 8
_ROBOT = "the robot, in the window"


@dataclass(frozen=True, kw_only=True)
class CameraParams:
    """The camera; defaults as Gazebo's openni_kinect plug-in was set up for the ROSbot, with a little noise."""

    width: int = param(640, unit="px", lo=16, hi=4096, doc="width of a picture")
    height: int = param(480, unit="px", lo=16, hi=4096, doc="height of a picture")
    horizontal_fov: float = param(1.047, unit="rad", lo=0.1, hi=3.0, doc="opening")
    depth_min: float = param(0.4, unit="m", lo=0.0, doc="nearer depth is NaN")
    depth_max: float = param(5.0, unit="m", lo=0.1, doc="farther depth is NaN")
    noise: float = param(2.0, lo=0.0, hi=50.0, doc="standard deviation of a colour, of 255")
    depth_noise: float = param(0.0012, lo=0.0, doc="standard deviation of a depth at 1 m [m], grows with its square")
    renderer: str = param("egl", choices=("egl", "tiny"), doc="egl: OpenGL without a display; tiny: PyBullet's")

    @property
    def intrinsics(self) -> Intrinsics:
        """The pinhole that the optics amount to."""
        focal = self.width / 2.0 / np.tan(self.horizontal_fov / 2.0)
        return Intrinsics(
            width=self.width,
            height=self.height,
            fx=float(focal),
            fy=float(focal),
            cx=(self.width + 1.0) / 2.0 - 0.5,
            cy=(self.height + 1.0) / 2.0 - 0.5,
        )


@dataclass(frozen=True)
class Picture:
    """Colour (height, width, 3) and depth [m] (height, width), NaN where the sensor sees none."""

    colour: NDArray[np.uint8]
    depth: NDArray[np.float32]


@dataclass
class Camera:
    """Keeps a renderer's scene in step with the world; the renderer is made with the first picture.

    Args:
        params: optics and noise.
        make_renderer: builds the renderer, in the thread that takes pictures.
        bodies: what stands still.
        seed: of the noise.
    """

    params: CameraParams
    make_renderer: Callable[[], SceneRenderer]
    bodies: Iterable[Body]
    seed: int = 0
    _renderer: SceneRenderer | None = None
    _shown: dict[str, Walker] = field(default_factory=dict)
    _bank: list[NDArray[np.int8]] = field(default_factory=list)
    _depth_bank: list[NDArray[np.float32]] = field(default_factory=list)

    @property
    def renderer(self) -> SceneRenderer:
        """What draws; made here the first time."""
        if self._renderer is None:
            self._renderer = self.make_renderer()
            for body in self.bodies:
                self._renderer.add(body)
            self._fill_banks()
        return self._renderer

    def take(
        self,
        world_from_optical: Matrix,
        walkers: Iterable[Walker],
        sample: int,
        *,
        colour: bool = True,
        depth: bool = True,
    ) -> Picture:
        """One picture; `sample` is its number and chooses the noise. What is not asked for stays as it was drawn."""
        self._show(list(walkers))
        drawn, metres = self.renderer.render(world_from_optical, self.params.intrinsics)
        return Picture(
            self._noisy_colour(drawn, sample) if colour else drawn,
            self._sensed_depth(metres, sample) if depth else metres,
        )

    def view(self, world_from_optical: Matrix, walkers: Iterable[Walker], robot: Body | None) -> NDArray[np.uint8]:
        """A picture from elsewhere without noise, shape (height, width, 3), with the robot in it."""
        self._show(list(walkers))
        if robot is not None:
            self.renderer.add(replace(robot, name=_ROBOT))
        try:
            return self.renderer.render(world_from_optical, self.params.intrinsics)[0]
        finally:
            if robot is not None:
                self.renderer.remove(_ROBOT)

    def close(self) -> None:
        """Give the renderer back."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _show(self, walkers: list[Walker]) -> None:
        renderer = self.renderer
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

    def _noisy_colour(self, colour: NDArray[np.uint8], sample: int) -> NDArray[np.uint8]:
        if not self._bank:
            return colour
        noise = self._bank[sample % _BANK]
        out = colour.astype(np.int16)
        out += np.roll(noise, sample // _BANK * 37, axis=0) if sample >= _BANK else noise
        return np.clip(out, 0, 255, out=out).astype(np.uint8)

    def _sensed_depth(self, depth: NDArray[np.float32], sample: int) -> NDArray[np.float32]:
        p = self.params
        out = np.array(depth, dtype=np.float32)
        out[(out < p.depth_min) | (out > p.depth_max)] = np.nan
        if self._depth_bank:
            out += self._depth_bank[sample % _BANK] * out * out
        return out
