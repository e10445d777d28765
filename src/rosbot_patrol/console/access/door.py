"""Signing in: passwords with a limit on tries, and sessions in signed cookies."""

from __future__ import annotations

import threading
from collections.abc import Callable

from itsdangerous import BadData, URLSafeTimedSerializer

from rosbot_patrol.console.access.accounts import Account, Accounts
from rosbot_patrol.console.access.tries import Tries
from rosbot_patrol.errors import AccessError

COOKIE = "rosbot_patrol_session"
MAX_AGE = 30 * 86400  # [s] of a session
_SALT = "rosbot_patrol session"


class TooManyTries(AccessError):
    """Somebody has to wait before the next try.

    Attributes:
        seconds: how long.
    """

    def __init__(self, seconds: float) -> None:
        super().__init__("the last tries", f"were wrong: wait {seconds:.0f} s before the next one")
        self.seconds = seconds


class Door:
    """Lets people in.

    Args:
        accounts: of the people.
        secret: signs the cookies.
        clock: steady time [s].
    """

    def __init__(self, accounts: Accounts, secret: bytes, clock: Callable[[], float]) -> None:
        self.accounts, self._clock = accounts, clock
        self._signer = URLSafeTimedSerializer(secret, salt=_SALT)
        # An address is slowed down soon. A name only later, so that nobody keeps its owner out from elsewhere.
        self._by_peer = Tries(free=5)
        self._by_name = Tries(free=50, most=30.0)
        self._one = threading.Lock()  # a hash takes 16 MB: one at a time

    def sign_in(self, name: str, password: str, peer: str) -> Account:
        """The account of a name and its password.

        Raises:
            TooManyTries: the address or the name has failed too often.
            AccessError: they do not fit.
        """
        keys = ((self._by_peer, f"peer {peer}"), (self._by_name, f"name {name[:100]}"))
        with self._one:
            self._check(keys)
            found = self.accounts.check_password(name, password)
            self._count(keys, is_right=found is not None)
        if found is None:
            raise AccessError("name and password", "do not fit")
        return found

    def check_code(self, code: str, account: Account) -> None:
        """Check the alarm code, if there is one.

        Raises:
            TooManyTries, AccessError: as for a password.
        """
        if not self.accounts.has_code:
            return
        keys = ((self._by_peer, f"code of {account.name}"),)
        with self._one:
            self._check(keys)
            is_right = self.accounts.check_code(code)
            self._count(keys, is_right=is_right)
        if not is_right:
            raise AccessError("the code", "is wrong")

    def cookie_of(self, account: Account) -> str:
        """Value of a session's cookie."""
        return self._signer.dumps([account.name, account.version])

    def account_of(self, cookie: str | None) -> Account | None:
        """The account of a session, None where it is over or forged."""
        try:
            name, version = self._signer.loads(cookie or "", max_age=MAX_AGE)
        except (BadData, ValueError, TypeError):
            return None
        found = self.accounts.find(str(name))
        return found if found is not None and found.version == version else None

    def present(self, account: Account) -> Account | None:
        """The account as it is now; None if it is gone, or its sessions have ended."""
        if account.name == self.accounts.local.name:
            return self.accounts.local if self.accounts.is_open else None
        found = self.accounts.find(account.name)
        return found if found is not None and found.version == account.version else None

    def _check(self, keys: tuple[tuple[Tries, str], ...]) -> None:
        wait = max(tries.wait(key, self._clock()) for tries, key in keys)
        if wait > 0.0:
            raise TooManyTries(max(wait, 1.0))

    def _count(self, keys: tuple[tuple[Tries, str], ...], *, is_right: bool) -> None:
        for tries, key in keys:
            if is_right:
                tries.succeed(key)
            else:
                tries.fail(key, self._clock())
