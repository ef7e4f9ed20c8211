"""Links that acknowledge an incident: signed for it and for who gets the message, and only for a time."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from itsdangerous import BadSignature, SignatureExpired, URLSafeTimedSerializer

from gliderwatch.errors import GliderwatchError

_SALT = "gliderwatch.acknowledge"


class LinkError(GliderwatchError):
    """A link that is not taken, and why."""


def key_of(state: Path) -> str:
    """The key of the links of a state file, kept beside it for its user alone; made the first time.

    Raises GliderwatchError where it can be neither read nor made.
    """
    path = state.with_name("web.key")
    try:
        if not path.exists():
            part = path.with_name(f".web.key.{os.getpid()}")
            part.touch(mode=0o600)
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
    return URLSafeTimedSerializer(key, salt=_SALT).dumps([incident, recipient])


def opened(key: str, token: str, seconds: float) -> tuple[str, str]:
    """The incident and the recipient that a token of not more than so many `seconds` ago is for.

    Raises LinkError where it has expired, or is none of ours.
    """
    try:
        incident, recipient = URLSafeTimedSerializer(key, salt=_SALT).loads(token, max_age=round(seconds))
    except SignatureExpired:
        raise LinkError("This link has expired: use that of a newer message, or the command.") from None
    except (BadSignature, ValueError, TypeError):
        raise LinkError("This link is not one of this gliderwatch, or is not whole.") from None
    return str(incident), str(recipient)
