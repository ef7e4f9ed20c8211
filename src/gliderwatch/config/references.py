"""Secrets that a channel's URL refers to: `${NAME}`, `${file:PATH}`, `${credential:NAME}`.

Values are put in when the URL is needed and kept nowhere. Errors name the reference and never
its value.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from urllib.parse import quote

from gliderwatch.errors import ConfigError

_REFERENCE = re.compile(r"\$\{([^{}]*)\}")
_FORM = re.compile(r"[A-Za-z_][A-Za-z0-9_]*|file:.*\S.*|credential:[A-Za-z0-9_.-]+")
CREDENTIALS = "CREDENTIALS_DIRECTORY"
_LARGEST = 64 * 1024
"""Bytes of a file with a secret."""


def needs_credentials(template: str) -> bool:
    """Whether the template refers to a systemd credential."""
    return any(name.startswith("credential:") for name in _REFERENCE.findall(template))


def verify(template: str) -> str:
    """The template itself; raises `ValueError` where a reference is not one of the three forms."""
    well_formed = all(_FORM.fullmatch(name) for name in _REFERENCE.findall(template))
    if not well_formed or "${" in _REFERENCE.sub("", template):
        raise ValueError("a reference must be ${NAME}, ${file:PATH} or ${credential:NAME}")
    return template


def resolve(template: str, base: Path) -> str:
    """The template with its references replaced; relative files are looked up in the folder `base`.

    A value that stands before the `@` of the address (user, password) or after its `?` is
    percent-encoded, so that a password may hold any character. Elsewhere it is put in as it is:
    it may be a whole URL or a path of tokens.

    Raises `ConfigError` naming the reference that cannot be had.
    """
    pieces = _REFERENCE.split(template)  # text, name, text, name, ..., text
    out = [pieces[0]]
    for i in range(1, len(pieces), 2):
        value = _value(pieces[i], base)
        before, after = "".join(pieces[0:i:2]), "".join(pieces[i + 1 :: 2])
        out += [quote(value, safe="") if _is_encoded(before, after) else value, pieces[i + 1]]
    return "".join(out)


def _is_encoded(before: str, after: str) -> bool:
    """Whether a value between these literal texts is a user, a password or a query value."""
    address = before.partition("://")[2]
    if "?" in address:
        return True
    in_host = "://" in before and "/" not in address
    return in_host and "@" in re.split("[/?#]", after, maxsplit=1)[0]


def _value(name: str, base: Path) -> str:
    """The value of one reference; raises `ConfigError`."""
    kind, colon, rest = name.partition(":")
    if not colon:
        value = os.environ.get(name)
        if value is None:
            raise ConfigError(f"environment variable {name} is not set")
        source = f"environment variable {name}"
    elif kind == "file":
        source = f"file {rest}"
        value = _read(base / Path(rest).expanduser(), source)
    else:
        folder = os.environ.get(CREDENTIALS)
        if not folder:
            raise ConfigError(f"credential {rest} is not there: systemd did not set {CREDENTIALS}")
        source = f"credential {rest}"
        value = _read(Path(folder) / rest, source)
    value = value.strip()
    if not value or not value.isprintable():
        raise ConfigError(f"{source} must hold one line of text")
    return value


def _read(path: Path, source: str) -> str:
    """The text of a small regular file: a device may have no end, and a FIFO nobody who writes."""
    try:
        if not stat.S_ISDIR(mode := path.stat().st_mode) and not stat.S_ISREG(mode):
            raise ConfigError(f"{source} is no regular file: put the secret into one")
        with open(path, "rb", opener=_open_at_once) as file:
            data = file.read(_LARGEST + 1)
        if len(data) > _LARGEST:
            raise ConfigError(f"{source} is larger than {_LARGEST // 1024} kB: it must hold one line of text")
        return data.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise ConfigError(f"{source} cannot be read: {reason}") from None


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY)
