"""The camera's picture in colour and depth, drawn by OpenGL without a display: EGL, on Mesa's software driver or a GPU.

All static bodies share one array of triangles; a body that has moved has its own, with a matrix per visual. As in
Gazebo classic, colours are in the display's colour space: a white face in full light is 255.
"""

from __future__ import annotations

import itertools
import logging
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.render.lights import LIGHTS, Light
from rosbot_patrol.simulation.render.shaders import sources
from rosbot_patrol.simulation.render.shadows import Shadows, shadow_of
from rosbot_patrol.simulation.render.vertices import MAX_PARTS, VERTEX, Triangles, placed, vertices_of
from rosbot_patrol.simulation.scene.scene import Body, Intrinsics, Matrix, SceneRenderer
from rosbot_patrol.simulation.scene.textures import SIDE, Texture, standard_textures
from rosbot_patrol.simulation.sensors import picture_kernels as kernels

log = logging.getLogger(__name__)

_SHADOWS_SEEN = 15.0  # farther shadows are too small to be seen [m]


_Programs = dict[tuple[bool, bool], Any]
"""Program by whether it draws textures, and whether vertices have partners."""


@dataclass
class _Drawn:
    """OpenGL's buffers of some triangles: vertices, indices, and a vertex array per program that has drawn them."""

    corners: Any = None
    order: Any = None
    textured: bool = False
    jointed: bool = False
    arrays: dict[Any, Any] = field(default_factory=dict)

    def release(self) -> None:
        for thing in (*self.arrays.values(), self.corners, self.order):
            if thing is not None:
                thing.release()


@dataclass
class _Item:
    body: Body
    pose: Matrix
    visuals: Matrix
    label: int
    moving: bool
    arrays: list[Triangles]
    drawn: list[_Drawn]
    shadow: Matrix | None


