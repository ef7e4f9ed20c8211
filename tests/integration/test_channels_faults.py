"""Channels that fail as real ones do: down, slow, refusing, greylisting, out of DNS; with a real outbox."""

from __future__ import annotations

import smtplib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.controller import Controller

from alert_support import alert, until
from gliderwatch.cli.status import overview
from gliderwatch.config import load
from gliderwatch.delivery.channels import Channel, DeliveryError
from gliderwatch.delivery.dispatcher import Dispatcher, retry_delay
from gliderwatch.service import operator_alerts
from gliderwatch.store.outbox import Outbox
from gliderwatch.store.state_file import Store

HOUR = 3600.0


class Box:
    """A mail server's handler: answers of RCPT and DATA in turn, then it takes all; slow if told."""

    def __init__(self, rcpt: tuple[str, ...] = (), data: tuple[str, ...] = (), slow: float = 0.0) -> None:
        self.rcpt, self.data, self.slow = list(rcpt), list(data), slow
        self.ids: list[str] = []

    async def handle_RCPT(  # noqa: N802
        self, _server: Any, _session: Any, envelope: Any, address: str, _options: Any
    ) -> str:
        if self.rcpt:
            return self.rcpt.pop(0)
        envelope.rcpt_tos.append(address)
        return "250 fine"

    async def handle_DATA(self, _server: Any, _session: Any, envelope: Any) -> str:  # noqa: N802
        time.sleep(self.slow)  # this server serves nobody else
        if self.data:
            return self.data.pop(0)
        self.ids.append(envelope.content.decode().partition("Message-ID: ")[2].partition("\r\n")[0])
        return "250 taken"


