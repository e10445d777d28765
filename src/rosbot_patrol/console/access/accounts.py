"""People who may use the console: names, roles, passwords and the alarm code, in one file of mode 600.

Passwords and the code are kept as scrypt hashes (RFC 7914). Until there is an owner with a password, the console
listens on this machine only, and whoever uses it there counts as the owner.
"""

from __future__ import annotations

import dataclasses
import hashlib
import hmac
import logging
import secrets
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from rosbot_patrol.errors import AccessError, StateError
from rosbot_patrol.files import read_json, write_json

log = logging.getLogger(__name__)

SHORTEST = 8  # characters of a password
LONGEST = 200
_CODE = range(4, 9)  # digits of the alarm code
_COST = 1 << 14  # of scrypt: 16 MB and some 50 ms for each try
_BLOCK, _PARALLEL = 8, 1
_SALT = 16
LANGUAGES = ("", "en", "de")  # "": as the browser asks
THEMES = ("auto", "light", "dark")


class Role(Enum):
    """What somebody may do."""

    OWNER = "owner"
    MEMBER = "member"
    GUEST = "guest"

    @property
    def may_order(self) -> bool:
        """Whether they may give orders and change what is on record."""
        return self is not Role.GUEST

    @property
    def may_watch(self) -> bool:
        """Whether they may see the live camera and map."""
        return self is not Role.GUEST

    @property
    def may_manage(self) -> bool:
        """Whether they may manage people."""
        return self is Role.OWNER


@dataclass(frozen=True, kw_only=True)
class Account:
    """One person.

    Attributes:
        name: to sign in with.
        role: what they may do.
        password: its hash.
        version: raised with each change of password or role; sessions of older versions end.
        language, theme: of the pages; see LANGUAGES and THEMES.
    """

    name: str
    role: Role
    password: str = ""
    version: int = 1
    language: str = ""
    theme: str = "auto"


LOCAL = Account(name="this machine", role=Role.OWNER)  # until somebody has a password


