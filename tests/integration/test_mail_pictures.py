"""Pictures in mails: inside of the mail where they are there in time, and never what a mail waits for."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from alert_support import alert
from bad_pictures import misbehave
from gliderwatch.config import load
from gliderwatch.config.check import check
from gliderwatch.delivery.channels import Channel
from gliderwatch.delivery.mail import Envelope, Picture, compose
from gliderwatch.model import Alert
from gliderwatch.params import Attention
from gliderwatch.service.mail_pictures import HANGS, LIMIT, MailPictures
from integration.test_channels import Post
from integration.test_web import keep
from unit.test_pages import NOW, dive


@pytest.fixture
def post() -> Iterator[Post]:
    made = Post().start()
    yield made
    made.stop()


def drawing(folder: Path, *, limit: float = LIMIT, **options: object) -> MailPictures:
    state = folder / "state.sqlite"
    return MailPictures(state, lambda _: Attention(), lambda: NOW, limit=limit, **options)  # type: ignore[arg-type]


def sent(pictures: MailPictures, post: Post, message: Alert) -> float:
    """Send a message; how long it took (s)."""
    begun = time.monotonic()
    Channel("mail", post.url(), pictures, pictures=True).send(message)
    return time.monotonic() - begun


def test_a_mail_shows_speed_and_map_of_its_glider_whatever_went_wrong_before(
    tmp_path: Path, post: Post
) -> None:
    keep(tmp_path / "state.sqlite", "electa", tuple(dive(4.0 * k + 0.5) for k in (4, 3, 2, 1, 0)), ())
    pictures = drawing(tmp_path, draw=misbehave, limit=60.0)
    try:
        for glider in ("fails", "dies", "electa"):
            sent(pictures, post, replace(alert(glider), glider=glider))
        sent(pictures, post, replace(alert("operator"), glider=""))
    finally:
        pictures.stop()
    *without, mail, other = post.inbox.mails
    assert [len(list(each.walk())) for each in without] == [3, 3]
    html = mail.get_body(("html",))
    assert html is not None
    shown = {part["Content-ID"]: part for part in mail.walk() if part.get_content_type() == "image/png"}
    assert [part.get_filename() for part in shown.values()] == ["speed.png", "map.png"]
    for name, part in shown.items():
        assert f'<img src="cid:{name[1:-1]}" alt="' in html.get_content()
        assert part.get_content_disposition() == "inline"
        assert part.get_content().startswith(b"\x89PNG\r\n")
    assert mail.get_body(("plain",)).get_content() == other.get_body(("plain",)).get_content()  # type: ignore[union-attr]
    assert other.get_content_type() == "multipart/alternative" and len(list(other.walk())) == 3


def test_a_drawing_that_hangs_holds_up_no_mail(tmp_path: Path, post: Post) -> None:
    pictures = drawing(tmp_path, draw=misbehave, limit=0.3)
    try:
        waited = [sent(pictures, post, replace(alert(str(k)), glider="hangs")) for k in range(3)]
    finally:
        pictures.stop()
    assert [len(list(mail.walk())) for mail in post.inbox.mails] == [3, 3, 3]
    assert max(waited) < HANGS  # each waits for 0.3 s, besides for what the machine is busy with


def test_the_words_of_a_picture_are_no_markup() -> None:
    mail = compose(alert(), Envelope(("", "w@example.org"), ()), [Picture("a.png", '"> <b>&', b"\x89PNG")])
    html = mail.get_body(("html",))
    assert html is not None and 'alt="&quot;&gt; &lt;b&gt;&amp;"' in html.get_content()


def test_pictures_of_a_chat_are_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "gliderwatch.yml"
    path.write_text(
        f"dockserver: {{roots: [{tmp_path}]}}\nstate: {{path: {tmp_path}/state.sqlite}}\n"
        "channels:\n  chat:\n    url: json://localhost\n    pictures: true\n"
        "recipients: {all: {channels: [chat]}}\n"
    )
    found = [problem for problem in check(load(path), path) if "pictures" in problem.text]
    assert [problem.where for problem in found] == [f"{path}:6"]
