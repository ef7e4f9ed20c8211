"""The application: pages, news, API, and links that acknowledge. It only reads the state file, but for what
`acknowledge` writes, which is the same as by command."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gliderwatch.config import Config
from gliderwatch.delivery import links
from gliderwatch.errors import GliderwatchError
from gliderwatch.export import maps
from gliderwatch.export.dives import assessment_line
from gliderwatch.figures.map_files import land_or_world
from gliderwatch.health.rule import Limits
from gliderwatch.messages.formatting import clean
from gliderwatch.messages.guide import PAGE
from gliderwatch.pages import render
from gliderwatch.pages.guide import guide_page
from gliderwatch.pages.reading import SHOWN, names_of, read_fleet, read_glider
from gliderwatch.pages.render import Frame
from gliderwatch.pages.view import GliderView, worst_first
from gliderwatch.service.liveness import STALE, is_held, seconds_silent
from gliderwatch.service.page_writer import battery_limits
from gliderwatch.store.state_file import Store
from gliderwatch.web import api
from gliderwatch.web import explore as explorer
from gliderwatch.web.cache import PageCache, stamp_of

Acknowledge = Callable[[str, str, float], str]
"""Takes an incident on: its id, who, when (s); the answer in a sentence. Raises GliderwatchError."""
Mute = Callable[[str, float, float], str]
"""Mutes a glider until a time, at a time (s); the answer in a sentence. Raises GliderwatchError."""
READERS = "who reads the pages"
"""Whom the links on the pages are for: who reaches them is not known here."""
MUTES = ("3", "6", "12", "24")
"""Hours for which a glider can be muted."""
LIVE = "events"
FLEET_KEPT, GLIDER_KEPT = 60.0, 300.0
"""Seconds for which a page holds while the state file does not change."""
LOOK = 1.0
"""Seconds between two looks at whether it has."""
SIGN = 15.0
"""Seconds between two signs of life of a stream of news: proxies close silent ones."""
MOST = 10_000
EXPLORED = 3000
"""Dives of a glider, a year of them, that are explored at the most."""
DRAWN = (
    "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""The policy of the plots to explore: Bokeh makes styles as it draws, and has its icons in them."""
_FORM = 2000
"""Bytes of a form that is read."""


class Site:
    """What is shown of one state file."""

    def __init__(self, config: Config, acknowledge: Acknowledge, mute: Mute) -> None:
        self.config, self.acknowledge, self.mute = config, acknowledge, mute
        self.state = Path(config.state.path)
        self.key = links.key_of(self.state)
        self.pages = PageCache(self._make, lambda: stamp_of(self.state), self._kept)
        self.news = asyncio.Condition()

    def _kept(self, path: str) -> float:
        return FLEET_KEPT if path == "index.html" else GLIDER_KEPT

    def frame(self, path: str) -> Frame:
        """When a page is made, when the next is due, and whether the service runs."""
        now = time.time()
        silent = seconds_silent(self.state)
        is_alive = is_held(self.state) and silent is not None and silent < STALE
        warning = "" if is_alive else "gliderwatch does NOT RUN: nothing new is seen, and nobody is alerted."
        return Frame(now, now + 2 * self._kept(path) + 60.0, LIVE, warning)

    def _make(self, path: str) -> str:
        frame = self.frame(path)
        if path == "index.html":
            return render.fleet_page(self.fleet(frame.now), frame, land_or_world(self.config.maps.files)[0])
        if path == PAGE:
            return guide_page()
        view = self._view(path, ("", "-sheet"), "html", frame.now)
        if view is None:
            raise KeyError(path)
        land = land_or_world(self.config.maps.files)[0]
        if path == render.file_of(view.name):
            return render.glider_page(view, frame, land, self._take_on(view))
        return render.sheet_page(view, frame, land)

    def _view(
        self, path: str, kinds: tuple[str, ...], ending: str, now: float, dives: int = SHOWN
    ) -> GliderView | None:
        """What is known of the glider of which a page is, one of these kinds; None where there is none."""
        with Store.looking(self.state) as store:
            name = self._named(store, path, kinds, ending)
            if name is None:
                return None
            attention, battery = self.config.attention(name), self._battery(name)
            return read_glider(store, name, attention, now, dives=dives, battery=battery)

    def _named(self, store: Store, path: str, kinds: tuple[str, ...], ending: str) -> str | None:
        """The glider of which a page is."""
        for name in names_of(store, self.config.gliders):
            if path in {render.file_of(name, kind, ending) for kind in kinds}:
                return name
        return None

    def _take_on(self, view: GliderView) -> dict[str, str]:
        """The links of a page by which what goes on can be taken on, and the glider muted: signed, so that no
        other page can have a browser follow them."""
        ids = {m.id: m.id for m in view.open_matters if m.can_be_taken_on}
        ids[view.name] = f"{view.name}/mute"
        return {what: f"ack/{links.token(self.key, identity, READERS)}" for what, identity in ids.items()}

    def glider(self, path: str) -> str | None:
        """The glider that a page explores; None where there is no such page."""
        with Store.looking(self.state) as store:
            return self._named(store, path, ("",), "html")

    def explored(self, path: str) -> GliderView | None:
        """All that is known of the glider of a page, to be explored; None where there is no such page."""
        return self._view(path, ("",), "json", time.time(), EXPLORED)

    def fleet(self, now: float, dives: int = 1) -> tuple[GliderView, ...]:
        """All gliders as known at `now` (s), with so many dives of each."""
        with Store.looking(self.state) as store:
            names = names_of(store, self.config.gliders)
            batteries = {name: self._battery(name) for name in names}
            return read_fleet(store, names, self.config.attention, now, dives, batteries)

    def _battery(self, name: str) -> Limits | None:
        return battery_limits(self.config, name)

    async def look(self) -> None:
        """Have pages made anew when there is news, and tell who looks at them; for ever."""
        while True:
            await asyncio.sleep(LOOK)
            with suppress(GliderwatchError):  # the state cannot be read now: what is there stays
                if await run_in_threadpool(self.pages.refresh):
                    async with self.news:
                        self.news.notify_all()


