"""Links in messages: to the page of the glider, and to acknowledge its incident or mute it from a phone.

Those are signed for the incident and for who gets the message, and hold for a time.
"""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from urllib.parse import quote

from gliderwatch.delivery.dispatcher import Sender
from gliderwatch.errors import GliderwatchError
from gliderwatch.messages.guide import with_help_link
from gliderwatch.messages.template import DO
from gliderwatch.model import Alert, Kind

# ruff: noqa: PLC0415
# itsdangerous is of the extra `web`: it is loaded where a link is made or opened.

_SALT = "gliderwatch.acknowledge"
_ENDED = {Kind.ALL_CLEAR, Kind.CORRECTION, Kind.ACKNOWLEDGED}
TAKEN_ON = (Kind.ANOMALY, Kind.FALSE_ALARM, Kind.ABORT, Kind.HEALTH, Kind.CALL)
"""Kinds of what can be acknowledged."""
MUTED = (Kind.OVERDUE, Kind.UNKNOWN, Kind.NEIGHBOURS)
"""Kinds of which there is nothing to acknowledge: the glider is muted instead."""


class LinkError(GliderwatchError):
    """A link that is not taken, and why."""


def key_of(state: Path) -> str:
    """The key of the links of a state file, kept beside it for its user alone; made the first time.

    Raises GliderwatchError where it can be neither read nor made.
    """
    path = state.with_name("web.key")
    try:
        if not path.exists():
            part = path.with_name(f".web.key.{secrets.token_hex(8)}")  # two threads must not share it
            part.touch(mode=0o600, exist_ok=False)
            part.write_text(secrets.token_urlsafe(48), encoding="ascii")
            try:
                path.hardlink_to(part)  # of two that make it at once the first is the one
            except FileExistsError:
                pass
            finally:
                part.unlink()
        key = path.read_text(encoding="ascii").strip()
    except OSError as error:
        raise GliderwatchError(
            f"the key of links {path} cannot be read or made: {error.strerror}. "
            "What to do: run as the user of the service"
        ) from None
    if len(key) < 32:
        raise GliderwatchError(f"the key of links {path} is too short: remove it, and a new one is made")
    return key


def token(key: str, incident: str, recipient: str) -> str:
    """What a link to acknowledge an incident ends with, for a recipient."""
    from itsdangerous import URLSafeTimedSerializer

    return URLSafeTimedSerializer(key, salt=_SALT).dumps([incident, recipient])


def opened(key: str, token: str, seconds: float) -> tuple[str, str]:
    """The incident and the recipient that a token of not more than so many `seconds` ago is for.

    Raises LinkError where it has expired, or is none of ours.
    """
    from itsdangerous import BadSignature, SignatureExpired, URLSafeTimedSerializer

    try:
        incident, recipient = URLSafeTimedSerializer(key, salt=_SALT).loads(token, max_age=round(seconds))
    except SignatureExpired:
        raise LinkError("This link has expired: use that of a newer message, or the command.") from None
    except (BadSignature, ValueError, TypeError):
        raise LinkError("This link is not one of this gliderwatch, or is not whole.") from None
    return str(incident), str(recipient)


def can_be_taken_on(incident: str) -> bool:
    """Whether what an id stands for can be acknowledged.

    >>> can_be_taken_on("electa/anomaly/1667639520"), can_be_taken_on("electa/overdue/1667639520")
    (True, False)
    """
    return _is_of(incident, TAKEN_ON)


def _is_of(incident: str, kinds: tuple[Kind, ...]) -> bool:
    return incident.partition("/")[2].partition("/")[0] in {str(kind) for kind in kinds}


@dataclass(frozen=True, slots=True)
class Linked:
    """A channel whose messages end with links: ``public`` is the URL of the pages, ``key`` that of the links,
    ``recipient`` who gets the messages."""

    sender: Sender
    public: str
    key: str
    recipient: str

    def prepare(self) -> None:
        """As the channel."""
        self.sender.prepare()

    def send(self, alert: Alert) -> None:
        """Deliver a message with its links. Raises DeliveryError."""
        self.sender.send(with_links(with_help_link(alert, self.public), self.links(alert)))

    def links(self, alert: Alert) -> tuple[tuple[str, str], ...]:
        """The links of a message, each with its label."""
        page = f"{self.public}/{quote(alert.glider)}.html"
        found = (("Page", page),) if alert.glider else ()
        incident = alert.incident.rstrip("+")
        label = ""
        if alert.kind not in _ENDED:
            label = (
                "Take it on" if can_be_taken_on(incident) else "Mute it" if _is_of(incident, MUTED) else ""
            )
        if not label:
            return found
        return ((label, f"{self.public}/ack/{token(self.key, incident, self.recipient)}"), *found)


def linked(channels: dict[str, Sender], public: str, state: Path) -> dict[str, Sender]:
    """Channels whose messages end with links to the pages at a URL, for the incidents of a state file.

    Raises GliderwatchError where they cannot be signed.
    """
    try:
        import itsdangerous  # noqa: F401
    except ImportError:
        raise GliderwatchError(
            "web.public_url needs itsdangerous, which is not installed: docs/install.md says how"
        ) from None
    key = key_of(state)
    return {name: Linked(sender, public.rstrip("/"), key, name) for name, sender in channels.items()}


def with_links(alert: Alert, links: tuple[tuple[str, str], ...]) -> Alert:
    """A message with links below what to do, before its numbers; one without that ends with them."""
    if not links:
        return alert
    if any(label == "Take it on" for label, _ in links):
        alert = _without_command(alert)
    lines = "\n".join(f"{label}: {url}" for label, url in links)
    brief = f"{alert.brief.rstrip()}\n\n{lines}\n" if alert.brief else ""
    rest = alert.body.removeprefix(alert.brief) if alert.brief else ""
    shown = "<br>\n".join(f'<a href="{escape(url)}">{escape(label)}</a>' for label, url in links)
    end = "</ul>" if f"<b>{DO}</b>" in alert.html else "</body>"
    place = f"{end}\n<p>{shown}</p>" if end == "</ul>" else f"<p>{shown}</p>\n{end}"
    html = alert.html.replace(end, place, 1)
    body = f"{brief}{rest}" if brief and rest != alert.body else f"{alert.body.rstrip()}\n\n{lines}\n"
    return replace(alert, body=body, html=html, brief=brief)


_COMMAND = re.compile(r"^(<b>)?Take it on:(</b>)? sudo .*\n", re.MULTILINE)


def _without_command(alert: Alert) -> Alert:
    """A message without the command that takes its incident on: there is a link for that."""
    body, html, brief = (_COMMAND.sub("", text) for text in (alert.body, alert.html, alert.brief))
    return replace(alert, body=body, html=html, brief=brief)
