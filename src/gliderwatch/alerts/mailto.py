"""The server and the people of a mail channel, read from its `mailto:` URL.

Apprise reads the URL first: it knows the servers of common providers and which addresses are valid. What
it made of the URL is read here from its public interface alone: the complete URL that every service gives
of itself, its log-in and its time limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from email.header import decode_header, make_header
from email.utils import getaddresses, parseaddr
from typing import Literal, Protocol, cast
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from gliderwatch.alerts.mail import Envelope

Mode = Literal["insecure", "ssl", "starttls"]

_PORTS: Mapping[Mode, int] = {"insecure": 25, "ssl": 465, "starttls": 587}
"""Ports of mail submission (RFC 5321, RFC 8314), which Apprise leaves out of a URL."""


class Service(Protocol):
    """What is read of an Apprise service."""

    def url(self, privacy: bool = False) -> str:
        """The complete URL of the service, with its secrets."""
        ...

    @property
    def request_auth(self) -> tuple[str, str | None] | None:
        """User and password; None without a user."""
        ...

    @property
    def request_timeout(self) -> tuple[float, float]:
        """Seconds to wait for a connection, and for an answer."""
        ...


@dataclass(frozen=True, slots=True)
class MailServer:
    """Where mail is handed in, how, and between whom. ``timeout`` in s; the log-in is never printed."""

    host: str
    port: int
    mode: Mode
    verify: bool
    timeout: float
    envelope: Envelope
    login: tuple[str, str] | None = field(default=None, repr=False)


def mail_server(service: Service) -> MailServer | None:
    """The settings of a mail channel; None of another service, and of one with PGP: Apprise sends those."""
    url = urlsplit(service.url())
    query = dict(parse_qsl(url.query, keep_blank_values=True))
    if url.scheme not in {"mailto", "mailtos"} or query.get("pgp", "no") != "no":
        return None
    mode = cast(Mode, query.get("mode", "insecure"))
    host = url.netloc.rpartition("@")[2]
    if url.port is not None:
        host = host.rpartition(":")[0]
    user, password = service.request_auth or ("", None)
    return MailServer(
        host=query.get("smtp", host),
        port=url.port or _PORTS[mode],
        mode=mode,
        verify=query.get("verify", "yes") == "yes",
        timeout=service.request_timeout[0],
        envelope=_envelope(url, query, host),
        login=(user, password) if user and password else None,
    )


def _envelope(url: SplitResult, query: Mapping[str, str], host: str) -> Envelope:
    """Who writes to whom."""
    sender = _sender(query.get("from", ""), f"{unquote(url.username or '')}@{host}")
    targets = [unquote(part).rpartition(":") for part in url.path.split("/") if part]
    return Envelope(
        sender=sender,
        to=[(name, address) for name, _, address in targets] or [("", sender[1])],
        cc=_people(query.get("cc", "")),
        bcc=sorted(address for _, address in _people(query.get("bcc", ""))),
        reply_to=_people(query.get("reply", "")),
        headers={key[1:]: value for key, value in query.items() if key.startswith("+")},
    )


def _sender(given: str, otherwise: str) -> tuple[str, str]:
    """Name and address of who writes; ``given`` may be a name alone."""
    name, address = parseaddr(given)
    if "@" not in address:
        return given or "gliderwatch", otherwise
    return str(make_header(decode_header(name))) or "gliderwatch", address


def _people(text: str) -> list[tuple[str, str]]:
    """Names and addresses of a list with commas, by address."""
    return sorted(((name, address) for name, address in getaddresses([text]) if address), key=lambda p: p[1])