class Accounts:
    """The people of one file; thread-safe.

    Args:
        path: of the file; missing: nobody yet.

    Raises:
        AccessError: the file cannot be used. Nobody is let in then, because a damaged file must not open the console.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.RLock()
        self._accounts, self._code, self._local = _read(path)
        self._state = _state(path)

    def follow(self) -> None:
        """Take what another program has written into the file. A file that cannot be used changes nothing."""
        state = _state(self._path)
        if state == self._state:
            return
        with self._lock:
            self._state = state
            try:
                self._accounts, self._code, self._local = _read(self._path)
            except (AccessError, StateError) as err:
                log.error("%s; the people who were known before stay", err)

    @property
    def people(self) -> tuple[Account, ...]:
        """All, in the order in which they came."""
        return tuple(self._accounts.values())

    @property
    def is_open(self) -> bool:
        """Whether there is no owner yet."""
        return not any(each.role is Role.OWNER for each in self._accounts.values())

    @property
    def has_code(self) -> bool:
        """Whether an alarm code is set."""
        return bool(self._code)

    @property
    def local(self) -> Account:
        """Whoever uses the console before there is an owner."""
        return self._local

    def find(self, name: str) -> Account | None:
        """The account of a name, None if there is none."""
        return self._accounts.get(name)

    def check_password(self, name: str, password: str) -> Account | None:
        """The account that a name and a password belong to, None if they do not fit; takes as long either way."""
        found = self._accounts.get(name)
        is_right = _fits(password, found.password if found else _DUMMY)
        return found if found is not None and is_right else None

    def check_code(self, code: str) -> bool:
        """Whether this is the alarm code."""
        return bool(self._code) and _fits(code, self._code)

    def add(self, name: str, role: Role, password: str) -> Account:
        """Add somebody.

        Raises:
            AccessError: the name or the password cannot be used, or the name is taken.
            OSError: the disk does not take it; nothing has changed.
        """
        name = name.strip()
        if not 1 <= len(name) <= 40 or not name.isprintable():
            raise AccessError("the name", "needs 1 to 40 characters in one line")
        with self._lock:
            if name.casefold() in (each.casefold() for each in (*self._accounts, LOCAL.name)):
                raise AccessError("the name", f"'{name}' is taken")
            if role is not Role.OWNER and self.is_open:
                raise AccessError("the first one", "has to be an owner, who can then add others")
            account = Account(name=name, role=role, password=_hash(_usable(password)))
            self._put(account)
        return account

    def change_password(self, name: str, password: str) -> Account:
        """Give somebody a new password; all their sessions end. Raises AccessError, OSError."""
        hashed = _hash(_usable(password))
        with self._lock:
            account = self._known(name)
            account = dataclasses.replace(account, password=hashed, version=account.version + 1)
            self._put(account)
        return account

    def change_role(self, name: str, role: Role) -> None:
        """Give somebody another role; all their sessions end. Raises AccessError, OSError."""
        with self._lock:
            account = self._known(name)
            self._keep_an_owner(account, role)
            self._put(dataclasses.replace(account, role=role, version=account.version + 1))

    def remove(self, name: str) -> None:
        """Remove somebody. Raises AccessError, OSError."""
        with self._lock:
            account = self._known(name)
            self._keep_an_owner(account, None)
            self._save({key: each for key, each in self._accounts.items() if key != name}, self._code, self._local)

    def set_code(self, code: str) -> None:
        """Set the alarm code, "" for none. Raises AccessError, OSError."""
        if code and not (code.isascii() and code.isdigit() and len(code) in _CODE):
            raise AccessError("the code", f"needs {_CODE.start} to {_CODE.stop - 1} digits")
        hashed = _hash(code) if code else ""
        with self._lock:
            self._save(self._accounts, hashed, self._local)

    def prefer(self, account: Account, *, language: str | None = None, theme: str | None = None) -> Account:
        """Keep somebody's language and theme. Raises OSError."""
        with self._lock:
            now = self._accounts.get(account.name, self._local)
            now = dataclasses.replace(now, language=now.language if language is None else language)
            now = dataclasses.replace(now, theme=now.theme if theme is None else theme)
            if now.name in self._accounts:
                self._put(now)
            else:
                self._save(self._accounts, self._code, now)
        return now

    def _known(self, name: str) -> Account:
        found = self._accounts.get(name)
        if found is None:
            raise AccessError("the name", f"'{name}' is unknown here")
        return found

    def _keep_an_owner(self, account: Account, role: Role | None) -> None:
        owners = [each for each in self._accounts.values() if each.role is Role.OWNER]
        if owners == [account] and role is not Role.OWNER:
            raise AccessError(
                f"'{account.name}'", "is the only owner, and somebody has to be: make another one owner first"
            )

    def _put(self, account: Account) -> None:
        self._save({**self._accounts, account.name: account}, self._code, self._local)

    def _save(self, accounts: Mapping[str, Account], code: str, local: Account) -> None:
        tree = {
            "people": [{**dataclasses.asdict(each), "role": each.role.value} for each in accounts.values()],
            "code": code,
            "local": {"language": local.language, "theme": local.theme},
        }
        write_json(self._path, tree)
        self._path.chmod(0o600)
        self._accounts, self._code, self._local = dict(accounts), code, local
        self._state = _state(self._path)


def _state(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def _read(path: Path) -> tuple[dict[str, Account], str, Account]:
    tree = read_json(path) or {}
    try:
        people = [Account(**{**each, "role": Role(each["role"])}) for each in tree.get("people", [])]
        local = dataclasses.replace(LOCAL, **tree.get("local", {}))
        return {each.name: each for each in people}, str(tree.get("code", "")), local
    except (KeyError, TypeError, ValueError, AttributeError) as err:
        problem = f"makes no sense ({err!r}): mend it, or remove it and set the passwords anew"
        raise AccessError(str(path), problem) from err


def _usable(password: str) -> str:
    if not SHORTEST <= len(password) <= LONGEST:
        raise AccessError("the password", f"needs {SHORTEST} to {LONGEST} characters")
    return password


def _hash(password: str, salt: bytes | None = None) -> str:
    salt = salt or secrets.token_bytes(_SALT)
    return f"scrypt${_COST}${_BLOCK}${_PARALLEL}${salt.hex()}${_derived(password, salt, _COST).hex()}"


def _derived(password: str, salt: bytes, cost: int) -> bytes:
    return hashlib.scrypt(password.encode("utf-8", "replace"), salt=salt, n=cost, r=_BLOCK, p=_PARALLEL)


def _fits(password: str, hashed: str) -> bool:
    try:
        _, cost, _, _, salt, key = hashed.split("$")
        known = bytes.fromhex(key)
        return hmac.compare_digest(_derived(password[:LONGEST], bytes.fromhex(salt), int(cost)), known)
    except ValueError:
        return False


_DUMMY = _hash(secrets.token_hex(8))  # so that an unknown name takes as long as a wrong password
