"""What the guard does, in one sentence for its owner, in their language."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.alerts.records.incident import NO_ROOM, Incident, Place
from rosbot_patrol.alerts.records.query import Found
from rosbot_patrol.console.live.day_log import Entry
from rosbot_patrol.console.live.house_state import ArmingNow, GuardNow, HouseState
from rosbot_patrol.console.words import Words

MODES = ("armed_away", "armed_home", "night", "disarmed")
ICONS = {"armed_away": "lock", "armed_home": "home", "night": "bedtime", "disarmed": "lock_open"}


@dataclass(frozen=True, kw_only=True)
class Headline:
    """What stands on top of the home page: a sentence, an icon's name, a colour's name (of Quasar), and details."""

    text: str
    icon: str
    colour: str
    detail: str = ""


def mode_name(mode: str, _: Words) -> str:
    """A mode's name."""
    names = {"armed_away": _("Away"), "armed_home": _("Home"), "night": _("Night"), "disarmed": _("Disarmed")}
    return names.get(mode, mode)


def verdict_name(verdict: str, _: Words) -> str:
    """A verdict for people."""
    names = {
        "confirmed": _("Somebody seen"),
        "clear": _("Nobody there"),
        "unverified": _("Not sure"),
        "unreachable": _("Not reached"),
        "": _("Still looking"),
    }
    return names.get(verdict, verdict)


def verdict_colour(verdict: str) -> str:
    """Colour of a verdict, by Quasar's names."""
    return {"confirmed": "negative", "clear": "positive", "": "info"}.get(verdict, "warning")


def origin_text(origin: str, _: Words) -> str:
    """Reason of a mission."""
    texts = {
        "trigger": _("its motion sensor called"),
        "action": _("somebody asked for it"),
        "all": _("somebody asked for all rooms"),
        "silent_sensor": _("its motion sensor is silent"),
        "schedule": _("a scheduled round"),
    }
    return texts.get(origin, origin)


def headline(state: HouseState, _: Words) -> Headline:
    """What the guard does and why."""
    guard = state.guard
    if not state.is_heard or guard is None:
        text = _("The guard does not answer.") if guard else _("Waiting for the guard.")
        return Headline(text=text, icon="cloud_off", colour="negative" if guard else "warning")
    if state.is_stopped or guard.doing == "stopped":
        return Headline(text=_("Stopped by the emergency stop."), icon="pan_tool", colour="negative", detail=guard.why)
    if guard.verdict == "confirmed":
        text = _("Somebody is in {room}!").format(room=guard.room_name)
        return Headline(text=text, icon="warning", colour="negative", detail=guard.why)
    if guard.doing in ("idle", "starting"):
        return _waiting(guard, state.arming, _)
    sentences = {
        "driving": _("On the way to {room}: {reason}."),
        "looking": _("Looking around in {room}: {reason}."),
        "returning": _("Driving home from {room}."),
    }
    reason = origin_text(guard.origin, _)
    text = sentences.get(guard.doing, guard.doing).format(room=guard.room_name, reason=reason)
    return Headline(text=text, icon="directions_run", colour="info", detail=guard.why)


def _waiting(guard: GuardNow, arming: ArmingNow | None, _: Words) -> Headline:
    if guard.doing == "starting":
        return Headline(text=_("Getting ready."), icon="hourglass_top", colour="warning", detail=guard.why)
    if arming is not None and arming.mode == "disarmed":
        return Headline(text=_("Disarmed: no sensor calls the guard."), icon="lock_open", colour="grey", detail="")
    if arming is not None and arming.exit_delay > 0:
        return Headline(text=_("On guard in a moment: leave now."), icon="hourglass_top", colour="info")
    return Headline(text=_("On guard. All is quiet."), icon="verified_user", colour="positive", detail="")


def room_of(found: Found | Incident, _: Words) -> str:
    """Where an incident was, for its title."""
    if isinstance(found, Incident):
        if found.place is Place.OTHER and found.person_room:
            return found.person_room
        if found.place is Place.OUTSIDE and found.person_room_id == NO_ROOM:
            return _("outside of the rooms")
    return found.room_name or _("room {number}").format(number=found.room_id)


def title_of(found: Found | Incident, _: Words) -> str:
    """An incident in some words."""
    room = room_of(found, _)
    if found.verdict == "confirmed" or found.object_class:
        return (
            _("Person in {room}").format(room=room)
            if found.object_class in ("", "person")
            else f"{found.object_class}: {room}"
        )
    return room


def day_line(entry: Entry, _: Words) -> tuple[str, str]:
    """Icon and sentence of an entry of the log of the last day."""
    is_on = entry.what == "on"
    if entry.kind == "mission":
        return "directions_run", _("To {room}: {reason}.").format(room=entry.room, reason=origin_text(entry.what, _))
    if entry.kind == "verdict":
        verdict = verdict_name(entry.what, _)
        return "gavel", f"{entry.room}: {verdict}" if entry.room else verdict
    if entry.kind == "mode":
        return ICONS.get(entry.what, "lock"), _("Mode: {name}").format(name=mode_name(entry.what, _))
    if entry.kind == "problem":
        return "error", entry.text or entry.what
    sentences = {
        "guard": ("shield", _("The guard runs."), _("The guard does not answer.")),
        "stop": ("pan_tool", _("The emergency stop is pressed."), _("The emergency stop is released.")),
        "charging": ("battery_charging_full", _("The robot charges."), _("The robot has left its charger.")),
    }
    if entry.kind in sentences:
        icon, on, off = sentences[entry.kind]
        return icon, on if is_on else off
    return "check", _("Well again: {what}").format(what=entry.what)


def ago(seconds: float | None, _: Words) -> str:
    """How long ago something was."""
    if seconds is None:
        return _("never")
    for size, text in ((86400, _("{n} d ago")), (3600, _("{n} h ago")), (60, _("{n} min ago"))):
        if seconds >= 2 * size:
            return text.format(n=int(seconds // size))
    return _("{n} s ago").format(n=int(seconds))
