"""An alert as an email, one thread an incident, and its way to the mail server."""

from __future__ import annotations

import smtplib
import socket
import ssl
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from email.errors import MessageError
from email.header import decode_header, make_header
from email.headerregistry import Address
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import formatdate, getaddresses, parseaddr
from hashlib import sha256
from typing import Literal, Protocol, cast
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from gliderwatch.errors import GliderwatchError
from gliderwatch.messages.template import with_pictures
from gliderwatch.model import Alert

# ----------------------------------------
# An alert as an email: text and HTML, one thread an incident. Pure but for the date it is sent.
#
# Apprise makes its own text part out of the HTML and always adds a Message-ID of its own, so that
# a thread cannot be built with it (a second Message-ID is refused by large providers). The mail is
# therefore composed here and sent by `smtp`, with the server and people that `mailto` reads.


@dataclass(frozen=True, slots=True)
class Envelope:
    """Who writes to whom; people are (name, address), the name may be empty."""

    sender: tuple[str, str]
    to: Sequence[tuple[str, str]]
    cc: Sequence[tuple[str, str]] = ()
    bcc: Sequence[str] = ()
    reply_to: Sequence[tuple[str, str]] = ()
    headers: Mapping[str, str] = field(default_factory=dict)

    @property
    def recipients(self) -> tuple[str, ...]:
        """Every address the server is asked to deliver to, each once."""
        people = [address for _, address in (*self.to, *self.cc)]
        return tuple(dict.fromkeys([*people, *self.bcc]))


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture in a mail: the name of its file, what it shows in words, and the PNG."""

    name: str
    shows: str
    png: bytes = field(repr=False)


def message_id(key: str, sender: str) -> str:
    """The Message-ID of an alert, or the root of an incident's thread: the same for the same key.

    A message sent twice carries one identity, so that mail systems that look for duplicates drop it.
    """
    domain = sender.rpartition("@")[2].encode("idna").decode("ascii") or "localhost"
    return f"<{sha256(key.encode('utf-8', 'replace')).hexdigest()[:32]}.gliderwatch@{domain}>"


def compose(alert: Alert, envelope: Envelope, pictures: Sequence[Picture] = ()) -> EmailMessage:
    """The message with text and HTML as alternatives, and ``pictures`` in the HTML.

    Every message of an incident refers to one root, made of the incident's id: the alert with that
    very id where there is one, else a message that never existed, which mail clients thread by as well.
    """
    mail = EmailMessage(policy=SMTP)
    mail["Subject"] = alert.title
    mail["From"] = _person(*envelope.sender)
    mail["To"] = [_person(*person) for person in envelope.to]
    if envelope.cc:
        mail["Cc"] = [_person(*person) for person in envelope.cc]
    if envelope.reply_to:
        mail["Reply-To"] = [_person(*person) for person in envelope.reply_to]
    mail["Date"] = formatdate()
    mail["Message-ID"] = own = message_id(alert.id, envelope.sender[1])
    root = message_id(alert.incident, envelope.sender[1]) if alert.incident else own
    if root != own:
        mail["In-Reply-To"] = root
        mail["References"] = root
    mail["Auto-Submitted"] = "auto-generated"  # keeps holiday replies from answering
    for name, value in envelope.headers.items():
        if name not in mail:
            mail[name] = value
    mail.set_content(alert.body, cte="quoted-printable")
    names = [(f"{picture.name}.{own[1:17]}@gliderwatch", picture) for picture in pictures]  # never folded
    html = with_pictures(alert.html, [(f"cid:{name}", picture.shows) for name, picture in names])
    mail.add_alternative(html, subtype="html", cte="quoted-printable")
    part = cast(EmailMessage, mail.get_body(("html",)))
    for name, picture in names:
        part.add_related(
            picture.png, "image", "png", cid=f"<{name}>", filename=picture.name, disposition="inline"
        )
    return mail


def _person(name: str, address: str) -> Address:
    return Address(display_name=name or "", addr_spec=address)


# ----------------------------------------
# The server and the people of a mail channel, read from its `mailto:` URL.
#
# Apprise reads the URL first: it knows the servers of common providers and which addresses are valid. What
# it made of the URL is read here from its public interface alone: the complete URL that every service gives
# of itself, its log-in and its time limits.

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


# ----------------------------------------
# Handing a mail to its server.

_LOGGED_IN, _GO_ON = 235, 334
"""Answers to AUTH (RFC 4954, section 4)."""


class DeliveryError(GliderwatchError):
    """A message was not surely delivered. The text holds no secret of the channel's URL.

    ``permanent``: the same message would be refused again, however often it is tried; ``partly``: other
    addresses of the channel took it.
    """

    def __init__(self, text: str, *, permanent: bool = False, partly: bool = False) -> None:
        super().__init__(text)
        self.permanent, self.partly = permanent, partly


def submit(
    server: MailServer, alert: Alert, recipients: list[str], pictures: Sequence[Picture] = ()
) -> dict[str, tuple[int, bytes]]:
    """Hand the mail to the server; returns who was refused. Raises DeliveryError when nobody was served."""
    try:
        mail = compose(alert, server.envelope, pictures)
    except (ValueError, MessageError) as error:
        raise DeliveryError(f"cannot be written as a mail: {error}", permanent=True) from None
    with _session(server) as smtp:
        try:
            return smtp.send_message(mail, server.envelope.sender[1], recipients)
        except smtplib.SMTPRecipientsRefused as error:
            return error.recipients


def reach(server: MailServer) -> None:
    """Connect to the server and log in, and send nothing. Raises DeliveryError where that cannot be done."""
    with _session(server):
        pass


@contextmanager
def _session(server: MailServer) -> Iterator[smtplib.SMTP]:
    """A connection; what goes wrong with it inside is raised as DeliveryError."""
    name = f"mail server {server.host}:{server.port}"
    try:
        smtp = _connect(server)
        try:
            yield smtp
        finally:
            # once the server took the message, a lost goodbye must not send it again
            with suppress(OSError, smtplib.SMTPException):
                smtp.quit()
            smtp.close()
    except smtplib.SMTPDataError as error:
        reason = f"{name}: {error.smtp_code} {_decode(error.smtp_error)}"
        raise DeliveryError(reason, permanent=is_permanent(error.smtp_code)) from None
    except smtplib.SMTPResponseException as error:  # of the log-in or the sender: that can be mended
        raise DeliveryError(f"{name}: {error.smtp_code} {_decode(error.smtp_error)}") from None
    except (OSError, smtplib.SMTPException, ValueError, MessageError) as error:
        raise DeliveryError(f"{name}: {str(error) or type(error).__name__}") from None


def _connect(server: MailServer) -> smtplib.SMTP:
    """A connection as the URL asks for it, logged in."""
    context = ssl.create_default_context()
    if not server.verify:
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    name = socket.gethostname()  # without it smtplib asks the DNS for our own name, which may hang
    if server.mode == "ssl":
        smtp: smtplib.SMTP = smtplib.SMTP_SSL(
            server.host, server.port, name, timeout=server.timeout, context=context
        )
    else:
        smtp = smtplib.SMTP(server.host, server.port, name, timeout=server.timeout)
    try:
        if server.mode == "starttls":
            smtp.starttls(context=context)
        if server.login is not None:
            _log_in(smtp, *server.login)
    except BaseException:
        smtp.close()
        raise
    return smtp


def _log_in(smtp: smtplib.SMTP, user: str, password: str) -> None:
    """Log in; user and password are sent as UTF-8 (RFC 4616, section 2), where smtplib sends ASCII alone."""
    if (user + password).isascii():
        smtp.login(user, password)
        return
    smtp.ehlo_or_helo_if_needed()
    offered = smtp.esmtp_features.get("auth", "").upper().split()
    if "PLAIN" in offered:
        code, answer = smtp.docmd("AUTH", "PLAIN " + _base64(f"\0{user}\0{password}"))
    elif "LOGIN" in offered:
        code, answer = smtp.docmd("AUTH", "LOGIN " + _base64(user))
        if code == _GO_ON:
            code, answer = smtp.docmd(_base64(password))
    else:
        raise smtplib.SMTPNotSupportedError(
            "it takes no password with letters beyond ASCII (no AUTH PLAIN or LOGIN): use another password"
        )
    if code != _LOGGED_IN:
        raise smtplib.SMTPAuthenticationError(code, answer)


def _base64(text: str) -> str:
    return b64encode(text.encode("utf-8")).decode("ascii")


def is_permanent(code: int) -> bool:
    """Whether an answer of a mail server is for good (RFC 5321, 4.2.1)."""
    return 500 <= code < 600


def first(refused: dict[str, tuple[int, bytes]]) -> str:
    """The first of the answers, as text."""
    code, text = next(iter(refused.values()))
    return f"{code} {_decode(text)}"


def _decode(text: bytes | str) -> str:
    return " ".join((text.decode("utf-8", "replace") if isinstance(text, bytes) else text).split())
