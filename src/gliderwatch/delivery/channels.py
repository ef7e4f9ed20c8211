"""Channels: one Apprise URL each, one message at a time, and nothing but a clear success counts.

Apprise is imported on first use and never at import of this module: it takes a fifth of a second and
35 MB, which `gliderwatch status` need not spend.
"""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Sequence
from typing import Any, Protocol
from urllib.parse import parse_qs, unquote, urlsplit

from gliderwatch.delivery.mail import (
    DeliveryError,
    MailServer,
    Picture,
    first,
    is_permanent,
    mail_server,
    reach,
    submit,
)
from gliderwatch.messages.template import chat_html
from gliderwatch.model import Alert, Kind, Severity

__all__ = ["Channel", "DeliveryError", "problem", "scrub"]

READ_TIMEOUT = 15.0
"""Seconds to wait for an answer where the URL does not say (``rto=``): a message taken but not
confirmed in time is sent again, so that Apprise's 4 s would make duplicates at a slow service."""

HIDDEN = "***"
_NOBODY = "the URL names nobody to send to: add ?to=ADDRESS, or &to=ADDRESS after other settings"

_HTTP_ERROR = re.compile(r"\berror=(\d{3})\b")
"""How Apprise tells the status of an answer in its log."""
_PASSING = frozenset({408, 425, 429})
"""Answers of a web server to a request that may be good later; the other 4xx are for good."""

OPEN_KEYS = frozenset(
    {"smtp", "mode", "from", "to", "cc", "name", "format", "overflow", "cto", "rto", "verify"}
)
"""Keys of a URL's query whose values are no secrets and tell what failed."""


_LIVE = re.compile(r"@(?=\w)|\](?=\()")
"""Where a name from a file could begin a mention or a link, in services that read every text as Markdown."""


class Illustrator(Protocol):
    """Who draws the pictures of mails (`service.mail_pictures`)."""

    def prepare(self) -> None:
        """Load what the first picture would otherwise wait for."""
        ...

    def of(self, alert: Alert) -> Sequence[Picture]:
        """The pictures of a message, soon; raises nothing."""
        ...


class Channel:
    """One way to reach people, by its URL and the options of its section in the configuration, with
    ``pictures`` by an `illustrator`. Not for use by several threads at once."""

    def __init__(
        self, name: str, url: str, illustrator: Illustrator | None = None, *, pictures: bool = False
    ) -> None:
        self.name = name
        self._settings = url, pictures
        self._url = url
        self._illustrator = illustrator if pictures else None
        self._service: Any = None
        self._mail: MailServer | None = None
        self._accepted: dict[str, set[str]] = {}
        self._refused: dict[str, dict[str, tuple[int, bytes]]] = {}

    def __repr__(self) -> str:
        return f"Channel({self.name!r})"

    def is_as(self, other: Channel) -> bool:
        """Whether another channel has the same name and settings."""
        return (self.name, self._settings) == (other.name, other._settings)

    def prepare(self) -> None:
        """Load Apprise and read the URL, so that the first alert need not wait for it.

        Raises DeliveryError when the URL cannot be used.
        """
        if self._service is None:
            self._service, _ = _service(self._url)
            self._mail = mail_server(self._service)
            if self._illustrator is not None and self._mail is not None:
                self._illustrator.prepare()

    def reach(self) -> bool:
        """Whether the server of a mail channel answers and lets us in; nothing is sent.

        False of other services: there is no asking without a message. Raises DeliveryError.
        """
        self.prepare()
        if self._mail is None:
            return False
        try:
            reach(self._mail)
        except DeliveryError as error:
            raise DeliveryError(scrub(str(error), self._url)) from None
        return True

    def send(self, alert: Alert) -> None:
        """Deliver one alert; raises DeliveryError unless it surely was."""
        self.prepare()
        try:
            if self._mail is not None:
                self._send_mail(self._mail, alert)
            else:
                _notify(self._service, alert)
        except DeliveryError as error:
            raise DeliveryError(scrub(str(error), self._url), permanent=error.permanent) from None

    def _send_mail(self, server: MailServer, alert: Alert) -> None:
        """Deliver to every recipient; those who took or refused it for good are not asked again."""
        recipients = server.envelope.recipients
        if not recipients:
            raise DeliveryError("the URL names no valid address to send to")
        refused = self._refused.setdefault(alert.id, {})
        done = self._accepted.setdefault(alert.id, set())
        rest = [address for address in recipients if address not in done | set(refused)]
        pictures = self._illustrator.of(alert) if self._illustrator is not None and rest else ()
        answers = submit(server, alert, rest, pictures) if rest else {}
        later = {address: answer for address, answer in answers.items() if not is_permanent(answer[0])}
        done.update(set(rest) - set(answers))
        refused.update({address: answer for address, answer in answers.items() if address not in later})
        if later:  # greylisted, a full mailbox
            raise DeliveryError(
                f"mail server refused {len(later)} of {len(rest)} recipients for now: {first(later)}"
            )
        del self._accepted[alert.id], self._refused[alert.id]
        if refused:
            n = len(recipients)
            partly = len(refused) < n
            some = "only some took it: " if partly else ""
            raise DeliveryError(
                f"{some}mail server refused {len(refused)} of {n} recipients: {first(refused)}",
                permanent=True,
                partly=partly,
            )


