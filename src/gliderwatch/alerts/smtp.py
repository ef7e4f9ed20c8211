"""Handing a mail to its server."""

from __future__ import annotations

import smtplib
import socket
import ssl
from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from email.errors import MessageError

from gliderwatch.alerts.mail import compose
from gliderwatch.alerts.mailto import MailServer
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Alert

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


def submit(server: MailServer, alert: Alert, recipients: list[str]) -> dict[str, tuple[int, bytes]]:
    """Hand the mail to the server; returns who was refused. Raises DeliveryError when nobody was served."""
    try:
        mail = compose(alert, server.envelope)
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
