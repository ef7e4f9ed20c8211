"""A notice becomes a message: the one place where what is due gets its words. Pure.

To give a new notice its words, write a function `(glider, content) -> title and page` beside those of its
kind and add it to `_WRITERS`; CONTRIBUTING.md has it step by step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gliderwatch.incidents import notices as n
from gliderwatch.messages import (
    call_text,
    health_text,
    incident_text,
    irregularity_text,
    neighbours_text,
    overdue_text,
    unjudged_text,
)
from gliderwatch.messages.formatting import clean, utc
from gliderwatch.messages.guide import with_help
from gliderwatch.messages.template import Page, Text, lead_and_actions, titled
from gliderwatch.model import Alert, Kind, Severity

_WRITERS: dict[type, Callable[[str, Any], Text]] = {
    n.Opened: incident_text.opened,
    n.StillOpen: incident_text.still_open,
    n.Cleared: incident_text.cleared,
    n.Corrected: incident_text.corrected,
    n.Acknowledged: incident_text.acknowledged,
    n.Surfaced: incident_text.surfaced,
    n.NewRegime: incident_text.new_regime,
    n.Overdue: overdue_text.overdue,
    n.CalledAgain: overdue_text.called_again,
    n.CalledInTime: overdue_text.called_in_time,
    n.Blind: unjudged_text.blind,
    n.JudgedAgain: unjudged_text.judged_again,
    n.Aborted: call_text.aborted,
    n.Resumed: call_text.resumed,
    n.CalledWithoutFile: call_text.without_file,
    n.SendsAgain: call_text.sends_again,
    n.StillAborted: call_text.still_aborted,
    n.HealthFound: health_text.found,
    n.HealthReminder: health_text.reminder,
    n.HealthOver: health_text.over,
    n.DiffersFromNeighbours: neighbours_text.differs,
    n.Irregularity: irregularity_text.irregular,
}
"""How each content of a notice reads, of which glider."""


def render(notice: n.Notice) -> Alert:
    """The message of a notice."""
    title, page = _WRITERS[type(notice.content)](notice.glider, notice.content)
    made = Alert(
        id=notice.id,
        glider=notice.glider,
        time=notice.time,
        kind=notice.kind,
        severity=notice.severity,
        audience=notice.audience,
        incident=notice.thread,
        title=title,
        body=page.text(),
        html=page.html(title),
        brief=page.brief(),
    )
    return with_help(made)


def operator(
    title: str,
    text: str,
    time: float,
    *,
    alert_id: str,
    severity: Severity,
    audience: Severity,
    machine: str = "",
) -> Alert:
    """A message about the watch itself on a ``machine``, not about a flight: a folder gone, a full disk.

    Lines of the ``text`` that begin with "What to do: " say that.
    """
    lead, todo = lead_and_actions(text)
    who = f"GLIDERWATCH {clean(machine, 16)}" if machine else "GLIDERWATCH"
    subject = titled("", f"{who}: {title}")
    page = Page((f"{who}, {utc(time)}: {clean(title)}.", *lead), do=todo)
    made = Alert(
        id=alert_id,
        glider="",
        time=time,
        kind=Kind.OPERATOR,
        severity=severity,
        audience=audience,
        incident="",
        title=subject,
        body=page.text(),
        html=page.html(subject),
        brief=page.brief(),
    )
    return with_help(made)
