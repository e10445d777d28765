"""The web application: routes for pictures and files, and the pages."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable
from pathlib import Path

import nicegui
from fastapi import FastAPI
from nicegui import ui
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp

from rosbot_patrol.alerts.records.incident import is_name
from rosbot_patrol.console.access.accounts import Account
from rosbot_patrol.console.access.gate import Gate
from rosbot_patrol.console.access.sign_in import SignIn
from rosbot_patrol.console.pages.context import Context
from rosbot_patrol.console.pages.drive import drive_page
from rosbot_patrol.console.pages.guide import guide_page
from rosbot_patrol.console.pages.health import health_page
from rosbot_patrol.console.pages.home import home_page
from rosbot_patrol.console.pages.house.page import house_page
from rosbot_patrol.console.pages.incident import incident_page
from rosbot_patrol.console.pages.incident_list import incidents_page
from rosbot_patrol.console.pages.settings import settings_page
from rosbot_patrol.console.web.camera import CameraStream
from rosbot_patrol.console.web.icons import SHIELD, icon
from rosbot_patrol.console.web.part import part_of
from rosbot_patrol.errors import StoreError

log = logging.getLogger(__name__)

_HERE = Path(__file__).resolve().parent
_TYPES = {".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".png": "image/png", ".mp4": "video/mp4"}
_SIZES = (192, 512)
_FOREVER = {"Cache-Control": "private, max-age=31536000, immutable"}


def make_app(context: Context, *, is_secure: bool) -> ASGIApp:
    """Make the application; once in a process.

    Args:
        context: parts of the console.
        is_secure: it is served by TLS.
    """
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    _add_sign_in(app, SignIn(context.door, is_secure=is_secure))
    _add_looks(app)
    _add_live(app, context)
    _add_incidents(app, context)
    _add_pages(context)
    nicegui.app.on_exception(_log_defect)
    ui.run_with(
        app,
        title="rosbot_patrol",
        favicon=SHIELD,
        dark=None,
        show_welcome_message=False,
        reconnect_timeout=10.0,
    )
    return Gate(app, context.door)


def _log_defect(err: Exception) -> None:
    """A defect of a page costs that page one answer; the log names it."""
    log.error("a page of the console failed: %s", err, exc_info=err)


def _add_sign_in(app: FastAPI, sign_in: SignIn) -> None:
    app.add_api_route("/sign-in", sign_in.page, methods=["GET"])
    app.add_api_route("/sign-in", sign_in.take, methods=["POST"])
    app.add_api_route("/sign-out", sign_in.leave, methods=["POST"])


def _add_looks(app: FastAPI) -> None:
    manifest = {
        "name": "rosbot_patrol",
        "short_name": "Patrol",
        "start_url": "/",
        "display": "standalone",
        "background_color": "#1565c0",
        "theme_color": "#1565c0",
        "icons": [{"src": f"/icon-{size}.png", "sizes": f"{size}x{size}", "type": "image/png"} for size in _SIZES],
    }

    @app.get("/manifest.webmanifest")
    async def get_manifest() -> Response:
        return Response(json.dumps(manifest), media_type="application/manifest+json")

    @app.get("/style.css")
    async def get_style() -> Response:
        return FileResponse(_HERE / "style.css", media_type="text/css")

    @app.get("/favicon.ico")
    async def get_favicon() -> Response:
        return Response(icon(_SIZES[0]), media_type="image/png")

    @app.get("/icon-{size}.png")
    async def get_icon(size: int) -> Response:
        return Response(icon(size), media_type="image/png") if size in _SIZES else _missing()


def _add_live(app: FastAPI, context: Context) -> None:
    camera = CameraStream(context.hub, context.door.present)
    app.add_api_route("/camera.mjpg", camera.answer, methods=["GET"])

    @app.get("/map.png")
    async def get_map(request: Request) -> Response:
        account: Account = request.state.account
        found = context.hub.map
        if not account.role.may_watch:
            return PlainTextResponse("Guests see nothing live.", 403)
        return Response(found.png, media_type="image/png", headers=_FOREVER) if found is not None else _missing()


def _add_incidents(app: FastAPI, context: Context) -> None:
    @app.get("/incidents/{incident_id}/files/{name}")
    async def get_file(request: Request, incident_id: str, name: str) -> Response:
        kind = _TYPES.get(Path(name).suffix.lower())
        if kind is None or not is_name(incident_id) or not is_name(name):
            return _missing()
        found = await _stored(lambda: context.incidents.file(incident_id, name), kind, _FOREVER)
        return part_of(found, request.headers.get("range", ""), _FOREVER) if kind.startswith("video") else found

    @app.get("/report.zip")
    async def get_report(request: Request) -> Response:
        account: Account = request.state.account
        if not account.role.may_manage:
            return PlainTextResponse("Only owners make a report.", 403)
        attached = {"Content-Disposition": 'attachment; filename="rosbot_patrol-report.zip"'}
        return Response(await asyncio.to_thread(context.report), media_type="application/zip", headers=attached)

    @app.post("/seen/{incident_id}/{token}")
    async def mark_seen(incident_id: str, token: str) -> Response:
        status, text = await context.seen.take(incident_id, token)
        return PlainTextResponse(text, status)

    @app.get("/incidents/{incident_id}/export.zip")
    async def get_export(incident_id: str) -> Response:
        if not is_name(incident_id):
            return _missing()
        attached = {"Content-Disposition": f'attachment; filename="{incident_id}.zip"'}
        return await _stored(lambda: context.incidents.export(incident_id), "application/zip", attached)


async def _stored(read: Callable[[], bytes | None], kind: str, headers: dict[str, str]) -> Response:
    try:
        data = await asyncio.to_thread(read)
    except StoreError as err:
        return PlainTextResponse(str(err), 500)
    return _missing() if data is None else Response(data, media_type=kind, headers=headers)


def _missing() -> Response:
    return PlainTextResponse("There is no such thing here.", 404)


def _add_pages(context: Context) -> None:
    @ui.page("/")
    def get_home(request: Request) -> Response | None:
        if context.guide is not None:
            return RedirectResponse("/guide")
        home_page(context, request)
        return None

    @ui.page("/guide")
    def get_guide(request: Request) -> Response | None:
        if context.guide is None:
            return RedirectResponse("/")
        guide_page(context, request)
        return None

    @ui.page("/incidents")
    def get_incidents(request: Request) -> None:
        incidents_page(context, request)

    @ui.page("/incidents/{incident_id}")
    async def get_incident(request: Request, incident_id: str) -> None:
        await incident_page(context, request, incident_id)

    @ui.page("/drive")
    def get_drive(request: Request) -> None:
        drive_page(context, request)

    @ui.page("/house")
    def get_house(request: Request) -> None:
        house_page(context, request)

    @ui.page("/health")
    def get_health(request: Request) -> None:
        health_page(context, request)

    @ui.page("/settings")
    def get_settings(request: Request) -> None:
        settings_page(context, request)
