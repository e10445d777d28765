"""Plan of a crash campaign, drawn from a seed: which program is killed when, one to three kills in a patrol."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ALL = "all"
MASTER = "master"
ENDS_LIFE = (ALL, MASTER)  # the house starts anew after these
GUARD = "patrolling_node"

# Each block of kills has these once, in its own order: every node of the launch, the patrol itself more often.
VICTIMS = (
    GUARD, GUARD, GUARD, GUARD, ALL, ALL, MASTER, MASTER, "move_base", "amcl", "map_server", "twist_mux", "darknet_ros",
    "sensor_watch", "esp_client1", "rgb_compress", "robot_state_publisher", "laser_broadcaster",
)  # fmt: skip

# Moments of a patrol, in order, and the longest delay of a kill after them [s].
MOMENTS = {"called": 0.5, "driving": 6.0, "seen": 0.4, "looking": 6.0, "returning": 4.0}
_MOST = 3  # kills in one patrol


@dataclass(frozen=True, kw_only=True)
class Kill:
    """One kill.

    Attributes:
        number: in the campaign.
        victim: name of the node, ALL, or MASTER.
        moment: one of MOMENTS.
        delay: after it [s].
    """

    number: int
    victim: str
    moment: str
    delay: float


@dataclass(frozen=True, kw_only=True)
class CrashPatrol:
    """A patrol with its kills in order; one after which the house starts anew is the last."""

    number: int
    kills: tuple[Kill, ...]


def victim_of(seed: int, number: int) -> str:
    """Victim of a kill of the campaign."""
    block, place = divmod(number, len(VICTIMS))
    return VICTIMS[int(np.random.default_rng([seed, block, 11]).permutation(len(VICTIMS))[place])]


def plan_crashes(seed: int, kills: int) -> list[CrashPatrol]:
    """Patrols of a campaign with this number of kills; a longer campaign begins with the same patrols."""
    patrols: list[CrashPatrol] = []
    number = 0
    while number < kills:
        rng = np.random.default_rng([seed, number, 12])
        names = list(MOMENTS)
        count = int(rng.integers(1, _MOST + 1))
        moments = sorted(rng.choice(len(names), size=count, replace=False))
        planned: list[Kill] = []
        for moment in moments[: kills - number]:
            name = names[int(moment)]
            victim = victim_of(seed, number)
            delay = round(float(rng.uniform(0.0, MOMENTS[name])), 3)
            planned.append(Kill(number=number, victim=victim, moment=name, delay=delay))
            number += 1
            if victim in ENDS_LIFE:
                break
        patrols.append(CrashPatrol(number=len(patrols), kills=tuple(planned)))
    return patrols
