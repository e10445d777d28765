"""Passwords with a limit on tries, and sessions in signed cookies."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.console.access.door import Door, TooManyTries
from rosbot_patrol.console.access.tries import Tries
from rosbot_patrol.errors import AccessError

PASSWORD = "correct horse"


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def door(tmp_path: Path, clock: Clock) -> Door:
    accounts = Accounts(tmp_path / "accounts.json")
    accounts.add("Ada", Role.OWNER, PASSWORD)
    return Door(accounts, b"s" * 32, clock)


def test_each_further_failure_doubles_the_wait() -> None:
    tries = Tries(free=3, first=1.0, most=10.0)
    waits = []
    for _ in range(9):
        tries.fail("key", 0.0)
        waits.append(tries.wait("key", 0.0))
    assert waits == [0.0, 0.0, 0.0, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0]
    assert tries.wait("key", 9.5) == 0.5
    assert tries.wait("other", 0.0) == 0.0
    tries.succeed("key")
    assert tries.wait("key", 0.0) == 0.0


def test_failures_are_forgotten_and_keys_are_bounded() -> None:
    tries = Tries(free=0)
    tries.fail("key", 0.0)
    tries.fail("key", 4000.0)
    assert tries.wait("key", 4000.0) == 1.0
    for k in range(11_000):
        tries.fail(f"peer {k}", 5000.0)
    assert tries.wait("key", 5000.0) == 0.0


def test_an_address_is_slowed_down_and_others_are_not(door: Door, clock: Clock) -> None:
    for _ in range(6):
        with pytest.raises(AccessError, match="name and password do not fit"):
            door.sign_in("Ada", "wrong horse", "10.0.0.9")
    with pytest.raises(TooManyTries) as found:
        door.sign_in("Ada", PASSWORD, "10.0.0.9")  # the right one, too: else waiting would tell nothing
    assert found.value.seconds == 1.0
    assert door.sign_in("Ada", PASSWORD, "10.0.0.5").name == "Ada"
    clock.now += 1.5
    assert door.sign_in("Ada", PASSWORD, "10.0.0.9").name == "Ada"


def test_ten_thousand_wrong_passwords_from_as_many_addresses_cost_a_hundred_hashes(door: Door, clock: Clock) -> None:
    hashes = 0
    for k in range(10_000):
        clock.now += 0.01
        try:
            door.sign_in("Ada", "x", f"10.0.{k // 256}.{k % 256}")
        except TooManyTries:
            continue
        except AccessError:
            hashes += 1
    assert hashes < 120
    clock.now += 31.0
    assert door.sign_in("Ada", PASSWORD, "192.168.1.2").name == "Ada"


def test_the_code_is_limited_by_person(door: Door) -> None:
    ada = door.accounts.find("Ada")
    assert ada is not None
    door.check_code("anything", ada)  # none is set
    door.accounts.set_code("2468")
    for _ in range(6):
        with pytest.raises(AccessError, match="the code is wrong"):
            door.check_code("1111", ada)
    with pytest.raises(TooManyTries):
        door.check_code("2468", ada)


def test_a_session_ends_with_its_password_and_is_not_forged(door: Door) -> None:
    ada = door.accounts.find("Ada")
    assert ada is not None
    cookie = door.cookie_of(ada)
    assert door.account_of(cookie) == ada
    assert door.present(ada) == ada
    for forged in ("", None, "x", cookie[:-1], cookie[:-2] + "AA", "." + cookie):
        assert door.account_of(forged) is None
    assert Door(door.accounts, b"t" * 32, lambda: 0.0).account_of(cookie) is None
    door.accounts.change_password("Ada", "battery staple")
    assert door.account_of(cookie) is None
    assert door.present(ada) is None


def test_whoever_came_before_the_first_owner_is_nobody_afterwards(tmp_path: Path) -> None:
    door = Door(Accounts(tmp_path / "accounts.json"), b"s" * 32, lambda: 0.0)
    local = door.accounts.local
    assert door.present(local) == local
    door.accounts.add("Ada", Role.OWNER, PASSWORD)
    assert door.present(local) is None
