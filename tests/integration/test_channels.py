"""Channels on real servers of this machine: SMTP (aiosmtpd) and HTTP, up, down, refusing and slow."""

import email
import email.policy
import json
import logging
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from email.message import EmailMessage
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from subprocess import run
from sys import executable
from typing import Any, cast
from urllib.parse import quote

import pytest
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import SMTP, AuthResult, Envelope, LoginPassword, Session
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

import written
from alert_support import DISAGREE, SLOW, MemoryStore, alert, incident, until
from gliderwatch.cli.tables import show_alert
from gliderwatch.delivery.channels import Channel, DeliveryError, problem, scrub
from gliderwatch.delivery.dispatcher import Dispatcher
from gliderwatch.delivery.mail import message_id
from gliderwatch.model import Alert, Kind, Severity

PASSWORD = "s3cr3t-hunter2"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Inbox:
    """An SMTP handler that keeps what it takes, refuses recipients named in `refuse`, or everything."""

    def __init__(self) -> None:
        self.mails: list[EmailMessage] = []
        self.recipients: list[list[str]] = []
        self.refuse: set[str] = set()
        self.refusal = "550 no such user"
        self.answer = "250 taken"

    async def handle_RCPT(  # noqa: N802
        self, server: SMTP, session: Session, envelope: Envelope, address: str, options: list[str]
    ) -> str:
        if address in self.refuse:
            return f"{self.refusal} {address}"
        envelope.rcpt_tos.append(address)
        return "250 fine"

    async def handle_DATA(self, server: SMTP, session: Session, envelope: Envelope) -> str:  # noqa: N802
        if self.answer.startswith("250"):
            mail = email.message_from_bytes(cast(bytes, envelope.content), policy=email.policy.default)
            self.mails.append(cast(EmailMessage, mail))
            self.recipients.append(list(envelope.rcpt_tos))
        return self.answer


class Post:
    """A local SMTP server that can be started and stopped."""

    def __init__(self, **options: Any) -> None:
        self.inbox = Inbox()
        self.port = free_port()
        self._options = options
        self._controller: Controller | None = None

    def start(self) -> "Post":
        self._controller = Controller(self.inbox, hostname="127.0.0.1", port=self.port, **self._options)
        self._controller.start()
        return self

    def stop(self) -> None:
        if self._controller is not None:
            self._controller.stop()
            self._controller = None

    def url(self, to: str = "pilot@example.org", login: str = "", extra: str = "") -> str:
        return f"mailto://{login}localhost:{self.port}?smtp=127.0.0.1&from=watch@example.org&to={to}{extra}"


@pytest.fixture
def post() -> Iterator[Post]:
    made = Post().start()
    yield made
    made.stop()


class Hook:
    """A local HTTP server that keeps what is posted to it and answers as told."""

    def __init__(self) -> None:
        self.posts: list[tuple[str, dict[str, Any]]] = []
        self.answers: list[int] = []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                code = outer.answers.pop(0) if outer.answers else 200
                if code == 200:
                    outer.posts.append((self.path, json.loads(body)))
                self.send_response(code)
                self.end_headers()
                self.wfile.write(b"ok")

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self._server = HTTPServer(("127.0.0.1", 0), Handler)
        self.port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def hook() -> Iterator[Hook]:
    made = Hook()
    yield made
    made.close()


SLACK = "slack://T1JJ3T3L2/A1BRTD4JD/TIiajkdnlazkcOXrIdevi7FQ"


@pytest.fixture
def slack(hook: Hook, monkeypatch: pytest.MonkeyPatch) -> Hook:
    from apprise.plugins.slack import NotifySlack

    monkeypatch.setattr(NotifySlack, "webhook_url", f"http://127.0.0.1:{hook.port}/services")
    monkeypatch.setattr(NotifySlack, "request_rate_per_sec", 0)
    return hook


