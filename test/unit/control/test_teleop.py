import pytest

from rosbot_patrol.control.teleop import CTRL_C, KeyTeleop, TeleopParams, Velocity


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("i", Velocity(x=0.5)),
        ("o", Velocity(x=0.5, turn=-1.0)),
        ("j", Velocity(turn=1.0)),
        ("k", Velocity()),
        ("l", Velocity(turn=-1.0)),
        ("u", Velocity(x=0.5, turn=1.0)),
        ("m", Velocity(x=-0.5, turn=-1.0)),
        (",", Velocity(x=-0.5)),
        (".", Velocity(x=-0.5, turn=1.0)),
        ("J", Velocity(y=0.5)),
        ("O", Velocity(x=0.5, y=-0.5)),
        ("M", Velocity(x=-0.5, y=0.5)),
        ("t", Velocity(z=0.5)),
        ("b", Velocity(z=-0.5)),
        ("?", Velocity()),
        (CTRL_C, Velocity()),
    ],
)
def test_keys(key, expected):
    assert KeyTeleop(TeleopParams()).press(key) == expected


def test_speed_keys_keep_the_direction_and_tell():
    teleop = KeyTeleop(TeleopParams())
    teleop.press("i")
    assert teleop.press("q") == pytest.approx(Velocity(x=0.55))
    assert teleop.turn == pytest.approx(1.1)
    assert teleop.note == "currently:\tspeed 0.55\tturn 1.1"
    assert teleop.press("x") == pytest.approx(Velocity(x=0.495))
    teleop.press("c")
    assert teleop.turn == pytest.approx(0.99)


def test_limits():
    teleop = KeyTeleop(TeleopParams(speed=2.0, speed_limit=1.0, turn_limit=1.05))
    assert teleop.press("i") == Velocity(x=1.0)
    teleop.press("q")
    assert (teleop.speed, teleop.turn) == (1.0, 1.05)
    assert "speed limit" in teleop.note
    assert "turning limit" in teleop.note


def test_time_out_stops_once():
    teleop = KeyTeleop(TeleopParams(key_timeout=0.5))
    assert teleop.press("") is None
    teleop.press("i")
    assert teleop.press("") == Velocity()
    assert teleop.press("") is None
