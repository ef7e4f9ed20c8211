"""Readings of files and logs, through the store, to the messages: in any order, and once."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import closing, redirect_stdout
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path

import pytest

from gliderwatch.health.rules import usual_limits
from gliderwatch.incidents.acknowledgement import acknowledge_thread
from gliderwatch.incidents.health import health_incidents
from gliderwatch.model import Alert, Kind, Series, Severity, readonly
from gliderwatch.params import GliderParams
from gliderwatch.service import judgement, transaction
from gliderwatch.service.replay import Request, replay
from gliderwatch.service.routing import Routing
from gliderwatch.simulate.ailments import Ailment, AilmentKind
from gliderwatch.simulate.calls import CallRates
from gliderwatch.simulate.job import Job, run
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.store.state_file import Store

T0, HOUR, DAY = 1737876100.0, 3600.0, 86400.0
ROUTING = Routing(channels=lambda alert: ["mail"], notices=lambda glider: False)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with closing(Store.open(tmp_path / "state.sqlite", durable=False)) as opened:
        yield opened


def call(folder: Path, store: Store, t: float, lines: str) -> list[Alert]:
    """A log comes to the store; the messages."""
    at = datetime.fromtimestamp(t, UTC)
    text = (
        f"Vehicle Name: electa\nCurr Time: {at:%a %b %e %H:%M:%S %Y} MT:  263958\n"
        "MissionName:ew33.mi MissionNum:electa-2025-022-0-33 (0103.0033)\n"
        f"{lines}zModem transfer DONE for file 01030033.scd\nConnection Event: Carrier Detect lost.\n"
    )
    path = folder / f"electa_{at:%Y%m%dT%H%M%S}_network_net_0.log"
    path.write_text(text, encoding="utf-8")
    found = judgement.judge_log(path, store, lambda glider: True)
    assert found is not None
    return list(transaction.process_log(store, *found, GliderParams(), ROUTING, t + 60).alerts)


def leak(volts: float) -> str:
    return f"   sensor:m_leakdetect_voltage(volts)={volts}       27.792 secs ago\n"


def test_leak_in_two_logs_is_reported_once_and_acknowledged(tmp_path: Path, store: Store) -> None:
    assert call(tmp_path, store, T0, leak(2.49)) == []
    assert call(tmp_path, store, T0 + 3 * HOUR, leak(2.38)) == []  # one reading is none
    (found,) = call(tmp_path, store, T0 + 6 * HOUR, leak(2.38))
    assert (found.kind, found.severity) == (Kind.HEALTH, Severity.CRITICAL)
    assert found.title == "electa LEAK: leak detector at 2.380 V"
    assert call(tmp_path, store, T0 + 9 * HOUR, leak(2.38)) == []
    (again,) = call(tmp_path, store, T0 + 31 * HOUR, leak(2.38))
    assert again.kind is Kind.REMINDER and again.incident == found.incident
    ack = acknowledge_thread(found.incident, Severity.CRITICAL, "ann", "", T0 + 32 * HOUR)
    store.notes.acknowledge("electa", ack)
    assert call(tmp_path, store, T0 + 80 * HOUR, leak(2.38)) == []
    for k in range(3):
        assert call(tmp_path, store, T0 + (83 + 3 * k) * HOUR, leak(2.49)) == []
    (over,) = call(tmp_path, store, T0 + 92 * HOUR, leak(2.49))
    assert over.kind is Kind.ALL_CLEAR and over.audience is Severity.CRITICAL


def test_new_error_of_a_device_and_what_a_first_log_shows(tmp_path: Path, store: Store) -> None:
    def devices(errors: int) -> str:
        return f"14 digifin I u 3 20 5 0 [ {errors} 0 0] [ 28 5 1] [ 227 62 4]\n"

    assert call(tmp_path, store, T0, devices(3)) == []  # history
    assert call(tmp_path, store, T0 + 3 * HOUR, devices(3)) == []
    assert call(tmp_path, store, T0 + 6 * HOUR, devices(4)) == []  # one reading may be garbled
    (found,) = call(tmp_path, store, T0 + 9 * HOUR, devices(4))
    assert found.title == "electa DEVICES: a new error of device digifin"
    assert call(tmp_path, store, T0 + 12 * HOUR, devices(0)) == []  # a reset


def test_any_order_of_arrival_ends_alike(tmp_path: Path) -> None:
    rng = random.Random(5)
    rows = []
    for k in range(40):
        low = 5.8 if 12 <= k < 16 or k > 35 else 7.5
        values = [3386.389 * (low + rng.uniform(-0.1, 0.1)) for _ in range(3)]
        t = T0 + 3 * HOUR * k
        rows.append((f"s-{k}", t, {"vacuum": Series(readonly([t - 40, t - 20, t]), readonly(values))}))
    ends = []
    for seed in range(6):
        order = rows if seed == 0 else random.Random(seed).sample(rows, len(rows))
        with closing(Store.open(tmp_path / f"{seed}.sqlite", durable=False)) as store:
            for source, t, readings in order:
                store.health.put("a", source, t, readings)
                if rng.random() < 0.5:
                    store.health.judge("a", usual_limits())
            store.health.judge("a", usual_limits())
            ends.append(health_incidents("a", store.health.judged("a")))
    assert all(end == ends[0] for end in ends)
    assert [i.cleared_at is None for i in ends[0]] == [False, True]


def test_simulated_leak_is_reported_within_a_surfacing_of_its_two_readings(tmp_path: Path) -> None:
    """The whole way, from simulated files and logs to the message; it takes some seconds."""
    scenario = Scenario(seed=3, glider="cora", days=1.0)
    onset = scenario.start + 0.5 * DAY
    ailments = (Ailment(AilmentKind.LEAK, onset, 2.38),)
    with redirect_stdout(StringIO()):
        run(Job(tmp_path, [scenario], calls=CallRates(garbled=0.01), ailments=ailments))
    with closing(replay(Request((tmp_path / "gliders",), (tmp_path / "cache",))).store) as store:
        found = [alert for alert in store.alerts() if alert.kind is Kind.HEALTH]
    assert [alert.severity for alert in found] == [Severity.CRITICAL]
    assert onset < found[0].time < onset + 7 * HOUR


@pytest.mark.real
@pytest.mark.parametrize(
    "mission", ["electa-2022", "george-2024", "maria-2022", "osu-2025", "usf-sam-2019", "logs"]
)
def test_real_missions_have_no_message_of_health(shared_data: Path, mission: str) -> None:
    """Not one: the usual limits of forms and scripts cry wolf on all of them. The number of rules that had
    anything to look at is that of the sensors which the mission sends."""
    looked = {
        "electa-2022": 5,
        "george-2024": 9,
        "maria-2022": 10,
        "osu-2025": 8,
        "usf-sam-2019": 9,
        "logs": 11,
    }
    folder = shared_data / mission
    with closing(replay(Request((folder,), (folder / "cache",))).store) as store:
        assert [a.title for a in store.alerts() if a.kind is Kind.HEALTH] == []
        (glider,) = {row[0] for row in store._db.execute("SELECT glider FROM health")}
        rules = {rule for _, judged in store.health.judged(glider) for rule in judged}
    assert len(rules) == looked[mission]
