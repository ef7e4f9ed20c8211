"""Who is told what."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import time
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pytest

from alert_support import alert
from gliderwatch.config import Config, load
from gliderwatch.incidents.send_schedule import QuietHours, Wait
from gliderwatch.model import Kind, Severity
from gliderwatch.service import operator_alerts, replay
from gliderwatch.service.routing import NOBODY, channels, routing_of


def config(folder: Path, **recipients: dict[str, Any]) -> Config:
    document = {
        "dockserver": {"roots": [str(folder)]},
        "gliders": {"electa": None, "sam": None},
        "channels": {name: {"url": "json://127.0.0.1"} for name in ("mail", "slack", "sms")},
        "recipients": recipients,
    }
    path = folder / "gliderwatch.yml"
    path.write_text(json.dumps(document), encoding="utf-8")
    return load(path)


def told(settings: Config, **changes: Any) -> list[str]:
    base = replace(alert(), glider="electa", kind=Kind.ANOMALY, audience=Severity.CRITICAL)
    return list(channels(replace(base, **changes), settings))


def test_each_channel_is_named_once_in_the_order_of_the_recipients(tmp_path: Path) -> None:
    settings = config(tmp_path, a={"channels": ["sms", "mail"]}, b={"channels": ["mail", "slack"]})
    assert told(settings) == ["sms", "mail", "slack"]


@pytest.mark.parametrize(
    ("least", "heard"),
    [
        ("info", [Severity.INFO, Severity.WARNING, Severity.CRITICAL]),
        ("warning", [Severity.WARNING, Severity.CRITICAL]),
        ("critical", [Severity.CRITICAL]),
    ],
)
def test_messages_below_the_severity_wanted_are_not_sent(
    tmp_path: Path, least: str, heard: list[Severity]
) -> None:
    settings = config(tmp_path, a={"channels": ["mail"], "min_severity": least})
    assert [s for s in Severity if told(settings, audience=s)] == heard


def test_an_all_clear_goes_to_whom_the_alarm_went(tmp_path: Path) -> None:
    settings = config(tmp_path, a={"channels": ["mail"], "min_severity": "critical"})
    clear = {"kind": Kind.ALL_CLEAR, "severity": Severity.INFO}
    assert told(settings, **clear, audience=Severity.CRITICAL) == ["mail"]
    assert told(settings, **clear, audience=Severity.WARNING) == []


def test_recipients_hear_of_their_gliders(tmp_path: Path) -> None:
    settings = config(
        tmp_path, a={"channels": ["mail"], "gliders": ["electa"]}, b={"channels": ["sms"], "gliders": ["sam"]}
    )
    assert told(settings, glider="electa") == ["mail"]
    assert told(settings, glider="sam") == ["sms"]
    assert told(settings, glider="other") == []


def test_surfacing_notices_go_only_to_those_who_asked(tmp_path: Path) -> None:
    settings = config(
        tmp_path,
        a={"channels": ["mail"], "min_severity": "info"},
        b={"channels": ["sms"], "min_severity": "critical", "surfacing": ["electa"]},
    )
    notice = {"kind": Kind.SURFACING, "audience": Severity.INFO}
    assert told(settings, **notice) == ["sms"]
    assert told(settings, **notice, glider="sam") == []
    wanted = routing_of(settings)
    assert wanted.notices("electa")
    assert not wanted.notices("sam")
    assert list(wanted.channels(replace(alert(), kind=Kind.SURFACING, glider="electa"))) == ["sms"]


def test_a_message_of_no_glider_goes_by_its_severity(tmp_path: Path) -> None:
    settings = config(tmp_path, a={"channels": ["mail"], "gliders": ["sam"]})
    own = {"glider": "", "kind": Kind.OPERATOR}
    assert told(settings, **own, audience=Severity.CRITICAL) == ["mail"]
    assert told(settings, **own, audience=Severity.INFO) == []


def test_each_channel_tells_what_those_who_share_it_wait_for(tmp_path: Path) -> None:
    night = {"start": "22:00", "end": "07:00", "time_zone": "Europe/Amsterdam", "below": "critical"}
    settings = config(
        tmp_path,
        duty={"channels": ["mail", "sms"], "surfacing": ["electa"]},
        chief={"channels": ["slack"], "unacknowledged_minutes": 30, "surfacing": ["electa"]},
        owner={"channels": ["mail"], "quiet_hours": night, "unacknowledged_minutes": 0.5},
    )
    hours = QuietHours(time(22), time(7), ZoneInfo("Europe/Amsterdam"), Severity.CRITICAL)
    assert channels(alert(), settings) == {
        "mail": [Wait(), Wait(30.0, hours)],
        "sms": [Wait()],
        "slack": [Wait(1800.0)],
    }
    notice = replace(alert(), kind=Kind.SURFACING, incident="")
    assert channels(notice, settings) == {"mail": [Wait()], "sms": [Wait()], "slack": [Wait()]}
    assert operator_alerts.channels(settings, Severity.WARNING, "disk") == {
        "mail": [Wait(), Wait(None, hours)],
        "sms": [Wait()],
        "slack": [Wait()],
    }


def test_a_replay_that_sends_waits_for_nothing(tmp_path: Path) -> None:
    settings = config(tmp_path, chief={"channels": ["slack"], "unacknowledged_minutes": 30})
    assert replay._at_once(settings).channels(alert()) == ["slack"]


def test_nobody_is_nobody() -> None:
    assert list(NOBODY.channels(alert())) == []
    assert not NOBODY.notices("electa")