class TestMail:
    def test_text_and_html_as_alternatives_in_utf_8(self, post: Post) -> None:
        made = written.opened(incident(), SLOW, alert_id="a1", audience=Severity.CRITICAL)
        Channel("mail", post.url()).send(made)
        (mail,) = post.inbox.mails
        assert mail.get_content_type() == "multipart/alternative"
        plain, html = cast(list[EmailMessage], list(mail.iter_parts()))
        assert plain.get_content_type() == "text/plain"
        assert plain.get_content().replace("\r\n", "\n").rstrip() == made.body.rstrip()
        assert html.get_content_type() == "text/html"
        assert html.get_content().replace("\r\n", "\n").rstrip() == made.html.rstrip()
        assert "041° true" in plain.get_content()
        assert mail["Subject"] == made.title
        assert mail["From"] == "gliderwatch <watch@example.org>"
        assert mail["To"] == "pilot@example.org"
        assert mail["Auto-Submitted"] == "auto-generated"
        assert mail["Date"]

    def test_one_incident_is_one_thread(self, post: Post) -> None:
        channel = Channel("mail", post.url())
        for name in ("a1", "a2", "a3"):
            channel.send(alert(name))
        channel.send(alert("other", incident="another"))
        ids = [mail.get_all("Message-ID") for mail in post.inbox.mails]
        assert ids == [[message_id(name, "watch@example.org")] for name in ("a1", "a2", "a3", "other")]
        roots = [mail["References"] for mail in post.inbox.mails]
        assert roots == [mail["In-Reply-To"] for mail in post.inbox.mails]
        assert len(set(roots[:3])) == 1
        assert roots[0] == message_id("electa/anomaly/1667639520", "watch@example.org")
        assert roots[3] != roots[0]

    def test_an_alert_named_as_its_incident_is_the_root(self, post: Post) -> None:
        channel = Channel("mail", post.url())
        channel.send(alert("i1", incident="i1"))
        channel.send(alert("a2", incident="i1"))
        first, second = post.inbox.mails
        assert first["References"] is None
        assert second["References"] == first["Message-ID"]

    def test_a_notice_stands_alone(self, post: Post) -> None:
        Channel("mail", post.url()).send(alert("s", incident="", kind=Kind.SURFACING))
        assert post.inbox.mails[0]["References"] is None

    def test_the_same_alert_has_the_same_identity_on_any_channel_and_day(self, post: Post) -> None:
        for to in ("a@example.org", "b@example.org"):
            Channel(to, post.url(to)).send(alert("a1"))
        first, second = (mail["Message-ID"] for mail in post.inbox.mails)
        assert first == second
        assert message_id("a1", "watch@example.org") == message_id("a1", "other@example.org")

    def test_everybody_gets_it_and_own_headers_are_kept(self, post: Post) -> None:
        url = post.url(
            "a@example.org,b@example.org", extra="&cc=c@example.org&bcc=d@example.org&%2BX-Ship=Pelagia"
        )
        Channel("mail", url).send(alert())
        assert sorted(post.inbox.recipients[0]) == [f"{x}@example.org" for x in "abcd"]
        mail = post.inbox.mails[0]
        assert (mail["Cc"], mail["Bcc"], mail["X-Ship"]) == ("c@example.org", None, "Pelagia")

    def test_whoever_accepted_is_not_sent_it_again(self, post: Post) -> None:
        channel = Channel("mail", post.url("a@example.org,b@example.org"))
        post.inbox.refuse, post.inbox.refusal = {"b@example.org"}, "451 greylisted, come back later"
        with pytest.raises(DeliveryError, match="refused 1 of 2 recipients for now: 451") as failure:
            channel.send(alert())
        assert not failure.value.permanent
        post.inbox.refuse = set()
        channel.send(alert())
        assert post.inbox.recipients == [["a@example.org"], ["b@example.org"]]

    def test_all_refused(self, post: Post) -> None:
        post.inbox.refuse = {"pilot@example.org"}
        with pytest.raises(DeliveryError, match=r"^mail server refused 1 of 1 recipients: 550"):
            Channel("mail", post.url()).send(alert())
        assert post.inbox.mails == []

    def test_one_of_two_refused(self, post: Post) -> None:
        post.inbox.refuse = {"b@example.org"}
        with pytest.raises(DeliveryError, match=r"^only some took it: .*refused 1 of 2 recipients: 550"):
            Channel("mail", post.url("a@example.org,b@example.org")).send(alert())

    def test_server_says_later(self, post: Post) -> None:
        post.inbox.answer = "451 try again later"
        with pytest.raises(DeliveryError, match=r"127\.0\.0\.1:\d+: 451 try again later"):
            Channel("mail", post.url()).send(alert())

    def test_server_is_down(self) -> None:
        with pytest.raises(DeliveryError, match="refused"):
            Channel("mail", Post().url()).send(alert())

    @pytest.mark.timing
    def test_server_that_says_nothing_is_left_in_time(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as silent:
            url = (
                f"mailto://localhost:{silent.getsockname()[1]}?smtp=127.0.0.1&from=a@b.org&to=c@d.org&cto=0.3"
            )
            begun = time.monotonic()
            with pytest.raises(DeliveryError, match="timed out"):
                Channel("mail", url).send(alert())
            assert time.monotonic() - begun < 5

    def test_login(self, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]) -> None:
        def check(
            server: SMTP, session: Session, envelope: Envelope, mechanism: str, data: Any
        ) -> AuthResult:
            right = isinstance(data, LoginPassword) and data.password == PASSWORD.encode()
            return AuthResult(success=right, handled=False)

        made = Post(auth_require_tls=False, authenticator=check, auth_required=True).start()
        try:
            Channel("mail", made.url(login=f"watch:{PASSWORD}@")).send(alert())
            assert len(made.inbox.mails) == 1
            caplog.set_level(logging.DEBUG)
            with pytest.raises(DeliveryError, match="535") as caught:
                Channel("mail", made.url(login=f"watch:{PASSWORD}-wrong@")).send(alert())
        finally:
            made.stop()
        assert PASSWORD not in str(caught.value) + caplog.text + "".join(capfd.readouterr())

    @pytest.mark.parametrize("offered", ["PLAIN", "LOGIN", "both"])
    @pytest.mark.parametrize("name", ["watch", "Wächter"])
    def test_login_with_letters_beyond_ascii(self, offered: str, name: str) -> None:
        secret, seen = "Pässwort €5 密", []

        def check(
            server: SMTP, session: Session, envelope: Envelope, mechanism: str, data: Any
        ) -> AuthResult:
            seen.append(mechanism)
            right = data == LoginPassword(name.encode("utf-8"), secret.encode("utf-8"))
            return AuthResult(success=right, handled=False)

        hidden = {"PLAIN": ["LOGIN"], "LOGIN": ["PLAIN"], "both": []}[offered]
        made = Post(
            auth_require_tls=False, authenticator=check, auth_required=True, auth_exclude_mechanism=hidden
        ).start()
        try:
            login = f"{quote(name)}:{quote(secret)}@"
            Channel("mail", made.url(login=login)).send(alert())
            assert len(made.inbox.mails) == 1
            assert seen == ["PLAIN" if offered == "both" else offered]
            with pytest.raises(DeliveryError, match="535") as caught:
                Channel("mail", made.url(login=login.replace("@", "x@"))).send(alert())
        finally:
            made.stop()
        assert secret not in str(caught.value)

    def test_a_title_cannot_add_headers(self, post: Post) -> None:
        with pytest.raises(DeliveryError):
            Channel("mail", post.url()).send(alert(title="x\r\nBcc: thief@example.org"))
        assert post.inbox.mails == []