# ----------------------------------------
# Answers.


def _site(request: Request) -> Site:
    site: Site = request.app.state.site
    return site


async def page(request: Request) -> Response:
    """A page of the fleet or of a glider."""
    path = request.path_params.get("file", "index.html")
    pages = _site(request).pages
    try:
        text = pages.held(path) or await run_in_threadpool(pages.get, path)
    except KeyError:
        raise HTTPException(404, "There is no such page.") from None
    return HTMLResponse(text, headers={"Cache-Control": "no-cache"})


async def events(request: Request) -> Response:
    """News, as they come (server-sent events): `news` whenever pages were made anew."""
    site = _site(request)

    async def stream() -> AsyncIterator[str]:
        yield "retry: 5000\n\n"
        while not await request.is_disconnected():
            try:
                async with asyncio.timeout(SIGN), site.news:
                    await site.news.wait()
                yield "event: news\ndata: \n\n"
            except TimeoutError:
                yield ": well\n\n"

    return StreamingResponse(stream(), media_type="text/event-stream", headers={"Cache-Control": "no-cache"})


async def gliders(request: Request) -> Response:
    """All gliders."""
    views = await run_in_threadpool(_site(request).fleet, time.time())
    return JSONResponse([api.glider(view) for view, _ in worst_first(views)])


async def assessments(request: Request) -> Response:
    """The last dives of a glider."""
    try:
        limit = int(request.query_params.get("limit", "100"))
    except ValueError:
        limit = 0
    if not 1 <= limit <= MOST:
        raise HTTPException(400, f"limit is a whole number from 1 to {MOST}.")
    views = await run_in_threadpool(_site(request).fleet, time.time(), limit)
    wanted = [view for view in views if view.name == request.path_params["name"].lower()]
    if not wanted:
        raise HTTPException(404, "There is no such glider.")
    return JSONResponse([assessment_line(dive) for dive in wanted[0].dives])


async def incidents(request: Request) -> Response:
    """All incidents."""
    views = await run_in_threadpool(_site(request).fleet, time.time())
    return JSONResponse([api.incident(view, i) for view in views for i in view.incidents])


async def geojson(request: Request) -> Response:
    """All gliders for a map."""
    views = await run_in_threadpool(_site(request).fleet, time.time(), 150)
    return Response(maps.as_geojson(views), media_type="application/geo+json")


async def openapi(_request: Request) -> Response:
    """The description of the API."""
    return JSONResponse(api.openapi())


async def explore(request: Request) -> Response:
    """The plots of a glider to explore, their values, and the scripts that draw them."""
    path, site = request.path_params["file"], _site(request)
    if path == "explore.js":
        return Response(render.part(path), media_type="text/javascript")
    with suppress(KeyError):
        kept = {"Cache-Control": "max-age=86400"}
        return Response(explorer.script(path), media_type="text/javascript", headers=kept)
    if path.endswith(".json"):
        view = await run_in_threadpool(site.explored, path)
        if view is None:
            raise HTTPException(404, "There is no such page.")
        text = await run_in_threadpool(explorer.plots, view)
        return Response(text, media_type="application/json", headers={"Cache-Control": "no-cache"})
    name = await run_in_threadpool(site.glider, path)
    if name is None:
        raise HTTPException(404, "There is no such page.")
    page = render.explore_page(name, render.href(render.file_of(name, ending="json")), time.time())
    return HTMLResponse(page, headers={"Cache-Control": "no-cache", "Content-Security-Policy": DRAWN})


