"""An alert as an email: text and HTML, one thread an incident. Pure but for the date it is sent.

Apprise makes its own text part out of the HTML and always adds a Message-ID of its own, so that
a thread cannot be built with it (a second Message-ID is refused by large providers). The mail is
therefore composed here and sent by `smtp`, with the server and people that `mailto` reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from email.headerregistry import Address
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import formatdate
from hashlib import sha256

from gliderwatch.model import Alert


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


def message_id(key: str, sender: str) -> str:
    """The Message-ID of an alert, or the root of an incident's thread: the same for the same key.

    A message sent twice carries one identity, so that mail systems that look for duplicates drop it.
    """
    domain = sender.rpartition("@")[2].encode("idna").decode("ascii") or "localhost"
    return f"<{sha256(key.encode('utf-8', 'replace')).hexdigest()[:32]}.gliderwatch@{domain}>"


def compose(alert: Alert, envelope: Envelope) -> EmailMessage:
    """The message with text and HTML as alternatives.

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
    mail.add_alternative(alert.html, subtype="html", cte="quoted-printable")
    return mail


def _person(name: str, address: str) -> Address:
    return Address(display_name=name or "", addr_spec=address)
