"""The firmware's logic, built by g++ with the sanitizers and tested without a board, a bridge or ROS."""

import random
import re
import subprocess
from pathlib import Path

import pytest

from rosbot_patrol.rosserial.device.device_log import STUCK_AFTER, stuck_line
from rosbot_patrol.rosserial.protocol.packet import Parser, encode
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, ESP_TRIGGER_TYPES

REPOSITORY = Path(__file__).resolve().parents[3]
HOST = REPOSITORY / "firmware" / "host"
SKETCH = REPOSITORY / "firmware" / "esp_motion_sensor"
BUILD = REPOSITORY / ".ws" / "firmware"
UNIT_TESTS = sorted(
    name for path in HOST.glob("unit_*.cpp") for name in re.findall(r"^TEST\((\w+)\)", path.read_text(), re.MULTILINE)
)
LONGEST = 128  # payload that the firmware takes


def make(*targets):
    command = ["make", "-s", "-j2", "-C", str(HOST), f"BUILD={BUILD}", *targets]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def run(program, *arguments, **options):
    done = subprocess.run([str(BUILD / program), *arguments], capture_output=True, **options)
    assert done.returncode == 0, (done.stdout + done.stderr).decode()
    return done.stdout


@pytest.fixture(scope="module")
def built():
    make("all")


@pytest.mark.parametrize("name", UNIT_TESTS)
def test_logic(built, name):
    run("unit_tests", name)


def test_sketch_compiles_for_both_cores_without_a_warning():
    make("check")


def test_cppcheck_finds_nothing():
    make("lint")


def damaged_stream(rng):
    stream = bytearray()
    for _ in range(rng.randint(1, 8)):
        stream += encode(
            rng.choice([0, 8, 9, 10, 125, 65535]), rng.randbytes(rng.choice([0, 1, 8, 33, 88, 128, 129, 300]))
        )
    for _ in range(rng.randint(0, 6)):
        at = rng.randrange(len(stream))
        kind = rng.randrange(3)
        if kind == 0:
            stream[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del stream[at : at + rng.randint(1, 12)]
        else:
            stream[at:at] = rng.choice([b"\xff", b"\xff\xfe", b"\xff\xff\xfe", rng.randbytes(5)])
        if not stream:
            break
    return bytes(stream)


@pytest.mark.parametrize("seed", range(40))
def test_parser_finds_the_frames_that_the_bridges_finds(built, seed):
    rng = random.Random(seed)
    stream = b"".join(damaged_stream(rng) for _ in range(10))
    expected = [f"{packet.topic_id} {packet.data.hex()}" for packet in Parser(LONGEST).feed(stream)]
    found = run("list_frames", str(rng.randint(1, 200)), input=stream).decode().splitlines()
    assert [line.strip() for line in found] == [line.strip() for line in expected]


def test_damaged_conversations_do_not_break_the_client(built):
    assert run("fuzz_client", "60000", "1") == b"60000 inputs\n"


def test_nothing_is_allocated_or_thrown_on_the_board(built):
    objects = [BUILD / f"{path.stem}.o" for path in [*SKETCH.glob("*.cpp"), *SKETCH.glob("*.ino")]]
    assert len(objects) >= 10
    wanted = subprocess.run(["nm", "-uC", *map(str, objects)], capture_output=True, text=True, check=True).stdout
    assert "lwip_send" in wanted
    assert not re.findall(r" U (?:operator (?:new|delete)|malloc|calloc|realloc|strdup|__cxa_throw).*", wanted)


def test_topic_and_type_are_those_of_the_bridge():
    settings = (SKETCH / "settings.h").read_text()
    assert f'kEspTriggerMd5[] = "{ESP_TRIGGER_MD5}"' in settings
    for each in ESP_TRIGGER_TYPES:
        assert f'"{each}"' in settings


def test_stuck_output_is_told_in_the_words_that_the_bridge_knows():
    told = stuck_line(5, STUCK_AFTER)
    words = told.replace("sensor 5", "sensor %u").replace("for 600 s", "for %lu s")
    assert f'"{words}"' in (SKETCH / "motion_sensor.cpp").read_text()
    assert f"STUCK_MS {STUCK_AFTER * 1000:.0f}" in (SKETCH / "settings.h").read_text()


def test_secrets_are_not_committed_and_their_absence_is_one_sentence(tmp_path):
    ignored = subprocess.run(["git", "check-ignore", "-q", "firmware/esp_motion_sensor/secrets.h"], cwd=REPOSITORY)
    assert ignored.returncode == 0
    for path in SKETCH.iterdir():
        if path.name != "secrets.h":
            (tmp_path / path.name).write_bytes(path.read_bytes())
    command = ["g++", "-x", "c++", "-std=gnu++11", "-fsyntax-only", f"-I{HOST}/stubs", "-DHOST_IDF_MAJOR=5"]
    done = subprocess.run([*command, str(tmp_path / "esp_motion_sensor.ino")], capture_output=True, text=True)
    assert done.returncode != 0
    assert "secrets.h is missing: copy secrets.example.h to secrets.h and fill it in" in done.stderr


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ('#define SENSOR_KEY "abc"', "SENSOR_KEY has 64 hexadecimal digits, or none"),
        ("#undef SENSOR_ID\n#define SENSOR_ID 256", "SENSOR_ID is one byte"),
        ("#undef BRIDGE_HOST", "secrets.h does not define BRIDGE_HOST"),
    ],
)
def test_wrong_secrets_do_not_compile_and_say_why(tmp_path, line, sentence):
    (tmp_path / "wrong.h").write_text((SKETCH / "secrets.example.h").read_text() + line + "\n")
    command = ["g++", "-x", "c++", "-std=gnu++11", "-fsyntax-only", f"-I{HOST}/stubs", "-DHOST_IDF_MAJOR=5"]
    command.append(f'-DPATROL_SECRETS_FILE="{tmp_path}/wrong.h"')
    done = subprocess.run([*command, str(SKETCH / "esp_motion_sensor.ino")], capture_output=True, text=True)
    assert done.returncode != 0
    assert sentence in done.stderr