def problem(url: str) -> str | None:
    """What is wrong with a channel's URL, in words without secrets; None when it can be used.

    It may be usable and still have one: of three addresses one that Apprise drops as invalid.
    """
    try:
        service, warnings = _service(url)
    except DeliveryError as error:
        return str(error)
    mail = mail_server(service)
    dropped = _dropped(mail, url) if mail is not None else []
    return "; ".join([*warnings, *dropped]) or None


def _dropped(mail: MailServer, url: str) -> list[str]:
    """What stands for an address in the URL of a mail channel but is none: Apprise leaves it out silently."""
    taken = [address.lower() for address in mail.envelope.recipients]
    given = parse_qs(url.partition("?")[2])
    parts = [
        part.strip()
        for key in ("to", "cc", "bcc")
        for value in given.get(key, [])
        for part in re.split("[,;]", value)
    ]
    return [
        f"{part!r} is no mail address" for part in parts if part and not any(a in part.lower() for a in taken)
    ]


def scrub(text: str, url: str) -> str:
    """`text` without any part of `url` that may be secret: user, password, path, query, a token as host."""
    for secret in sorted(_secrets(url), key=len, reverse=True):
        text = re.sub(re.escape(secret), HIDDEN, text, flags=re.IGNORECASE)
    return text


def _secrets(url: str) -> set[str]:
    scheme, _, rest = url.partition("://")
    try:
        parts = urlsplit(f"//{rest}")
        login, host = parts.netloc.rpartition("@")[::2]
        path, query = parts.path, parts.query
    except ValueError:
        login, host, path, query = rest, "", "", ""
    found = {login, *login.split(":", 1), *(p for p in path.split("/") if len(p) > 3)}
    pairs = (pair.partition("=")[::2] for pair in query.split("&"))
    found |= {value for key, value in pairs if key not in OPEN_KEYS and len(value) > 3}
    name = host.partition(":")[0]
    if "." not in name and name.lower() != "localhost" and not host.startswith("["):
        found.add(name)  # services such as Slack have a token where others have their host
    found |= {unquote(secret) for secret in found}
    return {secret for secret in found if secret and secret != scheme}


class _Warnings(logging.Handler):
    """Keeps what Apprise warns of in this thread while it reads a URL, such as an address it drops."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []
        self._thread = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the text of one warning."""
        if record.thread == self._thread:
            self.texts.append(record.getMessage())


