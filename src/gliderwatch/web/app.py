"""The application: pages, news, API, and links that acknowledge. It only reads the state file, but for what
`acknowledge` writes, which is the same as by command."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Hashable
from contextlib import asynccontextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol, TypeVar
from urllib.parse import parse_qs

import structlog
from pebble import ProcessExpired
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gliderwatch.config import Config
from gliderwatch.delivery import links
from gliderwatch.errors import GliderwatchError
from gliderwatch.export import maps
from gliderwatch.export.dives import assessment_line
from gliderwatch.messages.formatting import clean
from gliderwatch.messages.guide import PAGE
from gliderwatch.pages import render
from gliderwatch.pages.fields import fields_of
from gliderwatch.pages.reading import names_of, read_fleet
from gliderwatch.pages.render import Frame
from gliderwatch.pages.view import GliderView, worst_first
from gliderwatch.processes import NotBegun
from gliderwatch.service.drawing import DrawingProcess
from gliderwatch.service.liveness import STALE, is_held, seconds_silent
from gliderwatch.service.page_writer import battery_limits
from gliderwatch.store.state_file import Store
from gliderwatch.web import api, live
from gliderwatch.web.live import FLEET, LiveJob, LivePage, PageCache, Shown, files_of, kept

log = structlog.get_logger(__name__)

Acknowledge = Callable[[str, str, float], str]
"""Takes an incident on: its id, who, when (s); the answer in a sentence. Raises GliderwatchError."""
Mute = Callable[[str, float, float], str]
"""Mutes a glider until a time, at a time (s); the answer in a sentence. Raises GliderwatchError."""
MUTES = ("3", "6", "12", "24")
"""Hours for which a glider can be muted."""
LOOK = 1.0
"""Seconds between two looks at whether the state file has changed."""
FRESH = 10.0
"""Seconds for which all who ask the API get one answer, while the state file does not change."""
SIGN = 15.0
"""Seconds between two signs of life of a stream of news: proxies close silent ones."""
LIMIT = 60.0
"""Seconds that a page may take to be made: usually a tenth of one."""
MOST = 10_000
DRAWN = (
    "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""The policy of the plots to explore: Bokeh makes styles as it draws, and has its icons in them."""
_FORM = 2000
"""Bytes of a form that is read."""
_NICENESS = 10
DOWN = "gliderwatch does NOT RUN: nothing new is seen, and nobody is alerted."
T = TypeVar("T")


BOKEH = "bokeh.min.js"
"""The script that draws plots to explore, of Bokeh's own package."""


def bokeh() -> Path:
    """Where Bokeh's script is; the package itself is not loaded here."""
    found = find_spec("bokeh")
    assert found is not None and found.origin is not None  # it comes with the extra that has Starlette
    return Path(found.origin).parent / "server" / "static" / "js" / BOKEH


def stamp_of(state: Path) -> Hashable:
    """What changes with every change of a state file: time and size of it and of its log."""
    found = []
    for path in (state, state.with_name(f"{state.name}-wal")):
        with suppress(OSError):
            status = path.stat()
            if status.st_size:  # a log is made by who only reads, too
                found.append((path.name, status.st_mtime_ns, status.st_size))
    return tuple(found)


class Draw(Protocol):
    """Has work done away from where requests are answered."""

    async def __call__(self, work: Callable[[LiveJob], T], job: LiveJob) -> T:
        """What the work makes. Raises what it raises, or GliderwatchError where it is not done in time."""


class InProcess:
    """Draws in a process of its own, which yields to others: who answers never waits for it."""

    def __init__(self, state: Path) -> None:
        self._state, self._process = state, DrawingProcess(_NICENESS)

    async def __call__(self, work: Callable[[LiveJob], T], job: LiveJob) -> T:
        """What the work makes. Raises what it raises, or GliderwatchError where it is not done in time."""
        for _ in range(2):
            making = self._process.begin(work, job, LIMIT, self._state)
            if making is None:
                break
            try:
                return await asyncio.wrap_future(making)
            except NotBegun:
                continue
            except (TimeoutError, ProcessExpired):
                break
        raise GliderwatchError(f"the page {job.file} could not be made in {LIMIT:g} s")

    def stop(self) -> None:
        """End the process."""
        self._process.stop()


