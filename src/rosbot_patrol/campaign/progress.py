"""Progress line of a campaign: a bar, counts, and the remaining time by the mean duration."""

from __future__ import annotations

WIDTH = 24


def clock(seconds: float) -> str:
    """Duration for people."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def progress_line(done: int, total: int, here: int, elapsed: float, *, failed: int) -> str:
    """Make the line.

    Args:
        done: patrols that have ended, including earlier runs.
        total: of the campaign.
        here: patrols that have ended in this run.
        elapsed: time since its start [s].
        failed: failures among those done.
    """
    filled = round(WIDTH * done / total) if total else WIDTH
    left = f", {clock(elapsed / here * (total - done))} left" if here and done < total else ""
    wrong = f", {failed} not as they should be" if failed else ""
    return f"[{'#' * filled}{'.' * (WIDTH - filled)}] {done} of {total}{wrong}, {clock(elapsed)} gone{left}"
