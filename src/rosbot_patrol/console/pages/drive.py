"""Driving by hand: a stick on the screen or the arrow keys, with the camera beside it.

The page repeats the command ten times a second while the stick is held. When that ends, for whatever reason, the robot
stands still 0.3 s later.
"""

from __future__ import annotations

from nicegui import events, ui
from starlette.requests import Request

from rosbot_patrol.console.pages.camera_view import camera_view
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.frame import follow, frame

_PERIOD_MS = 100
_STICK = """
<div id="stick" class="console-stick" role="application" tabindex="0" aria-label="%s"><div id="knob"></div></div>
"""
_SCRIPT = """
(() => {
  const stick = document.getElementById('stick'), knob = document.getElementById('knob');
  if (!stick || stick.dataset.ready) return;
  stick.dataset.ready = 'yes';
  const keys = new Set();
  let held = false, x = 0, y = 0, timer = null;
  const send = () => emitEvent('drive', {forward: -y, turn: -x});
  const show = () => { knob.style.transform = `translate(${x * 60}px, ${y * 60}px)`; };
  const begin = () => { if (!timer) { send(); timer = setInterval(send, %d); } };
  const end = () => {
    held = false; x = 0; y = 0; keys.clear(); show();
    if (timer) { clearInterval(timer); timer = null; send(); }
  };
  const follow = (e) => {
    const r = stick.getBoundingClientRect();
    x = (e.clientX - r.left - r.width / 2) / (r.width / 2);
    y = (e.clientY - r.top - r.height / 2) / (r.height / 2);
    const size = Math.hypot(x, y);
    if (size > 1) { x /= size; y /= size; }
    show();
  };
  stick.addEventListener('pointerdown', (e) => {
    stick.setPointerCapture(e.pointerId);
    held = true; follow(e); begin();
  });
  stick.addEventListener('pointermove', (e) => { if (held) follow(e); });
  stick.addEventListener('pointerup', end);
  stick.addEventListener('pointercancel', end);
  const arrows = {ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0]};
  const steer = () => {
    x = 0; y = 0;
    for (const key of keys) { x += arrows[key][0] * 0.6; y += arrows[key][1] * 0.6; }
    show();
    if (keys.size) begin(); else end();
  };
  stick.addEventListener('keydown', (e) => { if (arrows[e.key]) { e.preventDefault(); keys.add(e.key); steer(); } });
  stick.addEventListener('keyup', (e) => { if (keys.delete(e.key)) steer(); });
  stick.addEventListener('blur', end);
  window.addEventListener('blur', end);
  document.addEventListener('visibilitychange', () => { if (document.hidden) end(); });
})();
"""


def drive_page(context: Context, request: Request) -> None:
    """Draw the page."""
    with frame(context, request, "/drive") as view:
        _ = view.words
        if not view.account.role.may_order:
            ui.label(_("Guests do not drive the robot.")).classes("text-xl").props('role="alert"')
            return

        def drive(event: events.GenericEventArguments) -> None:
            forward, turn = (float(event.args.get(key, 0.0)) for key in ("forward", "turn"))
            context.desk.drive(view.visitor, forward, turn)

        ui.on("drive", drive)
        with ui.element("div").classes("console-columns"):
            with ui.card().classes("w-full p-0 overflow-hidden"):
                camera_view(context, view)
            with ui.card().classes("w-full items-center"):
                ui.html(_STICK % _("Stick: hold and pull, or use the arrow keys"), sanitize=False)
                ui.label(_("Hold the stick to drive. Let go, and the robot stands still.")).classes("text-center")
                stopped = ui.label(_("The emergency stop is pressed: the robot does not move.")).props('role="alert"')
                follow(context.hub, lambda: stopped.set_visibility(context.hub.state.is_stopped))
        ui.timer(0.2, lambda: ui.run_javascript(_SCRIPT % _PERIOD_MS), once=True)