class Site:
    """What is shown of one state file."""

    def __init__(self, config: Config, acknowledge: Acknowledge, mute: Mute, draw: Draw) -> None:
        self.config, self.acknowledge, self.mute, self.draw = config, acknowledge, mute, draw
        self.state = Path(config.state.path)
        self.key = links.key_of(self.state)
        self.news = asyncio.Condition()
        self.pages = PageCache(self._make, self._mark, kept)
        self._shown: Shown | None = None
        self._fleet: tuple[Hashable, float, tuple[GliderView, ...]] | None = None
        self._marks: dict[str, Hashable] = {}
        self._seen: Hashable = None

    async def page(self, file: str) -> LivePage:
        """A page. Raises KeyError where there is none of that name, GliderwatchError."""
        await self.shown()
        if file not in self._marks:
            raise KeyError(file)
        return self.pages.held(file) or await self.pages.get(file)

    async def job(self, file: str) -> LiveJob:
        """What the page of a file is made from. Raises GliderwatchError."""
        return LiveJob(await self.shown(), file, self._warning())

    async def shown(self) -> Shown:
        """What is shown, read where it was not yet. Raises GliderwatchError."""
        if self._shown is None:
            await self.read()
        assert self._shown is not None
        return self._shown

    async def read(self) -> None:
        """See what is new, by page. Raises GliderwatchError."""
        seen = (stamp_of(self.state), self._warning())
        if seen != self._seen:
            self._shown, self._marks = await run_in_threadpool(self._read)
            self._seen = seen

    async def look(self) -> None:
        """Have pages made anew when there is news, and tell who looks at them; for ever."""
        while True:
            await asyncio.sleep(LOOK)
            try:
                await self.read()
                is_news = await self.pages.refresh()
            except (GliderwatchError, KeyError) as error:  # what is there stays; it is tried again
                log.warning("pages not made anew", reason=str(error))
                continue
            if is_news:
                async with self.news:
                    self.news.notify_all()

    def fleet(self, now: float, dives: int = 1) -> tuple[GliderView, ...]:
        """All gliders as known at `now` (s), or a moment before if nothing has changed, with so many dives of
        each."""
        mark, read = (stamp_of(self.state), dives), self._fleet
        if read is None or read[0] != mark or now - read[1] >= FRESH:
            read = self._fleet = (mark, now, self._read_fleet(now, dives))
        return read[2]

    def _read_fleet(self, now: float, dives: int) -> tuple[GliderView, ...]:
        with Store.looking(self.state) as store:
            names = names_of(store, self.config.gliders)
            batteries = {name: battery_limits(self.config, name) for name in names}
            return read_fleet(store, names, self.config.attention, now, dives, batteries)

    async def _make(self, file: str) -> LivePage:
        return await self.draw(live.page, await self.job(file))

    def _warning(self) -> str:
        """What stands above all pages where the service does not run."""
        silent = seconds_silent(self.state)
        return "" if is_held(self.state) and silent is not None and silent < STALE else DOWN

    def _mark(self, file: str) -> Hashable:
        return (self._marks.get(file), self._warning())

    def _read(self) -> tuple[Shown, dict[str, Hashable]]:
        config, marks = self.config, dict[str, Hashable]()
        with Store.looking(self.state) as store:
            names = names_of(store, config.gliders)
            for name in names:
                marks |= dict.fromkeys(files_of(name), store.facts(name).newest())
            fields = tuple(fields_of(store, time.time()))
        attention = {name: config.attention(name) for name in names}
        batteries = {name: battery_limits(config, name) for name in names}
        shown = Shown(self.state, attention, batteries, fields, config.maps.files, self.key)
        of_all = hash(tuple(marks.items()))
        return shown, marks | dict.fromkeys((FLEET, *map(render.field_file, fields)), of_all) | {PAGE: None}


# ----------------------------------------
# Answers.


def _site(request: Request) -> Site:
    site: Site = request.app.state.site
    return site


async def page(request: Request) -> Response:
    """A page of the fleet or of a glider; as it was packed for all, or nothing where the browser has it."""
    try:
        found = await _site(request).page(request.path_params.get("file", FLEET))
    except KeyError:
        raise HTTPException(404, "There is no such page.") from None
    is_packed = "gzip" in request.headers.get("accept-encoding", "")
    tag = f'"{found.version}{"-gzip" if is_packed else ""}"'
    headers = {"Cache-Control": "no-cache", "ETag": tag, "Vary": "Accept-Encoding"}
    if tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if is_packed:
        headers["Content-Encoding"] = "gzip"
    return HTMLResponse(found.packed if is_packed else found.plain, headers=headers)


async def events(request: Request) -> Response:
    """News, as they come (server-sent events): `news` whenever the page that is looked at was made anew."""
    site = _site(request)
    file, since = (request.query_params.get(name, "") for name in ("page", "since"))

    def is_newer() -> bool:
        held = site.pages.held(file)
        return held is not None and held.version != since

    async def stream() -> AsyncIterator[str]:
        yield "retry: 5000\n\n"
        while not await request.is_disconnected():
            try:
                async with asyncio.timeout(SIGN), site.news:
                    await site.news.wait_for(is_newer)
                yield "event: news\ndata: \n\n"
                return
            except TimeoutError:
                site.pages.held(file)  # somebody still looks at it
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
    if path == BOKEH:
        headers = {"Cache-Control": "max-age=86400"}
        return FileResponse(bokeh(), media_type="text/javascript", headers=headers)
    job = await site.job(path)
    try:
        if path.endswith(".json"):
            text = await site.draw(live.explored, job)
            return Response(text, media_type="application/json", headers={"Cache-Control": "no-cache"})
        name = {render.file_of(name): name for name in job.shown.attention}[path]
    except KeyError:
        raise HTTPException(404, "There is no such page.") from None
    page = render.explore_page(name, render.href(render.file_of(name, ending="json")), time.time())
    return HTMLResponse(page, headers={"Cache-Control": "no-cache", "Content-Security-Policy": DRAWN})


async def acknowledge(request: Request) -> Response:
    """GET: buttons, as scanners of mail open links. POST: takes the incident on, or mutes its glider."""
    site = _site(request)
    frame = Frame(time.time(), time.time() + live.FLEET_KEPT)
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
    return f"{name} ({recipient})" if name and name != recipient else recipient


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
        log.warning("not answered", reason=str(error))
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


def application(
    config: Config, acknowledge_incident: Acknowledge, mute_glider: Mute, draw: Draw
) -> Starlette:
    """The application for a configuration. Raises GliderwatchError where its key cannot be had."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        app.state.site = Site(config, acknowledge_incident, mute_glider, draw)
        looking = asyncio.create_task(app.state.site.look())
        yield
        looking.cancel()

    return Starlette(
        routes=[
            Route("/", page),
            Route(f"/{live.LIVE}", events),
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
        lifespan=lifespan,
    )


def hosts(config: Config) -> list[str]:
    """The names under which it may be asked: no page of another host can then have a browser ask for it."""
    if config.web.open_to_network:
        return ["*"]
    public = [config.web.public_url.host] if config.web.public_url is not None else []
    return ["127.0.0.1", "localhost", "[::1]", str(config.web.address), *filter(None, public)]