class EglRenderer(SceneRenderer):
    """OpenGL renderer of bodies; one per process and thread, used by the thread that made it.

    Args:
        light: lights of the scene; may be changed between pictures (`light` is an attribute).
        textures: textures by name, as materials use them; by default those of `textures.py`.

    Raises:
        WorldError: there is no EGL, or no driver with OpenGL 3.3.
    """

    def __init__(self, light: Light | None = None, textures: dict[str, Texture] | None = None) -> None:
        self.light = light or Light()
        self._context = _open_context()
        self._items: dict[str, _Item] = {}
        self._still: _Drawn | None = None
        self._target: tuple[tuple[int, int], Any, Any, Any] | None = None
        context = self._context
        self._programs = {
            (lamp, textured, jointed): context.program(*sources(lamp=lamp, textured=textured, jointed=jointed))
            for lamp, textured, jointed in itertools.product((False, True), repeat=3)
        }
        self._shadows = Shadows(context)
        self._layers: dict[str, tuple[int, float]] = {}
        self._texture = self._upload(textures if textures is not None else standard_textures())
        self._parts = np.tile(np.eye(4, dtype="<f4"), (MAX_PARTS, 1, 1))

    @property
    def driver(self) -> str:
        """Name of the OpenGL driver."""
        return str(self._context.info["GL_RENDERER"])

    def add(self, body: Body, *, label: int = 0) -> None:
        """Add a body to the scene; its name must be new.

        Args:
            body: the body to draw.
            label: 1 to 255, the value of `labels()` where the body is visible; 0 for none.

        Raises:
            WorldError: the name is taken, or a shape cannot be drawn.
        """
        if body.name in self._items:
            raise WorldError(body.name, "is in the scene already")
        poses = np.array([v.pose for v in body.visuals], float).reshape(-1, 4, 4)
        arrays = [self._vertices(body, i, label) for i in range(len(body.visuals))]
        self._items[body.name] = _Item(body, body.pose, poses, label, not body.static, arrays, [], shadow_of(body))
        if body.static:
            self._forget_still()

    def remove(self, name: str) -> None:
        """Remove a body from the scene."""
        item = self._item(name)
        self._release(item)
        if not item.moving:
            self._forget_still()
        del self._items[name]

    def clear(self) -> None:
        """Remove everything from the scene."""
        for name in list(self._items):
            self.remove(name)

    def move(self, name: str, world_from_body: Matrix) -> None:
        """Move a body."""
        self._moving(name).pose = world_from_body

    def pose_visuals(self, name: str, body_from_visuals: Matrix) -> None:
        """Set the poses of a body's visuals relative to it, shape (number of visuals, 4, 4)."""
        item = self._moving(name)
        if body_from_visuals.shape != item.visuals.shape:
            raise WorldError(name, f"has visuals {item.visuals.shape}, was given poses {body_from_visuals.shape}")
        item.visuals = body_from_visuals

    def render(
        self, world_from_optical: Matrix, intrinsics: Intrinsics
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Draw a picture: colour (height, width, 3) and depth [m] (height, width), inf where nothing was hit."""
        size = (intrinsics.width, intrinsics.height)
        buffer = self._draw(world_from_optical, intrinsics, size)
        colour = np.empty((size[1], size[0], 3), np.uint8)
        raw = np.empty((size[1], size[0]), np.float32)
        buffer.read_into(colour, components=3, alignment=1)
        buffer.read_into(raw, attachment=-1, components=1, dtype="f4")
        return colour, _metres(raw, intrinsics)

    def labels(self) -> NDArray[np.uint8]:
        """Labels of the last picture's pixels, shape (height, width)."""
        assert self._target is not None, "labels() comes after render()"
        return self._read(self._target[1], self._target[0])[:, :, 3]

    def render_labelled(self, world_from_optical: Matrix, intrinsics: Intrinsics) -> NDArray[np.uint8]:
        """Draw a picture in colour with its `labels()` as the fourth channel, shape (height, width, 4).

        One read without the depth is faster than `render` and then `labels`.
        """
        size = (intrinsics.width, intrinsics.height)
        return self._read(self._draw(world_from_optical, intrinsics, size), size)

    @staticmethod
    def _read(buffer: Any, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Read colour and label of each pixel, shape (height, width, 4)."""
        return np.frombuffer(buffer.read(components=4), np.uint8).reshape(size[1], size[0], 4)

    def close(self) -> None:
        """Release the context and all its memory."""
        self._items.clear()
        self._context.gc_mode = "context_gc"
        self._context.gc()
        self._context.release()

    def _draw(self, world_from_optical: Matrix, intrinsics: Intrinsics, size: tuple[int, int]) -> Any:
        buffer = self._buffer(size)
        buffer.use()
        context, lamp = self._context, any(self.light.lamp)
        context.enable_only(context.DEPTH_TEST)
        buffer.clear(*self.light.sky, 0.0, depth=1.0)
        self._texture.use(0)
        shading = {(t, j): program for (with_lamp, t, j), program in self._programs.items() if with_lamp == lamp}
        for program in shading.values():
            _set(program, "view", np.linalg.inv(world_from_optical).T)
            _set(program, "projection", _projection(intrinsics).T)
            _set(program, "eye", world_from_optical[:3, 3])
            self._set_light(program, world_from_optical[:3, 3], lamp)
        # Moving bodies are usually in front of static ones: drawn first, they save the fragments behind them. A pass
        # for depth alone, to shade only visible fragments, cost more than it saved.
        for item in self._items.values():
            if item.moving:
                self._draw_item(item, shading)
        self._draw_still(shading)
        self._draw_shadows(world_from_optical, intrinsics)
        return buffer

    def _draw_shadows(self, world_from_optical: Matrix, intrinsics: Intrinsics) -> None:
        eye_from_world = np.linalg.inv(world_from_optical)
        places = [item.pose @ item.shadow for item in self._items.values() if item.shadow is not None]
        seen = [place for place in places if -1.0 < eye_from_world[2] @ place[:, 3] < _SHADOWS_SEEN]
        if seen:
            _set(self._shadows.program, "view", eye_from_world.T)
            _set(self._shadows.program, "projection", _projection(intrinsics).T)
            self._shadows.draw(seen)

    def _draw_still(self, programs: _Programs) -> None:
        if self._still is None:
            every = [
                arrays
                for item in self._items.values()
                if not item.moving
                for arrays in placed(item.arrays, item.pose @ item.visuals)
            ]
            self._still = self._buffers(every) if every else _Drawn()
        self._parts[0] = np.eye(4)
        self._draw_array(self._still, programs)

    def _draw_item(self, item: _Item, programs: _Programs) -> None:
        if not item.drawn:
            item.drawn = [self._buffers(item.arrays[i : i + MAX_PARTS]) for i in range(0, len(item.arrays), MAX_PARTS)]
        world = item.pose @ item.visuals
        for i, drawn in enumerate(item.drawn):
            some = world[i * MAX_PARTS : (i + 1) * MAX_PARTS]
            self._parts[: len(some)] = some.transpose(0, 2, 1)
            self._draw_array(drawn, programs)

    def _draw_array(self, drawn: _Drawn, programs: _Programs) -> None:
        if drawn.corners is None:
            return
        program = programs[drawn.textured, drawn.jointed]
        if program not in drawn.arrays:
            drawn.arrays[program] = self._array(program, drawn)
        program["parts"].write(self._parts)
        if drawn.jointed:  # closed surfaces: faces turned away are hidden
            self._context.cull_face = "front"  # the projection is upside down
            self._context.enable(self._context.CULL_FACE)
        drawn.arrays[program].render()
        self._context.disable(self._context.CULL_FACE)

    def _set_light(self, program: Any, eye: Matrix, lamp: bool) -> None:
        light = self.light
        towards = np.array(light.sun_direction, float)
        _set(program, "sun_direction", towards / max(float(np.linalg.norm(towards)), 1e-9))
        for name in ("sun", "above", "below", *(("lamp",) if lamp else ())):
            _set(program, name, np.array(getattr(light, name)))
        if lamp:
            _set(program, "lamp_place", eye if light.is_lamp_carried else np.array(light.lamp_place))
            _set(program, "lamp_reach", np.array(1.0 / light.lamp_reach**2))

    def _vertices(self, body: Body, index: int, label: int) -> Triangles:
        visual = body.visuals[index]
        return vertices_of(visual, index % MAX_PARTS, self._layer(visual.material.texture), label)

    def _buffers(self, parts: list[Triangles]) -> _Drawn:
        starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
        vertices = np.concatenate([vertices for vertices, _ in parts])
        faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)])
        return _Drawn(
            corners=self._context.buffer(vertices.tobytes()),
            order=self._context.buffer(np.ascontiguousarray(faces, "<i4").tobytes()),
            textured=bool(vertices["part_layer_label"][:, 1].any()),
            jointed=bool(vertices["partner"].any()),
        )

    def _array(self, program: Any, drawn: _Drawn) -> Any:
        """Vertex array for one program: unused attributes are skipped."""
        names = [name for name in VERTEX.names or () if name in program]
        layout = " ".join(
            f"{VERTEX[name].shape[0]}f" if name in names else f"{VERTEX[name].itemsize}x" for name in VERTEX.names or ()
        )
        return self._context.vertex_array(program, [(drawn.corners, layout, *names)], drawn.order)

    def _layer(self, name: str) -> tuple[int, float]:
        if name not in self._layers:
            log.warning("there is no texture '%s', drawn plain (known: %s)", name, ", ".join(self._layers))
            self._layers[name] = (0, 1.0)
        return self._layers[name]

    def _upload(self, textures: dict[str, Texture]) -> Any:
        white = Texture(np.full((SIDE, SIDE, 3), 255, np.uint8))
        every = {"": white, **textures}
        self._layers = {name: (i, texture.metres) for i, (name, texture) in enumerate(every.items())}
        pixels = np.stack([texture.pixels for texture in every.values()])
        made = self._context.texture_array((SIDE, SIDE, len(every)), 3, pixels.tobytes(), alignment=1)
        made.build_mipmaps()
        made.filter = (self._context.LINEAR_MIPMAP_NEAREST, self._context.LINEAR)
        return made

    def _buffer(self, size: tuple[int, int]) -> Any:
        if self._target is None or self._target[0] != size:
            if self._target is not None:
                for thing in self._target[1:]:
                    thing.release()
            colour, depth = self._context.texture(size, 4), self._context.depth_texture(size)
            self._target = (size, self._context.framebuffer([colour], depth), colour, depth)
        return self._target[1]

    def _item(self, name: str) -> _Item:
        if name not in self._items:
            raise WorldError(name, "is not in the scene")
        return self._items[name]

    def _moving(self, name: str) -> _Item:
        item = self._item(name)
        if not item.moving:
            item.moving = True
            self._forget_still()
        return item

    def _forget_still(self) -> None:
        if self._still is not None:
            self._still.release()
        self._still = None

    def _release(self, item: _Item) -> None:
        for drawn in item.drawn:
            drawn.release()
        item.drawn = []


def make_renderer(prefer: str = "egl", light: str = "day") -> SceneRenderer:
    """Make the machine's fastest renderer: OpenGL on EGL, else PyBullet's own, with a warning that says why.

    Args:
        prefer: egl or tiny.
        light: one of LIGHTS; PyBullet's renderer has its own.
    """
    if prefer == "egl":
        try:
            renderer = EglRenderer(LIGHTS[light])
        except WorldError as err:
            log.warning("the camera is drawn by PyBullet's TinyRenderer, some 20 times slower: %s", err)
        else:
            log.info("the camera is drawn by OpenGL on EGL: %s", renderer.driver)
            return renderer
    from rosbot_patrol.simulation.render.tiny import TinyRenderer

    return TinyRenderer()


def _open_context() -> Any:
    try:
        import moderngl

        settings: dict[str, Any] = {"standalone": True, "backend": "egl", "require": 330}
        return moderngl.create_context(**settings)
    except Exception as err:  # moderngl raises plain Exception, its loader OSError and ImportError
        raise WorldError("EGL", f"OpenGL 3.3 without a display cannot be had: {err}") from err


def _projection(camera: Intrinsics) -> NDArray[np.float64]:
    """Clip space from the optical frame; the picture's first row is first in memory (in OpenGL it is last)."""
    near, far, width, height = camera.near, camera.far, camera.width, camera.height
    return np.array(
        [
            [2 * camera.fx / width, 0, (2 * camera.cx + 1) / width - 1, 0],
            [0, 2 * camera.fy / height, (2 * camera.cy + 1) / height - 1, 0],
            [0, 0, (far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, 1, 0],
        ]
    )


def _metres(raw: NDArray[np.float32], camera: Intrinsics) -> NDArray[np.float32]:
    metres = np.empty(raw.size, np.float32)
    kernels.depth_from_clip(raw.ravel(), camera.near, camera.far, metres)
    return metres.reshape(raw.shape)


def _set(program: Any, name: str, value: NDArray[np.float64]) -> None:
    program[name].write(np.ascontiguousarray(value, "<f4").tobytes())
