"""Alerts on a terminal, for replay and demo."""

from __future__ import annotations

from rich.console import Console
from rich.panel import Panel
from rich.text import Text

from gliderwatch.alerts.words import utc
from gliderwatch.model import Alert, Kind, Severity

_STYLE = {Severity.INFO: "cyan", Severity.WARNING: "yellow", Severity.CRITICAL: "bold red"}


def show(alert: Alert, console: Console) -> None:
    """Print an alert in a frame: title, what and how bad, the facts; not its lists of remarks and checks.

    Texts are printed as they are: brackets in a name are no markup.
    """
    style = "green" if alert.kind is Kind.ALL_CLEAR else _STYLE[alert.severity]
    blocks = alert.body.strip().split("\n\n")
    console.print(
        Panel(
            Text("\n\n".join(blocks[:2])),
            title=Text(alert.title, style=style),
            subtitle=Text(f"{utc(alert.time)}  {alert.kind}", style="dim"),
            title_align="left",
            subtitle_align="right",
            border_style=style,
        )
    )
