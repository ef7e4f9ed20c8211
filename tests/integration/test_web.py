"""The pages live: what is served, to whom, and what a link that acknowledges may do."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import stat
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import TypeVar

import jsonschema
import pytest
from itsdangerous import URLSafeTimedSerializer
from starlette.testclient import TestClient

from bad_pages import process_of
from gliderwatch.cli.manage import mute_glider
from gliderwatch.cli.status import acknowledge_incident
from gliderwatch.config import Config, load
from gliderwatch.delivery import links
from gliderwatch.errors import ConfigError
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.messages.samples import SAMPLES
from gliderwatch.model import Alert, Assessment, Incident, Kind, Segment, SegmentId
from gliderwatch.pipeline import GliderState, Outcome
from gliderwatch.store.state_file import Store
from gliderwatch.web import app, live
from gliderwatch.web.live import LiveJob, LivePage, PageCache, Shown
from unit.test_pages import HOSTILE, NOW, dive, incident

NAMES = ("bruce", "electa")
T = TypeVar("T")


def keep(state: Path, glider: str, dives: tuple[Assessment, ...], incidents: tuple[Incident, ...]) -> None:
    """Put results of a glider into a state file."""
    store = Store.open(state)
    with store.transaction():
        identity = SegmentId(dives[-1].t_dive, glider, dives[-1].segment)
        store.segments.put(Segment(identity, "m", "sbd", dives[-1].t_surface, (1, 1, ""), {}))
        store.apply(glider, Outcome(GliderState(), float("-inf"), dives, incidents, None))
        store.keep_notified(glider, NotificationState(), (), 0.0)
    store.close()


@pytest.fixture
def config(tmp_path: Path) -> Config:
    """A configuration whose state file knows two gliders; electa has an incident."""
    path = tmp_path / "gliderwatch.yml"
    (tmp_path / "root").mkdir()
    path.write_text(
        f"dockserver: {{roots: [{tmp_path}/root]}}\nstate: {{path: {tmp_path}/state.sqlite}}\n"
        "web: {public_url: https://gliders.example.org/}\ngliders: {bruce: , electa: }\n"
    )
    now = time.time()
    for name in NAMES:
        dives = tuple(
            replace(
                dive(), glider=name, t_dive=now - (k + 3) * 3600, t_surface=now - k * 3600, reason=HOSTILE
            )
            for k in (8, 4, 1)
        )
        opened = (replace(incident(), glider=name, opened_at=now - 3600),) if name == "electa" else ()
        keep(tmp_path / "state.sqlite", name, dives, opened)
    return load(path)


@pytest.fixture
def client(config: Config) -> Iterator[TestClient]:
    def take_on(identity: str, by: str, now: float) -> str:
        entry, _ = acknowledge_incident(config, identity, by, "", now)
        return f"{entry.incident.id}: taken on by {by}."

    def mute(glider: str, end: float, now: float) -> str:
        return "; ".join(mute_glider(config, glider, end, now))

    async def draw(work: Callable[[live.LiveJob], T], job: live.LiveJob) -> T:
        return work(job)  # the process is in the tests of the installed command

    with TestClient(app.application(config, take_on, mute, draw), base_url="http://127.0.0.1:8463") as client:
        yield client


def ack_of(config: Config) -> str | None:
    store = Store.reading(Path(config.state.path))
    try:
        return (
            {ack.by for ack in store.notes.acks("electa").values()}.pop()
            if store.notes.acks("electa")
            else None
        )
    finally:
        store.close()


def link(config: Config, identity: str = "electa/anomaly/1", who: str = "Ann") -> str:
    return f"/ack/{links.token(links.key_of(Path(config.state.path)), identity, who)}"


def test_pages_are_those_of_the_files_and_say_that_the_service_is_down(client: TestClient) -> None:
    page = client.get("/")
    assert page.status_code == 200
    assert page.text.index("electa</a>") < page.text.index("bruce</a>")  # the worst first
    assert "gliderwatch does NOT RUN" in page.text
    for path in ("/electa.html", "/electa-sheet.html", "/index.html"):
        assert client.get(path).status_code == 200, path
    assert "<script>alert" not in client.get("/electa.html").text
    assert client.get("/nobody.html").status_code == 404
    assert client.get("/..%2Fstate.sqlite").status_code == 404


def test_every_answer_is_kept_to_itself(client: TestClient) -> None:
    for path in ("/", "/api/gliders", "/nobody.html", "/ack/x"):
        headers = client.get(path).headers
        assert headers["content-security-policy"].startswith("default-src 'none'; style-src 'sha256-")
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"


def test_another_host_name_is_refused(client: TestClient) -> None:
    """A page elsewhere whose name is made to lead to this machine gets nothing."""
    assert client.get("/", headers={"Host": "evil.example"}).status_code == 400
    assert client.get("/", headers={"Host": "gliders.example.org"}).status_code == 200


def test_the_api_says_what_it_describes(client: TestClient) -> None:
    described = client.get("/api/openapi.json").json()
    for path, methods in described["paths"].items():
        answer = client.get(path.format(name="electa"))
        assert answer.status_code == 200, path
        (content,) = methods["get"]["responses"]["200"]["content"].items()
        assert answer.headers["content-type"].startswith(content[0])
        schema = {**content[1]["schema"], "components": described["components"]}
        jsonschema.Draft202012Validator(schema).validate(answer.json())
    routes = {r.path for r in client.app.routes if r.path.startswith("/api/")}  # type: ignore[attr-defined]
    assert routes == {*described["paths"], "/api/openapi.json"}
    assert [g["name"] for g in client.get("/api/gliders").json()] == ["electa", "bruce"]
    assert len(client.get("/api/gliders/electa/assessments?limit=2").json()) == 2
    for limit in ("0", "x", "1e9"):
        assert client.get(f"/api/gliders/electa/assessments?limit={limit}").status_code == 400
    assert client.get("/api/gliders/nobody/assessments").status_code == 404


def test_a_link_acknowledges_only_when_its_button_is_pressed(client: TestClient, config: Config) -> None:
    path = link(config)
    for _ in range(2):  # a scanner of mail opens links
        page = client.get(path)
        assert '<form method="post">' in page.text
        assert page.headers["cache-control"] == "no-store"
    assert ack_of(config) is None
    assert "taken on by Ann" in client.post(path).text
    assert ack_of(config) == "Ann"
    assert [i["acknowledged_by"] for i in client.get("/api/incidents").json()] == ["Ann"]
    client.post(path, data={"by": "Bob\r\n<b>"})
    assert ack_of(config) == "Bob <b> (Ann)"
    client.post(path, content=b"by=" + b"x" * 5000)
    assert ack_of(config) == "Ann"


def test_a_forged_foreign_or_expired_link_does_nothing(
    client: TestClient, config: Config, monkeypatch
) -> None:  # type: ignore[no-untyped-def]
    good = link(config)
    old = time.time() - 49 * 3600
    monkeypatch.setattr("itsdangerous.timed.time.time", lambda: old)
    expired = link(config)
    monkeypatch.undo()
    foreign = "/ack/" + links.token("another-key-of-another-gliderwatch-entirely", "electa/anomaly/1", "Eve")
    key = links.key_of(Path(config.state.path))
    salted = f"/ack/{URLSafeTimedSerializer(key, salt='x').dumps(['electa/anomaly/1', 'Eve'])}"
    for path in (good[:-3] + "AAA", f"/ack/{good[5:].swapcase()}", expired, foreign, salted, "/ack/x.y.z"):
        for answer in (client.get(path), client.post(path)):
            assert answer.status_code == 403, path
            assert "<form" not in answer.text
    assert ack_of(config) is None
    gone = client.post(link(config, "electa/anomaly/2"))
    assert gone.status_code == 409
    assert "there is no incident electa/anomaly/2" in gone.text
    hostile = client.get(link(config, HOSTILE, HOSTILE))
    assert "<script>alert" not in hostile.text


def test_a_glider_is_muted_by_the_link_of_its_message(client: TestClient, config: Config) -> None:
    path = link(config, "electa/overdue/1")
    page = client.get(path).text
    assert "Mute electa" in page and "Take on" not in page
    assert "electa: muted until" in client.post(path, data={"what": "mute", "hours": "12"}).text
    store = Store.reading(Path(config.state.path))
    until = store.notes.muted_until("electa")
    store.close()
    assert until == pytest.approx(time.time() + 12 * 3600, abs=60)
    assert "muted until" in client.post(path, data={"what": "mute", "hours": "1e9"}).text  # 3 hours
    nobody = client.post(link(config, "nobody/overdue/1"), data={"what": "mute"})
    assert nobody.status_code == 409


def test_the_pages_lead_to_what_they_show(client: TestClient, config: Config) -> None:
    """Whoever reads the live pages can take on and mute, by links that no other page can make."""
    page = client.get("/electa.html").text
    paths = re.findall(r'href="(ack/[^"]+)"', page)
    assert len(paths) == 2  # the incident, the glider
    assert "Take on electa: anomaly since 1970-01-01 00:00 UTC?" in client.get(f"/{paths[0]}").text
    assert "taken on by Ann (who reads the pages)" in client.post(f"/{paths[0]}", data={"by": "Ann"}).text
    assert "muted until" in client.post(f"/{paths[1]}", data={"what": "mute", "hours": "3"}).text


def test_the_plots_to_explore_are_all_from_here(client: TestClient) -> None:
    page = client.get("/explore/electa.html")
    assert re.findall(r'(?:src|data-from)="([^"]*)"', page.text) == [
        "bokeh.min.js",
        "explore.js",
        "electa.json",
    ]
    policy = page.headers["content-security-policy"]
    assert "script-src 'self';" in policy and "unsafe-eval" not in policy
    assert "http" not in page.text.replace("http-equiv", "").partition("<body>")[2]
    drawn = json.loads(client.get("/explore/electa.json").content)
    assert drawn["target_id"] == "plots"
    text = json.dumps(drawn)
    assert text.count('"Range1d"') == 1  # one axis of time
    for words in ("speed (m/s)", "Roll", "UTC"):
        assert words in text
    assert len(client.get("/explore/bokeh.min.js").content) > 1_000_000
    for path in ("nobody.html", "nobody.json", "electa.txt", "bokeh.js", "../state.sqlite"):
        assert client.get(f"/explore/{path}").status_code == 404, path


def test_the_key_is_for_its_user_alone_and_made_once(tmp_path: Path) -> None:
    keys: set[str] = set()
    threads = [
        threading.Thread(target=lambda: keys.add(links.key_of(tmp_path / "s.sqlite"))) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(keys) == 1
    assert stat.S_IMODE((tmp_path / "web.key").stat().st_mode) == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["web.key"]


def test_it_stays_at_home_unless_that_is_said(tmp_path: Path) -> None:
    path = tmp_path / "gliderwatch.yml"
    path.write_text(f"dockserver: {{roots: [{tmp_path}]}}\nweb: {{address: 0.0.0.0}}\n")
    with pytest.raises(ConfigError, match="not loopback"):
        load(path)


# --------------------------------------------------------------------------- news


def test_news_come_when_the_state_has_changed(client: TestClient, config: Config) -> None:
    site: app.Site = client.app.state.site  # type: ignore[attr-defined]
    before = client.get("/").text

    async def hear() -> None:
        async with asyncio.timeout(20), site.news:
            await site.news.wait()

    heard = client.portal.start_task_soon(hear)  # type: ignore[union-attr]
    acknowledge_incident(config, "electa/anomaly/1", "Bob", "", time.time())
    heard.result(timeout=20)
    assert "Bob has it" not in before
    assert "Bob has it" in client.get("/").text


def test_who_asks_the_api_in_turn_gets_one_answer_until_there_is_news(
    client: TestClient, config: Config
) -> None:
    first, second = (client.get("/api/gliders").json() for _ in range(2))
    assert first == second
    acknowledge_incident(config, "electa/anomaly/1", "Bob", "", time.time())
    assert [i["acknowledged_by"] for i in client.get("/api/incidents").json()] == ["Bob"]
    assert client.get("/api/gliders").json()[0]["as_of"] > first[0]["as_of"]


def test_a_page_that_the_browser_has_is_not_sent_again(client: TestClient) -> None:
    plain = client.get("/electa.html", headers={"Accept-Encoding": "identity"})
    packed = client.get("/electa.html", headers={"Accept-Encoding": "gzip"})
    assert packed.headers["content-encoding"] == "gzip"
    assert int(packed.headers["content-length"]) < len(plain.content) / 3
    assert packed.text == plain.text
    assert packed.headers["etag"] != plain.headers["etag"]
    for answer, coding in ((plain, "identity"), (packed, "gzip")):
        asked = {"Accept-Encoding": coding, "If-None-Match": answer.headers["etag"]}
        again = client.get("/electa.html", headers=asked)
        assert (again.status_code, again.content) == (304, b"")
    assert client.get("/electa.html", headers={"If-None-Match": '"0"'}).status_code == 200


def test_news_are_of_the_page_that_is_looked_at(client: TestClient, config: Config) -> None:
    """What is new of electa has the page of bruce neither made anew nor loaded again; a browser that was away
    gets its news when it comes back."""
    before = {file: client.get(f"/{file}").headers["etag"] for file in ("electa.html", "bruce.html", "")}
    address = re.search(r'data-live="([^"]+)"', client.get("/electa.html").text)
    assert address is not None
    acknowledge_incident(config, "electa/anomaly/1", "Bob", "", time.time())
    with client.stream("GET", f"/{unescape(address[1])}") as stream:  # ends with the first news
        assert "event: news" in "".join(stream.iter_text())
    after = {file: client.get(f"/{file}").headers["etag"] for file in before}
    assert [before[file] == after[file] for file in before] == [False, True, False]
    with client.stream("GET", f"/{unescape(address[1])}") as stream:
        assert "event: news" in "".join(stream.iter_text())


def test_nobody_waits_for_a_page_that_is_there() -> None:
    made: list[str] = []
    clock, mark = [0.0], [0]

    async def make(file: str) -> LivePage:
        if file == "none":
            raise KeyError(file)
        made.append(file)
        await asyncio.sleep(0)
        return LivePage(b"", b"", f"{file} {len(made)}")

    async def asked() -> None:
        cache = PageCache(make, lambda _file: mark[0], lambda _file: 60.0, lambda: clock[0])
        first = await asyncio.gather(*(cache.get("a") for _ in range(3)))  # made once for all
        assert [page.version for page in first] == ["a 1"] * 3
        assert not await cache.refresh()
        mark[0] = 1
        assert (await cache.get("a")).version == "a 1"  # as it was a moment ago
        assert await cache.refresh()
        assert (await cache.get("a")).version == "a 2"
        clock[0] = 60.0
        assert await cache.refresh()
        clock[0] = 700.0  # nobody has asked for ten minutes
        assert not await cache.refresh()
        assert (await cache.get("a")).version == "a 4"
        with pytest.raises(KeyError):
            await cache.get("none")

    asyncio.run(asked())


def test_a_page_asked_for_as_its_process_dies_is_made_by_the_next(tmp_path: Path) -> None:
    draw = app.InProcess(tmp_path / "state.sqlite")
    job = LiveJob(Shown(tmp_path / "state.sqlite", {}, {}, (), (), ""), "index.html")

    async def asked() -> None:
        before = await draw(process_of, job)
        for _ in range(6):
            os.kill(before, signal.SIGKILL)
            after = await draw(process_of, job)
            assert after != before
            before = after

    try:
        asyncio.run(asked())
    finally:
        draw.stop()


# --------------------------------------------------------------------------- links in messages


class Kept:
    """A channel that keeps what it is to send."""

    def __init__(self) -> None:
        self.sent: list[Alert] = []

    def prepare(self) -> None:
        pass

    def send(self, alert: Alert) -> None:
        self.sent.append(alert)


def test_a_message_of_an_incident_ends_with_links(client: TestClient, config: Config) -> None:
    kept = Kept()
    (channel,) = links.linked({"duty": kept}, "https://g.example.org/", Path(config.state.path)).values()
    alert = replace(SAMPLES[Kind.ANOMALY](NOW), glider="electa", incident="electa/anomaly/1+")
    channel.send(alert)
    (sent,) = kept.sent
    path = re.search(r"^Take it on: https://g\.example\.org(/ack/\S+)$", sent.body, re.M)
    assert path is not None
    for text in (sent.body, sent.html, sent.brief):
        assert text.count("Take it on") == 1 and "sudo" not in text  # the link is instead of the command
    assert "Page: https://g.example.org/electa.html" in sent.body
    assert sent.html.count("<a href") >= 2
    assert (sent.id, sent.title) == (alert.id, alert.title)
    assert "taken on by duty" in client.post(path[1]).text
    assert ack_of(config) == "duty"


@pytest.mark.parametrize(
    ("kind", "incident", "glider", "labels"),
    [
        (Kind.ANOMALY, "electa/anomaly/1", "electa", ["Take it on", "Page"]),
        (Kind.REMINDER, "electa/false_alarm/1", "electa", ["Take it on", "Page"]),
        (Kind.ALL_CLEAR, "electa/anomaly/1", "electa", ["Page"]),
        (Kind.OVERDUE, "electa/overdue/1", "electa", ["Mute it", "Page"]),
        (Kind.REMINDER, "electa/abort/1", "electa", ["Take it on", "Page"]),
        (Kind.HEALTH, "electa/health/leak/1", "electa", ["Take it on", "Page"]),
        (Kind.CALL, "electa/call/1", "electa", ["Take it on", "Page"]),
        (Kind.SURFACING, "", "electa", ["Page"]),
        (Kind.OPERATOR, "", "", []),
    ],
)
def test_only_what_can_be_taken_on_has_such_a_link(
    kind: Kind, incident: str, glider: str, labels: list[str]
) -> None:
    alert = replace(SAMPLES[Kind.ANOMALY](NOW), kind=kind, incident=incident, glider=glider)
    channel = links.Linked(Kept(), "https://g.example.org", "k" * 40, "duty")
    assert [label for label, _ in channel.links(alert)] == labels
    assert (links.with_links(alert, ()) is alert) and links.with_links(
        alert, channel.links(alert)
    ).id == alert.id
