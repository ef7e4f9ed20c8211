"""What is read of a mail channel's URL, by way of Apprise."""

from __future__ import annotations

import apprise
import pytest

from gliderwatch.delivery.mail import Envelope, MailServer, mail_server


def read(url: str) -> MailServer:
    server = mail_server(apprise.Apprise.instantiate(url, asset=apprise.AppriseAsset(app_id="gliderwatch")))
    assert server is not None
    return server


@pytest.mark.parametrize(
    ("url", "place"),
    [
        ("mailto://localhost?from=a@b.org", ("localhost", 25, "insecure")),
        ("mailto://127.0.0.1:99?from=a@b.org", ("127.0.0.1", 99, "insecure")),
        ("mailtos://me:pw@smtp.b.org?from=a@b.org", ("smtp.b.org", 587, "starttls")),
        ("mailtos://me:pw@b.org?smtp=mail.b.org&mode=ssl", ("mail.b.org", 465, "ssl")),
        ("mailto://_?smtp=mail.b.org&from=a@b.org", ("mail.b.org", 25, "insecure")),
        ("mailtos://me:pw@gmail.com", ("smtp.gmail.com", 587, "starttls")),
    ],
)
def test_the_server(url: str, place: tuple[str, int, str]) -> None:
    server = read(url)
    assert (server.host, server.port, server.mode) == place


@pytest.mark.parametrize(
    ("url", "login"),
    [
        ("mailto://localhost?from=a@b.org", None),
        ("mailto://me@localhost", None),
        ("mailtos://me:p%40ss%2F%3A%25%23%3F@b.org", ("me", "p@ss/:%#?")),
        ("mailtos://me%40b.org:pw@smtp.b.org", ("me@b.org", "pw")),
        ("mailtos://me:pw@gmail.com", ("me@gmail.com", "pw")),  # Gmail wants the whole address
    ],
)
def test_the_login(url: str, login: tuple[str, str] | None) -> None:
    assert read(url).login == login


def test_a_login_is_not_printed() -> None:
    assert "hunter2" not in repr(read("mailtos://me:hunter2@b.org"))


def test_certificate_and_time_limit() -> None:
    usual, own = read("mailtos://me:pw@b.org"), read("mailtos://me:pw@b.org?verify=no&cto=0.3")
    assert (usual.verify, usual.timeout) == (True, 15.0)
    assert (own.verify, own.timeout) == (False, 0.3)


def test_all_the_people() -> None:
    server = read(
        "mailtos://me:pw@b.org/x@y.org/?from=W%C3%A4tch%20%3Cw@b.org%3E&to=J%C3%B6%20%3Cj@e.org%3E"
        "&cc=%22Do,%20E%22%20%3Cd@e.org%3E,c@e.org&bcc=q@r.org,b@s.org&reply=Re%20%3Cre@x.org%3E&%2BX-Ship=Pelagia"
    )
    assert server.envelope == Envelope(
        sender=("Wätch", "w@b.org"),
        to=[("", "x@y.org"), ("Jö", "j@e.org")],
        cc=[("", "c@e.org"), ("Do, E", "d@e.org")],
        bcc=["b@s.org", "q@r.org"],
        reply_to=[("Re", "re@x.org")],
        headers={"X-Ship": "Pelagia"},
    )


def test_who_writes_to_himself() -> None:
    envelope = read("mailtos://me:pw@b.org").envelope
    assert (envelope.sender, envelope.to) == (("gliderwatch", "me@b.org"), [("", "me@b.org")])
    assert read("mailtos://me:pw@b.org?from=The%20Watch").envelope.sender == ("The Watch", "me@b.org")


@pytest.mark.parametrize("url", ["json://localhost/path", "mailtos://me:pw@b.org?pgp=sign"])
def test_what_apprise_sends_itself(url: str) -> None:
    assert mail_server(apprise.Apprise.instantiate(url)) is None