class TestHttp:
    def test_json_webhook(self, hook: Hook) -> None:
        Channel("hook", f"json://127.0.0.1:{hook.port}/alerts/").send(alert())
        ((path, payload),) = hook.posts
        assert path == "/alerts/"
        assert payload["title"] == alert().title
        assert "041° true & <more>" in payload["message"]
        assert payload["type"] == "failure"

    def test_slack_gets_what_a_chat_shows_in_its_own_markup(self, slack: Hook) -> None:
        made = written.opened(incident(), SLOW, alert_id="a", audience=Severity.CRITICAL)
        lead, rest = made.brief.split("\n", 1)
        evil = replace(
            made, title=made.title + " <!channel> &", brief=f"{lead} <!here|x> <http://e.org|y> & *b*\n{rest}"
        )
        Channel("slack", SLACK).send(evil)
        ((path, payload),) = slack.posts
        assert path == "/services/T1JJ3T3L2/A1BRTD4JD/TIiajkdnlazkcOXrIdevi7FQ"
        (attachment,) = payload["attachments"]
        text = attachment["text"]
        assert attachment["title"] == made.title + " &lt;!channel&gt; &amp;"
        assert text.startswith("electa is slow since") and "*What to do*" in text
        assert "<https://www.openstreetmap.org/?mlat=24.20575&amp;mlon=" in text and "|Map>" in text
        assert "<!" not in text and "<http://e.org" not in text
        assert "In symbols" not in text and "Last speeds" not in text

    @pytest.mark.parametrize("code", [429, 500, 503, 404])
    def test_anything_but_success_is_a_failure(self, hook: Hook, code: int) -> None:
        hook.answers = [code]
        channel = Channel("hook", f"json://127.0.0.1:{hook.port}/alerts/")
        with pytest.raises(DeliveryError, match=str(code)):
            channel.send(alert())
        channel.send(alert())
        assert len(hook.posts) == 1

    def test_optional_in_the_url_makes_no_success_of_a_failure(self, hook: Hook) -> None:
        hook.answers = [500]
        with pytest.raises(DeliveryError, match="500"):
            Channel("hook", f"json://127.0.0.1:{hook.port}/?optional=yes").send(alert())

    def test_slack_that_is_refused(self, slack: Hook, caplog: pytest.LogCaptureFixture) -> None:
        caplog.set_level(logging.DEBUG)
        slack.answers = [403]
        with pytest.raises(DeliveryError, match="403") as caught:
            Channel("slack", SLACK).send(alert())
        text = str(caught.value) + caplog.text
        for token in ("T1JJ3T3L2", "A1BRTD4JD", "TIiajkdnlazkcOXrIdevi7FQ"):
            assert token not in text

    def test_a_service_with_little_room_gets_the_beginning(
        self, hook: Hook, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from apprise.plugins.custom_json import NotifyJSON

        monkeypatch.setattr(NotifyJSON, "body_maxlen", 200)
        made = written.opened(incident(DISAGREE), DISAGREE, alert_id="a", audience=Severity.CRITICAL)
        Channel("hook", f"json://127.0.0.1:{hook.port}/").send(made)
        ((_, payload),) = hook.posts
        assert len(payload["message"]) <= 200
        assert payload["message"].startswith(made.body[:100])


class TestWithDispatcher:
    def deliver(self, store: MemoryStore, channels: dict[str, Channel]) -> tuple[Dispatcher, threading.Event]:
        wake = threading.Event()
        made = Dispatcher(store.open, channels, time.time, wake, delay=lambda attempts, row: 0.05)
        made.start()
        return made, wake

    @pytest.mark.timing
    def test_mail_arrives_within_a_second_of_the_commit(self, post: Post) -> None:
        store = MemoryStore()
        dispatcher, wake = self.deliver(store, {"mail": Channel("mail", post.url())})
        try:
            store.add(alert("first", incident=""), "mail")
            wake.set()
            until(lambda: len(post.inbox.mails) == 1)
            spans = []
            for i in range(10):
                begun = time.monotonic()
                store.add(alert(f"a{i}", incident=""), "mail")
                wake.set()
                until(lambda count=i + 2: len(post.inbox.mails) == count)  # type: ignore[misc]
                spans.append(time.monotonic() - begun)
            assert sorted(spans)[5] < 0.5
        finally:
            dispatcher.stop()

    def test_down_and_up_again_delivers_each_once_and_in_order(self) -> None:
        post, store = Post(), MemoryStore()
        rows = [store.add(alert(f"a{i}"), "mail") for i in range(3)]
        dispatcher, wake = self.deliver(store, {"mail": Channel("mail", post.url())})
        try:
            until(lambda: len(store.errors) >= 2)
            post.start()
            until(lambda: len(store.done) == 3)
            wake.set()
        finally:
            dispatcher.stop()
            post.stop()
        sent = [mail["Message-ID"] for mail in post.inbox.mails]
        assert sent == [message_id(f"a{i}", "watch@example.org") for i in range(3)]
        assert store.marked == rows

    @pytest.mark.timing
    def test_a_dead_webhook_does_not_delay_the_mail(self, post: Post) -> None:
        store = MemoryStore()
        with socket.create_server(("127.0.0.1", 0)) as silent:
            channels = {
                "dead": Channel("dead", f"json://127.0.0.1:{silent.getsockname()[1]}/?rto=3"),
                "mail": Channel("mail", post.url()),
            }
            for i in range(3):
                for name in channels:
                    store.add(alert(f"a{i}"), name)
            dispatcher, _ = self.deliver(store, channels)
            try:
                until(lambda: len(post.inbox.mails) == 3, 2.5)
                assert len(store.done) <= 3
            finally:
                begun = time.monotonic()
                dispatcher.stop(2.0)
                assert time.monotonic() - begun < 2.2

    def test_too_many_requests_is_tried_again(self, hook: Hook) -> None:
        hook.answers = [429, 500]
        store = MemoryStore()
        row = store.add(alert(), "hook")
        dispatcher, _ = self.deliver(store, {"hook": Channel("hook", f"json://127.0.0.1:{hook.port}/")})
        try:
            until(lambda: row in store.done)
        finally:
            dispatcher.stop()
        assert len(hook.posts) == 1
        assert [("429" in error, "500" in error) for _, error, _ in store.errors] == [
            (True, False),
            (False, True),
        ]


class TestUrls:
    @pytest.mark.parametrize(
        "url",
        [
            "mailto://localhost:2525?smtp=127.0.0.1&from=a@b.org&to=c@d.org",
            f"mailtos://watch:{PASSWORD}@example.org?smtp=mail.example.org&to=pilot@example.org",
            SLACK,
            "json://localhost:8080/path",
        ],
    )
    def test_good_ones_have_no_problem(self, url: str) -> None:
        assert problem(url) is None

    @pytest.mark.parametrize(
        "url",
        [
            "",
            "nonsense",
            "nosuchservice://a/b",
            "slack://T1/B2",
            f"mailto://watch:{PASSWORD}@example.org?from=not an address&to=pilot@example.org&mode=what",
            f"mailto://watch:{PASSWORD}@example.org?to=no-address",
            "mailto://",
            "mailto://localhost",
            "mailto://127.0.0.1:25?smtp=localhost&cc=pilot@example.org",
        ],
    )
    def test_bad_ones_say_so_without_their_secrets(self, url: str) -> None:
        found = problem(url)
        assert found is not None
        assert PASSWORD not in found
        with pytest.raises(DeliveryError) as caught:
            Channel("x", url).send(alert())
        assert PASSWORD not in str(caught.value)

    @pytest.mark.parametrize("wrong", ["nonsense", "co-pilot@", "co-pilot at example.org"])
    def test_an_address_that_is_none_is_told_and_the_others_get_their_mail(
        self, post: Post, wrong: str
    ) -> None:
        url = post.url(f"Pilot <pilot@example.org>,{wrong}".replace(" ", "%20"))
        assert problem(url) == f"{wrong!r} is no mail address"
        Channel("mail", url).send(alert())
        assert post.inbox.recipients == [["pilot@example.org"]]
        assert post.inbox.mails[0]["To"] == "Pilot <pilot@example.org>"

    token = st.text(
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_", min_size=8, max_size=30
    )

    @given(user=token, password=token, path=token, key=token)
    @settings(max_examples=50)
    def test_scrub_leaves_no_secret(self, user: str, password: str, path: str, key: str) -> None:
        url = f"json://{user}:{password}@hook.example.org:8080/{path}/?secret={key}&cto=5"
        text = scrub(f"POST {url} failed: {password} {key.upper()} at hook.example.org", url)
        for secret in (user, password, path, key):
            assert secret.lower() not in text.lower()
        assert "hook.example.org" in text

    def test_scrub_knows_quoted_forms_and_tokens_in_the_place_of_a_host(self) -> None:
        assert "p@ss word" not in scrub("login p@ss word", "mailto://u:p%40ss%20word@example.org")
        assert "T1JJ3T3L2" not in scrub("bad token t1jj3t3l2 T1JJ3T3L2", SLACK)

    def test_a_channel_does_not_print_its_url(self) -> None:
        assert PASSWORD not in repr(Channel("mail", f"mailto://watch:{PASSWORD}@example.org"))


def test_apprise_is_loaded_only_when_used() -> None:
    code = "import gliderwatch.delivery.dispatcher, sys; sys.exit('apprise' in sys.modules)"
    assert run([executable, "-c", code], check=False, timeout=60).returncode == 0


def test_lines_of_apprise_and_its_http_client_go_nowhere() -> None:
    code = f"""
import logging
from gliderwatch.delivery.channels import Channel
Channel("x", "{SLACK}").prepare()
for setup in (lambda: None, lambda: logging.basicConfig(level=logging.DEBUG)):
    setup()
    for name in ("apprise", "urllib3.connectionpool"):
        logging.getLogger(name).warning("POST /services/T1JJ3T3L2")
"""
    done = run([executable, "-c", code], check=True, timeout=60, capture_output=True, text=True)
    assert done.stdout + done.stderr == ""


def test_show_prints_title_place_and_speed_and_takes_brackets_as_they_are(tmp_path: Path) -> None:
    made: Alert = written.opened(incident(SLOW), SLOW, alert_id="a", audience=Severity.CRITICAL)
    path = tmp_path / "out.txt"
    with path.open("w") as file:
        show_alert(alert(title="[red]x[/red] [/oops]", body=made.body), Console(file=file, width=100))
        show_alert(made, Console(file=file, width=100))
    text = path.read_text()
    assert "[red]x[/red] [/oops]" in text
    assert made.title in text
    assert "24° 12.345' N" in text
    assert "Check" not in text