async def acknowledge(request: Request) -> Response:
    """GET: buttons, as scanners of mail open links. POST: takes the incident on, or mutes its glider."""
    site = _site(request)
    frame = Frame(time.time(), time.time() + FLEET_KEPT)
    try:
        seconds = site.config.web.link_hours * 3600.0
        incident, recipient = links.opened(site.key, request.path_params["token"], seconds)
        if request.method == "POST":
            form = await _form(request)
            if form.get("what") == "mute":
                hours = form.get("hours", "")
                end = frame.now + 3600.0 * float(hours if hours in MUTES else MUTES[0])
                answer = await run_in_threadpool(site.mute, incident.partition("/")[0], end, frame.now)
            else:
                who = _who(form.get("by", ""), recipient)
                answer = await run_in_threadpool(site.acknowledge, incident, who, frame.now)
            return _ack_page(frame, incident, recipient, answer=answer)
    except links.LinkError as error:
        return _ack_page(frame, "", "", answer=str(error), status=403)
    except GliderwatchError as error:
        return _ack_page(frame, "", "", answer=str(error), status=409)
    return _ack_page(frame, incident, recipient)


async def _form(request: Request) -> dict[str, str]:
    """What was typed; nothing of a form that is too long."""
    length = int(request.headers.get("content-length", _FORM + 1))
    typed = parse_qs((await request.body()).decode("utf-8", "replace")) if length <= _FORM else {}
    return {name: values[0] for name, values in typed.items()}


def _who(typed: str, recipient: str) -> str:
    """Who takes it on: the name that was typed, beside the recipient of the link."""
    name = clean(typed, 40)
    return f"{name} ({recipient})" if name else recipient


def _ack_page(
    frame: Frame, incident: str, recipient: str, *, answer: str = "", status: int = 200
) -> Response:
    text = render.ack_page(frame, incident, recipient, answer, is_open=links.can_be_taken_on(incident))
    return HTMLResponse(text, status_code=status, headers={"Cache-Control": "no-store"})


async def problem(_request: Request, error: Exception) -> Response:
    """What went wrong, in words; nothing of the inside."""
    if isinstance(error, HTTPException):
        return JSONResponse({"error": error.detail}, status_code=error.status_code)
    if isinstance(error, GliderwatchError):
        text = "The state cannot be read now; see gliderwatch status."
        return JSONResponse({"error": text}, status_code=503)
    return JSONResponse({"error": "A mistake in gliderwatch; its log says more."}, status_code=500)


# ----------------------------------------
# The application.


class Headers:
    """Puts the headers that keep a page to itself on every answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        policy = f"{render.page_policy()}; frame-ancestors 'none'"
        self._headers = [
            (name.lower().encode(), value.encode())
            for name, value in (
                ("Content-Security-Policy", policy),
                ("X-Content-Type-Options", "nosniff"),
                ("Referrer-Policy", "no-referrer"),
                ("Cross-Origin-Opener-Policy", "same-origin"),
                ("Cross-Origin-Resource-Policy", "same-origin"),
            )
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = list(message.get("headers", []))
                names = {name for name, _ in given}
                message["headers"] = given + [pair for pair in self._headers if pair[0] not in names]
            await send(message)

        await self._app(scope, receive, sending)


def application(config: Config, acknowledge_incident: Acknowledge, mute_glider: Mute) -> Starlette:
    """The application for a configuration. Raises GliderwatchError where its key cannot be had."""

    @asynccontextmanager
    async def life(app: Starlette) -> AsyncIterator[None]:
        app.state.site = Site(config, acknowledge_incident, mute_glider)
        looking = asyncio.create_task(app.state.site.look())
        yield
        looking.cancel()

    return Starlette(
        routes=[
            Route("/", page),
            Route(f"/{LIVE}", events),
            Route("/api/gliders", gliders),
            Route("/api/gliders/{name}/assessments", assessments),
            Route("/api/incidents", incidents),
            Route("/api/gliders.geojson", geojson),
            Route("/api/openapi.json", openapi),
            Route("/ack/{token}", acknowledge, methods=["GET", "POST"]),
            Route("/explore/{file}", explore),
            Route("/{file}", page),
        ],
        middleware=[Middleware(Headers), Middleware(TrustedHostMiddleware, allowed_hosts=hosts(config))],
        exception_handlers={HTTPException: problem, GliderwatchError: problem, Exception: problem},
        lifespan=life,
    )


def hosts(config: Config) -> list[str]:
    """The names under which it may be asked: no page of another host can then have a browser ask for it."""
    if config.web.open_to_network:
        return ["*"]
    public = [config.web.public_url.host] if config.web.public_url is not None else []
    return ["127.0.0.1", "localhost", "[::1]", str(config.web.address), *filter(None, public)]
