"""draw_world: draws a picture of a world file from above.

rosrun rosbot_patrol draw_world WORLD OUT.png [--width PIXELS] [--rooms FILE] [--sensors FILE]
"""

from __future__ import annotations

import argparse
import logging
import math
import sys
from pathlib import Path

from PIL import Image, ImageDraw

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.ros.models.packages import model_folders, package_finder
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.render.from_above import WorldPicture, draw_world
from rosbot_patrol.simulation.sdf.world import load_world
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

_FINER = 2  # supersampling factor, for smooth edges
_ROOM = (20, 60, 160)
_SENSOR = (190, 40, 30)


def main() -> None:
    """Read the arguments, draw, write the file; errors become one sentence."""
    parser = argparse.ArgumentParser(prog="draw_world", description=__doc__)
    parser.add_argument("world", help="SDF file")
    parser.add_argument("out", type=Path, help="picture: png or jpg")
    parser.add_argument("--width", type=int, default=1200, help="pixels")
    parser.add_argument("--rooms", default="", help="file of the room points, to be drawn in")
    parser.add_argument("--sensors", default="", help="file of the motion sensors, to be drawn in")
    options = parser.parse_args(_own_arguments(sys.argv[1:]))
    logging.basicConfig(level=logging.INFO, format="%(levelname)s: %(message)s")
    if not 16 <= options.width <= 8192:
        sys.exit(f"draw_world: --width {options.width}: expected 16 to 8192 pixels")
    try:
        renderer = make_renderer()
        picture = draw_world(
            load_world(options.world, model_folders(), package_finder()), renderer, width=_FINER * options.width
        )
        renderer.close()
        image = Image.fromarray(picture.pixels)
        _mark(image, picture, options.rooms, options.sensors)
        image = image.resize((image.width // _FINER, max(image.height // _FINER, 1)), Image.Resampling.BOX)
        image.quantize(256, dither=Image.Dither.NONE).convert("RGB" if options.out.suffix == ".jpg" else "P").save(
            options.out, optimize=True
        )
    except (PatrolError, OSError, ValueError) as err:
        sys.exit(f"draw_world: {err}")
    print(f"{options.out}: {image.width} x {image.height} pixels")


def _own_arguments(arguments: list[str]) -> list[str]:
    """The arguments without the remappings of roslaunch and rosrun."""
    return [argument for argument in arguments if ":=" not in argument]


def _mark(image: Image.Image, picture: WorldPicture, rooms: str, sensors: str) -> None:
    draw = ImageDraw.Draw(image)
    scale = picture.pixels.shape[1] / (picture.high[0] - picture.low[0])  # pixels per metre
    for room in load_rooms(Path(rooms)) if rooms else ():
        x, y = picture.pixel_of(room.pose[0], room.pose[1])
        radius = 0.2 * scale
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=_ROOM, width=6)
        ahead = (x + 1.75 * radius * math.cos(room.pose[2]), y - 1.75 * radius * math.sin(room.pose[2]))
        draw.line((x, y, *ahead), _ROOM, 6)
        _write(image, str(room.id), (x + 1.3 * radius, y + 0.3 * radius), 0.35 * scale)
    for sensor in read_sensors(sensors):
        x, y = picture.pixel_of(sensor.x, sensor.y)
        fan = [(x, y)]
        for turn in (-0.5, 0.0, 0.5):
            angle = sensor.yaw + turn
            fan.append((x + 0.5 * scale * math.cos(angle), y - 0.5 * scale * math.sin(angle)))
        draw.polygon(fan, outline=_SENSOR, width=4)


def _write(image: Image.Image, text: str, place: tuple[float, float], height: float) -> None:
    """Draw text in Pillow's own font, scaled to a height: Pillow has it in one size only."""
    letters = Image.new("L", (6 * len(text), 11))
    ImageDraw.Draw(letters).text((0, 0), text, fill=255)
    factor = height / letters.height
    mask = letters.resize((round(letters.width * factor), round(height)), Image.Resampling.BICUBIC)
    image.paste(_ROOM, (round(place[0]), round(place[1])), mask)
