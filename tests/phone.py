"""A message as a phone shows it: 40 columns of text."""

from __future__ import annotations

import textwrap

from gliderwatch.model import Alert

COLUMNS = 40


def narrow(alert: Alert) -> str:
    """Title and text, in 40 columns; addresses and commands are broken where they must be."""
    lines = [alert.title, "=" * min(len(alert.title), COLUMNS), *alert.body.rstrip("\n").split("\n")]
    rows = [row for line in lines for row in (textwrap.wrap(line, COLUMNS, subsequent_indent="  ") or [""])]
    return "\n".join(rows) + "\n"