@contextmanager
def mail(box: Box) -> Iterator[str]:
    """A mail server; the URL of its channel."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = Controller(box, hostname="127.0.0.1", port=port)
    server.start()
    try:
        yield f"mailto://127.0.0.1:{port}?from=watch@example.org&to=pilot@example.org"
    finally:
        server.stop()


@contextmanager
def hook(answers: list[tuple[int, dict[str, str]]]) -> Iterator[tuple[str, list[float]]]:
    """A web hook that gives answers in turn, then 200; its URL and when each post came."""
    times: list[float] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            times.append(time.monotonic())
            self.rfile.read(int(self.headers["Content-Length"]))
            code, headers = answers.pop(0) if answers else (200, {})
            self.send_response(code)
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()

        def log_message(self, format: str, *args: Any) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    try:
        yield f"json://127.0.0.1:{server.server_address[1]}/", times
    finally:
        server.shutdown()
        server.server_close()


@pytest.fixture
def state(tmp_path: Path) -> Path:
    return tmp_path / "state.sqlite"


@contextmanager
def delivering(
    state: Path, urls: dict[str, str], clock: Callable[[], float] = time.time, delay: float = 0.05
) -> Iterator[tuple[Store, threading.Event]]:
    """A dispatcher with these channels, and the store whose outbox it empties."""
    with closing(Store.open(state)) as store:
        wake = threading.Event()
        channels = {name: Channel(name, url) for name, url in urls.items()}
        made = Dispatcher(lambda: Outbox(state), channels, clock, wake, lambda n, row: delay)
        made.start()
        try:
            yield store, wake
        finally:
            made.stop()


def post(
    store: Store, wake: threading.Event, *names: str, channel: str = "mail", incident: str = "i"
) -> None:
    for name in names:
        store.post(alert(name, incident=incident), [channel], time.time())
    wake.set()


def done(store: Store) -> bool:
    return not store.undelivered()


class TestMail:
    def test_greylisting_delays_and_loses_nothing(self, state: Path) -> None:
        box = Box(rcpt=("451 greylisted", "450 still greylisted"))
        with mail(box) as url, delivering(state, {"mail": url}) as (store, wake):
            post(store, wake, "a", "b")
            until(lambda: done(store), 10)
            assert len(box.ids) == 2 and store.refused(0.0) == []

    @pytest.mark.parametrize("box", [Box(rcpt=("550 no such user",)), Box(data=("554 not wanted",))])
    def test_a_refusal_for_good_holds_back_nothing_and_is_in_the_status(self, state: Path, box: Box) -> None:
        with mail(box) as url, delivering(state, {"mail": url}) as (store, wake):
            post(store, wake, "a", "b", "c")
            until(lambda: done(store), 10)
            assert len(box.ids) == 2
            (told,) = store.refused(0.0)
            assert told.alert == "a" and told.error.startswith("refused: ") and "55" in told.error

    def test_a_log_in_that_is_refused_is_tried_again(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """535 is for good too, but a password is mended, and no message may be lost by it."""
        box = Box()

        def refuse(*_: object, **__: object) -> None:
            raise smtplib.SMTPAuthenticationError(535, b"bad credentials")

        monkeypatch.setattr(smtplib.SMTP, "login", refuse)
        with mail(box) as url:
            channel = Channel("mail", url.replace("//", "//user:secret@"))
            with pytest.raises(DeliveryError, match="535") as failure:
                channel.send(alert())
        assert not failure.value.permanent

    def test_a_refusal_is_reported_over_the_others(self, state: Path) -> None:
        box = Box(rcpt=("550 no such user",))
        with (
            mail(box) as url,
            hook([]) as (web, posts),
            delivering(state, {"mail": url, "web": web}) as (store, wake),
        ):
            post(store, wake, "a")
            until(lambda: len(posts) == 1 and done(store), 10)
            report = store.alerts()[-1]
            assert "mail refuses" in report.title and "550 no such user" in report.body
            assert alert("a").title in report.body

    def test_down_for_hours_then_all_comes_in_order_and_soon(self, state: Path) -> None:
        """Six hours by the schedule of the dispatcher itself, the clock an argument."""
        box, now, store, begun = Box(), [0.0], Store.open(state), 0
        for name in ("a", "b", "c"):
            store.post(alert(name, incident="i"), ["mail"], 0.0)
        outbox = Outbox(state)
        while now[0] < 6 * HOUR:
            (row,) = outbox.due(now[0])
            begun += 1
            outbox.failed(row.id, "connection refused", now[0] + retry_delay(row.attempts + 1, row.id))
            assert outbox.due(now[0] + 4.0) == []
            now[0] += retry_delay(row.attempts + 1, row.id)
        assert 25 < begun < 35
        outbox.close()
        store.close()
        with mail(box) as url, delivering(state, {"mail": url}, lambda: now[0]) as (store, _):
            until(lambda: done(store), 10)
        assert len(box.ids) == len(set(box.ids)) == 3

    def test_no_dns_is_a_failure_and_no_end(self, state: Path) -> None:
        urls = {"mail": "mailto://nowhere.invalid:2525?from=a@example.org&to=b@example.org"}
        with delivering(state, urls | {"web": "json://nowhere.invalid/"}) as (store, wake):
            post(store, wake, "a")
            post(store, wake, "a", channel="web")
            until(lambda: all(u.attempts > 1 for u in store.undelivered()), 20)
            assert [u.channel for u in store.undelivered()] == ["mail", "web"]
            assert store.refused(0.0) == []


class TestHttp:
    def test_429_with_retry_after_and_500_are_tried_again(self, state: Path) -> None:
        answers = [(429, {"Retry-After": "1"}), (500, {}), (408, {})]
        with hook(answers) as (url, posts), delivering(state, {"web": url}) as (store, wake):
            post(store, wake, "a", "b", channel="web")
            until(lambda: done(store), 10)
            assert len(posts) == 5 and store.refused(0.0) == []

    @pytest.mark.parametrize("code", [400, 401, 403, 404, 410])
    def test_other_refusals_are_for_good(self, state: Path, code: int) -> None:
        with hook([(code, {})]) as (url, posts), delivering(state, {"web": url}) as (store, wake):
            post(store, wake, "a", "b", channel="web")
            until(lambda: done(store), 10)
            assert len(posts) == 2
            assert [(u.alert, str(code) in u.error) for u in store.refused(0.0)] == [("a", True)]


@pytest.mark.timing
def test_a_slow_channel_delays_no_other(state: Path) -> None:
    """Ten messages: on the slow channel 4 s each, on the quick one at once. Prints what it measured."""
    slow, quick = Box(slow=4.0), Box()
    with (
        mail(slow) as slowly,
        mail(quick) as quickly,
        delivering(state, {"slow": slowly, "quick": quickly}) as (store, wake),
    ):
        post(store, wake, "warm", channel="quick")
        until(lambda: len(quick.ids) == 1, 10)
        begun = time.monotonic()
        for name in "0123456789":
            store.post(alert(name, incident=name), ["slow", "quick"], 0.0)
        wake.set()
        until(lambda: len(quick.ids) == 11, 10)
        took = time.monotonic() - begun
        print(f"10 messages by the quick channel in {took:.2f} s, {len(slow.ids)} by the slow one")
        assert not slow.ids and took < 3.0


@pytest.mark.parametrize(("text", "why"), [("{", "damaged"), ("{}", "cannot read")])
def test_one_row_that_cannot_be_read_blocks_nothing(state: Path, text: str, why: str) -> None:
    with closing(Store.open(state)) as store, closing(Outbox(state)) as outbox:
        for name in "ab":
            store.post(alert(name, incident="i"), ["mail"], 0.0)
        store._db.execute("UPDATE alerts SET data = ? WHERE id = 'a'", (text,))
        assert outbox.due(1.0) == []  # the first is given up, the second of its thread comes next
        assert [row.alert.id for row in outbox.due(1.0)] == ["b"]
        (told,) = store.refused(0.0)
        assert told.alert == "a" and why in told.error


def test_messages_for_a_channel_that_was_taken_out_wait_and_come_when_it_is_back(
    state: Path, tmp_path: Path
) -> None:
    box = Box()
    with mail(box) as url:
        with delivering(state, {"other": url}) as (store, wake):
            post(store, wake, "a", channel="mail")
            until(lambda: any(u.error for u in store.undelivered()))
            post(store, wake, "b", channel="other", incident="x")
            until(lambda: len(box.ids) == 1 and len(store.undelivered()) == 1)
            (parked,) = store.undelivered()
            assert (parked.attempts, parked.channel) == (0, "mail")
            assert "no such channel any more" in parked.error
            config = tmp_path / "gliderwatch.yml"
            config.write_text(f"{{dockserver: {{roots: [{tmp_path}]}}, state: {{path: {state}}}}}", "utf-8")
            assert [u.error for u in overview(load(config)).undelivered] == [parked.error]
        with delivering(state, {"mail": url}) as (store, _):
            until(lambda: done(store), 10)
    assert len(box.ids) == 2


def test_a_channel_that_is_dead_for_an_hour_is_reported_over_the_others(state: Path, tmp_path: Path) -> None:
    config_path = tmp_path / "gliderwatch.yml"
    config_path.write_text(
        f"{{dockserver: {{roots: [{tmp_path}]}}, state: {{path: {state}}}, "
        "channels: {mail: {url: 'mailto://127.0.0.1:9?from=a@b.org&to=c@d.org'}, "
        "web: {url: 'json://127.0.0.1:9/'}}, "
        "recipients: {pilot: {channels: [mail, web]}}}",
        "utf-8",
    )
    config, now = load(config_path), time.time()
    with closing(Store.open(state)) as store, closing(Outbox(state)) as outbox:
        store.post(alert("a"), ["mail"], now)
        outbox.failed(outbox.due(now)[0].id, "connection refused", now + 5.0)
        watch = operator_alerts.Operator(store, state, config, now, 0.0)
        limits = operator_alerts.Settings(silent_hours=None, free_mb=None)
        assert watch.look(config, limits, now + 0.9 * HOUR, 0.0) == ()
        (report,) = watch.look(config, limits, now + 1.1 * HOUR, 0.0)
        assert "channel mail has not delivered" in report.title and "connection refused" in report.body
        assert {u.channel for u in store.undelivered() if u.alert == report.id} == {"web"}
        outbox.delivered(1, now + 1.2 * HOUR)
        (over,) = watch.look(config, limits, now + 1.3 * HOUR, 0.0)
        assert "does not fail any more" in over.title
