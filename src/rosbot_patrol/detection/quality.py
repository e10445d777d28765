"""What was measured of the networks on photographs, in a sentence each.

On 128 pictures of COCO val2017, which no network here was trained on: 350 persons, and 55 pictures without anybody. A
person is found if a box of the class person has an IoU of 0.5 or more with theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

EMPTY_PICTURES = 55


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Figures of one network at its own threshold.

    Args:
        found: share of the persons at least 0.3 of the picture high that it finds.
        alarms: number of the 55 empty pictures in which it finds somebody.
        remark: what else to know, "" for nothing.
    """

    found: float
    alarms: int
    remark: str = ""

    def __str__(self) -> str:
        """The sentence, without subject and full stop."""
        alarms = f"{self.alarms or 'no'} alarm{'s' if self.alarms > 1 else ''}"
        text = f"finds {self.found:.0%} of the large persons on photographs (COCO val2017)".replace("%", " %")
        remark = f"; {self.remark}" if self.remark else ""
        return f"{text}, {alarms} on {EMPTY_PICTURES} pictures without people{remark}"


MEASURED = {
    "yolo-fastest-1.1-xl": Quality(found=0.73, alarms=0),
    "ssdlite": Quality(found=0.61, alarms=1),
    "hog": Quality(found=0.05, alarms=7),
    "house": Quality(found=0.06, alarms=8, remark="it was trained for the simulated houses"),
}


def describe_quality(network: str) -> str:
    """How good a network is on photographs, as far as it was measured."""
    return str(MEASURED.get(network, "was not measured on photographs"))
