"""How far a campaign is, in a line: a bar, counts, and the time that is left by the mean of those that ended."""

from __future__ import annotations

WIDTH = 24


def clock(seconds: float) -> str:
    """A time as people read it."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def progress_line(done: int, total: int, here: int, elapsed: float, *, failed: int) -> str:
    """The line.

    Args:
        done: that ended, those of an earlier run among them.
        total: of the campaign.
        here: that ended in this run.
        elapsed: since it began [s].
        failed: of those that are done.
    """
    filled = round(WIDTH * done / total) if total else WIDTH
    left = f", {clock(elapsed / here * (total - done))} left" if here and done < total else ""
    wrong = f", {failed} not as they should be" if failed else ""
    return f"[{'#' * filled}{'.' * (WIDTH - filled)}] {done} of {total}{wrong}, {clock(elapsed)} gone{left}"
