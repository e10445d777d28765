"""Message that a hardware driver is not installed; the stub packages that replace it start this program."""

from __future__ import annotations

import sys

import rospy

from rosbot_patrol.ros.runtime.node import run_node


def main() -> None:
    """Log one sentence (arguments: package, its purpose, what will be missing) and end."""
    package, what, loss = ([*rospy.myargv(sys.argv)[1:], "?", "?", "?"])[:3]

    def say() -> None:
        rospy.logerr(
            "the package '%s' (%s) is not installed, so there will be no %s: put it into your workspace and run "
            "scripts/bootstrap again, or start with simulation:=true",
            package,
            what,
            loss,
        )
        rospy.sleep(0.5)

    run_node("missing_driver", say, anonymous=True)