def _service(url: str) -> tuple[Any, tuple[str, ...]]:
    """The Apprise plugin of a URL and what Apprise warned of, scrubbed.

    Raises DeliveryError with Apprise's reason where there is none.
    """
    import apprise  # noqa: PLC0415  (slow: see the module's docstring)

    logger = _quiet()
    asset = apprise.AppriseAsset(
        app_id="gliderwatch", app_desc="gliderwatch", app_url="", service_timeout=0, storage_mode="memory"
    )
    warnings = _Warnings()
    logger.addHandler(warnings)
    try:
        service = apprise.Apprise.instantiate(url, asset=asset, suppress_exceptions=False)
    except Exception as error:  # plugins raise what they like on a bad URL
        warnings.texts.append(str(error) or type(error).__name__)
        service = None
    finally:
        logger.removeHandler(warnings)
    warned = tuple(dict.fromkeys(scrub(text, url) for text in warnings.texts))
    if service is not None and _is_mail(service) and not _names_somebody(url):
        raise DeliveryError(_NOBODY)
    if service is None:
        reason = "; ".join(warned) or "no service known for it"
        raise DeliveryError(f"not an Apprise URL that can be used: {reason}")
    if "rto=" not in url:
        service.socket_read_timeout = READ_TIMEOUT
    if "overflow=" not in url:
        service.overflow_mode = apprise.OverflowMode.TRUNCATE  # a cut alert says more than a refused one
    return service, warned


def _is_mail(service: Any) -> bool:
    return str(service.url()).startswith(("mailto://", "mailtos://"))


def _names_somebody(url: str) -> bool:
    """Whether the URL of a mail channel says who gets its mails; if not, Apprise writes to the user here."""
    parts = urlsplit(f"//{url.partition('://')[2]}")
    named = {"to", "from", "user"} & parse_qs(parts.query).keys()
    return bool(parts.username or parts.path.strip("/") or named)


def _quiet() -> logging.Logger:
    """Keep the loggers of Apprise and of its HTTP client to themselves: their lines can hold URLs."""
    for name in ("apprise", "urllib3"):
        logger = logging.getLogger(name)
        logger.setLevel(logging.WARNING)
        logger.propagate = False
    return logging.getLogger("apprise")


def _notify(service: Any, alert: Alert) -> None:
    """Send what a chat is to show by Apprise, which turns it into the markup of each service.

    A service that prefers plain text gets that: Apprise escapes it as each service needs it.
    """
    import apprise  # noqa: PLC0415

    one = apprise.Apprise()
    one.add(service)
    brief, formats = alert.brief or alert.body, service.notify_format
    prefers = formats if isinstance(formats, str) else formats[0]
    is_text = prefers == apprise.NotifyFormat.TEXT
    try:
        result = one.notify(
            body=_dead(brief) if is_text else _dead(chat_html(brief)),
            title=_dead(alert.title),
            notify_type=_notify_type(alert),
            body_format=apprise.NotifyFormat.TEXT if is_text else apprise.NotifyFormat.HTML,
        )
    except Exception as error:  # a plugin may raise anything: all of it means not delivered
        raise DeliveryError(f"{service.service_name}: {type(error).__name__}") from None
    # `optional=yes` in a URL turns a failure into a success of the result, but not of its attempts
    sent = result.status == apprise.AppriseResultStatus.SUCCESS
    if sent and result.results and all(any(r.attempts) for r in result.results):
        return
    reasons = "; ".join(dict.fromkeys(entry.message for entry in result.logs()))
    codes = {int(code) for code in _HTTP_ERROR.findall(reasons)}
    raise DeliveryError(
        f"{service.service_name}: {reasons or result.status.name.lower()}",
        permanent=bool(codes) and all(400 <= code < 500 and code not in _PASSING for code in codes),
    )


def _dead(text: str) -> str:
    """Text in which nothing calls people or leads away: a space of no width parts what would."""
    return _LIVE.sub("\\g<0>\u200b", text)


def _notify_type(alert: Alert) -> str:
    if alert.kind is Kind.ALL_CLEAR:
        return "success"
    return {Severity.INFO: "info", Severity.WARNING: "warning", Severity.CRITICAL: "failure"}[alert.severity]
