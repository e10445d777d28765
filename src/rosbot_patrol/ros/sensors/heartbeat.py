"""A heartbeat to a service outside of the house, which raises the alarm when none comes: nobody here may be left to."""

from __future__ import annotations

import logging
import time
import urllib.error
import urllib.request
from dataclasses import dataclass
from urllib.parse import urlsplit

import rospy

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

PART = "heartbeat"
TIMEOUT = 10.0  # [s]


@dataclass(frozen=True, kw_only=True)
class HeartbeatParams:
    """Where the heartbeat goes."""

    heartbeat_url: str = param(
        "", doc="address that is called while all is well (healthchecks.io, Uptime Kuma, a webhook); empty: none"
    )
    heartbeat_period: float = param(60.0, unit="s", lo=1.0, doc="time between two calls")


class Heartbeat:
    """Calls an address while all is well; its path, which often is a secret, appears in no log.

    Args:
        params: address and period.
        health: receives whether the calls arrive.

    Raises:
        ParamError: the address is none.
    """

    def __init__(self, params: HeartbeatParams, health: Health) -> None:
        self._params, self._health = params, health
        self._well_at = float("-inf")
        self._problem: str | None = None
        if not params.heartbeat_url:
            return
        parts = urlsplit(params.heartbeat_url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise ParamError(
                f"{rospy.get_name()}/heartbeat_url", "expected an address that begins with https:// or http://"
            )
        self._host = parts.hostname
        # a webhook of Home Assistant takes no GET, Uptime Kuma nothing else
        method = "POST" if parts.path.startswith("/api/webhook/") else "GET"
        self._request = urllib.request.Request(params.heartbeat_url, method=method)

    def start(self) -> None:
        """Start to call, if there is an address."""
        if self._params.heartbeat_url:
            Worker(self._run, name="heartbeat").start()

    def all_is_well(self, now: float) -> None:
        """All is well at a time of the monotonic clock [s]; what was said longer than 5 s ago does not count."""
        self._well_at = now

    def _run(self) -> None:
        due = time.monotonic()
        while not rospy.is_shutdown():
            now = time.monotonic()
            if now >= due and now - self._well_at < 5.0:
                due = now + self._params.heartbeat_period
                self._call()
            time.sleep(0.25)

    def _call(self) -> None:
        problem = ""
        try:
            with urllib.request.urlopen(self._request, timeout=TIMEOUT) as answer:
                answer.read(1000)
        except urllib.error.HTTPError as err:
            problem = f"{self._host} answers {err.code} {err.reason}"
        except (OSError, ValueError) as err:
            problem = f"{self._host} is not reached: {getattr(err, 'reason', err)}"
        if problem != self._problem:
            if problem:
                log.warning("the heartbeat does not arrive: %s", problem)
            else:
                log.info("the heartbeat arrives at %s", self._host)
            self._problem = problem
        self._health.set(PART, WARN if problem else OK, problem or f"it arrives at {self._host}")
