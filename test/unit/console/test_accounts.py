"""Who may use the console: names, roles, passwords, and a file that another program changes."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest

from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.errors import AccessError

PASSWORD = "correct horse"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "console" / "accounts.json"


@pytest.fixture
def accounts(path: Path) -> Accounts:
    return Accounts(path)


def test_before_the_first_owner_it_is_open(accounts: Accounts) -> None:
    assert accounts.is_open
    assert accounts.local.role is Role.OWNER
    accounts.add("Ada", Role.OWNER, PASSWORD)
    assert not accounts.is_open


def test_a_password_is_kept_as_a_hash_for_the_robots_user_only(accounts: Accounts, path: Path) -> None:
    accounts.add("Ada", Role.OWNER, PASSWORD)
    accounts.set_code("2468")
    text = path.read_text("utf-8")
    assert PASSWORD not in text
    assert "2468" not in text
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    again = Accounts(path)
    assert again.check_password("Ada", PASSWORD) == accounts.find("Ada")
    assert again.check_password("Ada", PASSWORD + " ") is None
    assert again.check_password("Eve", PASSWORD) is None
    assert again.check_code("2468")
    assert not again.check_code("2469")


@pytest.mark.parametrize(
    ("name", "password", "said"),
    [
        ("", PASSWORD, "the name needs 1 to 40 characters"),
        ("a\nb", PASSWORD, "the name needs 1 to 40 characters in one line"),
        ("x" * 41, PASSWORD, "the name needs 1 to 40"),
        ("Ada", "short", "the password needs 8 to 200 characters"),
        ("Ada", "x" * 201, "the password needs 8 to 200 characters"),
        ("this MACHINE", PASSWORD, "is taken"),
    ],
)
def test_what_cannot_be_used_is_told(accounts: Accounts, name: str, password: str, said: str) -> None:
    with pytest.raises(AccessError, match=said):
        accounts.add(name, Role.OWNER, password)
    assert accounts.is_open


def test_the_first_is_an_owner_and_one_stays(accounts: Accounts) -> None:
    with pytest.raises(AccessError, match="the first one has to be an owner"):
        accounts.add("Guy", Role.GUEST, PASSWORD)
    accounts.add("Ada", Role.OWNER, PASSWORD)
    accounts.add("Guy", Role.GUEST, PASSWORD)
    with pytest.raises(AccessError, match="'ada' is taken"):
        accounts.add("ada", Role.GUEST, PASSWORD)
    for change in (lambda: accounts.remove("Ada"), lambda: accounts.change_role("Ada", Role.MEMBER)):
        with pytest.raises(AccessError, match="the only owner"):
            change()
    accounts.change_role("Guy", Role.OWNER)
    accounts.remove("Ada")
    assert [each.name for each in accounts.people] == ["Guy"]


@pytest.mark.parametrize("code", ["123", "123456789", "12a4", "１２３４", " 1234"])
def test_a_code_is_digits(accounts: Accounts, code: str) -> None:
    with pytest.raises(AccessError, match="the code needs 4 to 8 digits"):
        accounts.set_code(code)
    assert not accounts.has_code


def test_a_new_password_or_role_is_a_new_version(accounts: Accounts) -> None:
    first = accounts.add("Ada", Role.OWNER, PASSWORD)
    second = accounts.change_password("Ada", "battery staple")
    assert second.version == first.version + 1
    assert accounts.check_password("Ada", PASSWORD) is None


def test_language_and_theme_are_kept(accounts: Accounts, path: Path) -> None:
    accounts.prefer(accounts.local, language="de", theme="dark")
    assert Accounts(path).local.language == "de"
    ada = accounts.add("Ada", Role.OWNER, PASSWORD)
    accounts.prefer(ada, theme="light")
    again = Accounts(path)
    assert again.find("Ada").theme == "light"  # type: ignore[union-attr]
    assert again.local.theme == "dark"


@pytest.mark.parametrize("text", ['{"people": [{"name": "Ada"}]}', '{"people": 3}', '{"people": [{"role": "king"}]}'])
def test_a_damaged_file_lets_nobody_in(path: Path, text: str) -> None:
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(AccessError, match=r"accounts\.json makes no sense"):
        Accounts(path)


def test_what_another_program_adds_counts_at_once(accounts: Accounts, path: Path) -> None:
    Accounts(path).add("Ada", Role.OWNER, PASSWORD)
    assert accounts.is_open
    accounts.follow()
    assert not accounts.is_open
    path.write_text(json.dumps({"people": "nonsense"}))
    accounts.follow()
    assert accounts.find("Ada") is not None
