"""The daemon looks after itself: numbers for Prometheus, messages to the operator, the dead man's switch."""

from __future__ import annotations

import json
import re
import socket
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from alert_support import SLOW, alert
from gliderwatch.config import Config, load, schema
from gliderwatch.errors import ConfigError
from gliderwatch.model import Hindrance, SegmentId, Severity
from gliderwatch.service import heartbeat
from gliderwatch.service.heartbeat import DECODING, STALLED, Decoding, Heartbeat, Upkeep
from gliderwatch.service.liveness import STALE
from gliderwatch.service.metrics import Metrics, Outbox
from gliderwatch.service.operator_alerts import HOUR, Operator, Vitals, channels, troubles
from gliderwatch.store import outbox
from gliderwatch.store.state_file import File, Status, Store
from gliderwatch.store.watch_health import Failing, Waiting

MACHINE = socket.gethostname()

DOCS = Path(__file__).resolve().parents[2] / "docs"
NOW = 1_800_000_000.0
LIMITS = schema.Operator()


@pytest.fixture
def state(tmp_path: Path) -> Path:
    Store.open(tmp_path / "state.sqlite").close()
    return tmp_path / "state.sqlite"


@pytest.fixture
def store(state: Path) -> Iterator[Store]:
    with closing(Store.open(state)) as store:
        yield store


def config(state: Path, **more: Any) -> Config:
    document = {
        "dockserver": {"roots": [str(state.parent)]},
        "state": {"path": str(state)},
        "gliders": {"electa": None, "sam": None},
        "channels": {name: {"url": "json://127.0.0.1"} for name in ("mail", "slack")},
        "recipients": {"pilot": {"channels": ["mail", "slack"]}},
        **more,
    }
    path = state.with_name("gliderwatch.yml")
    path.write_text(json.dumps(document), encoding="utf-8")
    return load(path)


# --------------------------------------------------------------------------- settings


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1"])
def test_another_address_than_loopback_has_to_be_wanted(state: Path, address: str) -> None:
    with pytest.raises(ConfigError, match="open_to_network"):
        config(state, metrics={"port": 9464, "address": address})
    assert config(state, metrics={"port": 9464, "address": address, "open_to_network": True})


def test_nothing_listens_unless_configured(state: Path) -> None:
    assert config(state).metrics.port is None
    assert str(config(state, metrics={"port": 9464}).metrics.address) == "127.0.0.1"


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("ftp://h.org/x", "must be an http"),
        ("http://h.org:port/x", "is no URL"),
        ("https:///x", "must be an http"),
        ("https://h.org/${NOT_THERE_AT_ALL}", "NOT_THERE_AT_ALL is not set"),
    ],
)
def test_a_url_of_the_heartbeat_that_cannot_be_fetched(state: Path, url: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        Heartbeat.of(config(state, heartbeat={"url": url}))


# --------------------------------------------------------------------------- numbers


def sample(metrics: Metrics, name: str, **labels: str) -> float | None:
    return metrics.registry.get_sample_value(f"gliderwatch_{name}", labels)


def test_files_and_flags_are_counted(state: Path) -> None:
    metrics = Metrics(state, config(state))
    assert sample(metrics, "files_total", status="quarantined") == 0, "there before the first, for increase()"
    metrics.came(File("/a", 1, 1, Status.TAKEN, "electa"), NOW)
    metrics.came(File("/b", 1, 1, Status.QUARANTINED), NOW + 1)
    metrics.came(File("/c", 1, 1, Status.UNKNOWN, "stranger"), NOW + 2)
    metrics.assessed([SLOW, replace(SLOW, flag=None)])
    assert sample(metrics, "files_total", status="taken") == 1
    assert sample(metrics, "files_total", status="quarantined") == 1
    assert sample(metrics, "last_file_timestamp_seconds", glider="electa") == NOW
    assert sample(metrics, "last_file_timestamp_seconds", glider="stranger") is None
    assert sample(metrics, "flags_total", glider="electa", flag="1") == 1
    assert sample(metrics, "flags_total", glider="electa", flag="none") == 1


def test_last_files_are_known_after_a_restart_and_forgotten_with_the_glider(
    state: Path, store: Store
) -> None:
    store.record_sign(segment("electa"), None, NOW)
    metrics = Metrics(state, config(state))
    assert sample(metrics, "last_file_timestamp_seconds", glider="electa") == NOW
    metrics.forget(config(state, gliders={"sam": None}))
    assert sample(metrics, "last_file_timestamp_seconds", glider="electa") is None


def test_it_is_healthy_while_the_loop_comes_round_and_all_is_well(state: Path) -> None:
    metrics = Metrics(state, config(state))
    assert sample(metrics, "healthy") == 0, "no beat yet"
    metrics.beat(True, 7)
    assert (sample(metrics, "healthy"), sample(metrics, "queue_files")) == (1, 7)
    metrics._well_at -= STALE
    assert sample(metrics, "healthy") == 0, "the loop hangs"
    metrics.beat(False, 7)
    assert sample(metrics, "healthy") == 0


def segment(glider: str) -> SegmentId:
    return SegmentId(NOW - 5000, glider, f"{glider}-2027-1-0-0")


def test_open_incidents_and_messages_that_wait_are_looked_up(state: Path, store: Store) -> None:
    metrics, settings = Metrics(state, config(state)), config(state)
    store.post(alert("a"), ["mail"], NOW)
    metrics.look(store, settings, NOW)
    assert sample(metrics, "open_incidents", glider="sam") == 0
    assert sample(metrics, "overdue", glider="sam") == 0
    assert sample(metrics, "undelivered_messages", channel="mail") == 1
    assert sample(metrics, "undelivered_messages", channel="slack") == 0


def test_each_delivery_and_each_failure_counts_once(state: Path, store: Store) -> None:
    rows = outbox.Outbox(state)
    store.post(alert("old"), ["mail"], NOW - 99)
    rows.delivered(1, NOW - 90)
    seen = Outbox(state)
    for name in ("a", "b", "c"):
        store.post(alert(name), ["mail", "slack"], NOW)
    rows.failed(2, "no", NOW)
    rows.delivered(4, NOW + 3)
    assert seen.look(NOW + 10) == ([("mail", 3.0)], [("mail", 1)], {"mail": 2, "slack": 3})
    assert seen.look(NOW + 10) == ([], [], {"mail": 2, "slack": 3})
    rows.failed(2, "no", NOW)
    rows.delivered(2, NOW + 7)
    assert seen.look(NOW + 10) == ([("mail", 7.0)], [("mail", 1)], {"mail": 1, "slack": 3})
    for row in (3, 5, 6, 7):
        rows.delivered(row, NOW + 8)
    delays, failed, waiting = seen.look(NOW + 10)
    assert (sorted(delays), failed, waiting) == ([("mail", 8.0), *[("slack", 8.0)] * 3], [], {})
    assert seen.look(NOW + 10) == ([], [], {})
    rows.close()


def test_it_listens_where_it_is_told_and_stops_when_told(state: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    metrics = Metrics(state, config(state))
    metrics.serve(schema.Metrics())
    assert not metrics.is_served()
    metrics.serve(schema.Metrics(port=port))
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
        text = answer.read().decode()
    assert re.search(r'gliderwatch_build_info\{.*version="', text)
    metrics.serve(schema.Metrics())
    assert not metrics.is_served()
    with pytest.raises(OSError, match="refused"), socket.create_connection(("127.0.0.1", port), timeout=10):
        pass


def test_a_port_that_is_taken_ends_nothing_and_is_tried_again(state: Path) -> None:
    metrics = Metrics(state, config(state))
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        settings = schema.Metrics(port=other.getsockname()[1])
        metrics.serve(settings)
        assert not metrics.is_served()
    metrics.serve(settings)
    assert metrics.is_served()
    metrics.stop()


def exposed(state: Path) -> set[str]:
    """The names of all series, once everything has happened once."""
    metrics = Metrics(state, config(state))
    metrics.came(File("/a", 1, 1, Status.TAKEN, "electa"), NOW)
    metrics.assessed([SLOW])
    for labelled in (metrics.delivery, metrics.failures, metrics.undelivered):
        labelled.labels("mail")
    for labelled in (metrics.incidents, metrics.overdue):
        labelled.labels("electa")
    found = {sample.name for family in metrics.registry.collect() for sample in family.samples}
    return {name for name in found if not name.endswith("_created")}


@pytest.mark.parametrize("page", ["alerts.yml", "grafana.json", "operations.md"])
def test_every_number_named_in_the_docs_exists(state: Path, page: str) -> None:
    named = set(re.findall(r"\bgliderwatch_[a-z_]+\b", (DOCS / page).read_text(encoding="utf-8")))
    names = exposed(state)
    families = {re.sub(r"_(bucket|sum|count)$", "", name) for name in names}
    assert named, "nothing is named"
    assert named <= names | families
    if page == "operations.md":
        assert families <= named, "the table of operations.md has them all"


def test_the_examples_can_be_read() -> None:
    rules = YAML(typ="safe", pure=True).load(DOCS / "alerts.yml")["groups"][0]["rules"]
    assert all(rule["expr"] and rule["annotations"]["summary"] for rule in rules)
    assert len({rule["alert"] for rule in rules}) == len(rules)
    board = json.loads((DOCS / "grafana.json").read_text(encoding="utf-8"))
    assert all(target["expr"] for panel in board["panels"] for target in panel["targets"])
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])


# --------------------------------------------------------------------------- troubles


@pytest.mark.parametrize(
    ("vitals", "key"),
    [
        (Vitals(silent=24.1 * HOUR), "silence"),
        (Vitals(quarantined={"electa": 21, "sam": 20}), "quarantine/electa"),
        (Vitals(quarantined={"": 21}), "quarantine"),
        (Vitals(silent=0.0, missed={"electa": 24.1 * HOUR, "sam": 23.0 * HOUR}), "silence/electa"),
        (Vitals(waiting={"electa": Waiting(3, NOW - 6.1 * HOUR, "no cache")}), "waiting/electa"),
        (Vitals(free=499.0), "disk"),
        (Vitals(failing={"mail": Failing(NOW - 1.1 * HOUR, 3, "421 later")}), "channel/mail"),
    ],
)
def test_each_trouble_is_told_beyond_its_limit_and_never_where_the_limit_is_null(
    vitals: Vitals, key: str
) -> None:
    assert list(troubles(vitals, LIMITS, (), NOW)) == [key]
    off = dict.fromkeys(schema.Operator.model_fields)
    assert troubles(vitals, schema.Operator(**off), (), NOW) == {}


def test_within_the_limits_nothing_is_told() -> None:
    failing = {"mail": Failing(NOW - 0.9 * HOUR, 1, "")}
    waiting = {"sam": Waiting(100, NOW - 5.9 * HOUR, "")}
    well = Vitals(23.9 * HOUR, {"sam": 23.9 * HOUR}, {"sam": 20, "electa": 20}, waiting, failing, 501.0)
    assert troubles(well, LIMITS, (), NOW) == {}
    assert troubles(Vitals(), LIMITS, (), NOW) == {}


def test_what_is_open_ends_only_well_within_its_limit() -> None:
    near, far = Vitals(quarantined={"": 15}, free=550.0), Vitals(quarantined={"": 10}, free=600.0)
    assert troubles(near, LIMITS, (), NOW) == {}
    assert set(troubles(near, LIMITS, ("quarantine", "disk"), NOW)) == {"quarantine", "disk"}
    assert troubles(far, LIMITS, ("quarantine", "disk"), NOW) == {}


def test_a_trouble_is_told_once_also_over_a_restart_and_so_is_its_end(state: Path, store: Store) -> None:
    settings = config(state, operator={"free_mb": None})
    first = Operator(store, state, settings, NOW, 0.0)
    assert first.look(settings, settings.operator, NOW, 23 * HOUR) == ()
    (told,) = first.look(settings, settings.operator, NOW + 25 * HOUR, 25 * HOUR)
    assert "no file of any glider for 25.0 h" in told.title
    assert first.look(settings, settings.operator, NOW + 26 * HOUR, 26 * HOUR) == ()

    store.record_sign(segment("sam"), None, NOW)
    second = Operator(store, state, settings, NOW + 27 * HOUR, 0.0)
    assert second.look(settings, settings.operator, NOW + 27 * HOUR, 0.0) == (), "said before the restart"
    second.came("sam", 10.0)
    (over,) = second.look(settings, settings.operator, NOW + 27 * HOUR, 10.0)
    assert "files of the gliders come again" in over.title
    assert over.severity is Severity.INFO
    assert (over.id, over.incident) == (told.id + "/over", told.incident)
    third = Operator(store, state, settings, NOW + 28 * HOUR, 0.0)
    third.came("sam", 0.0)
    assert third.look(settings, settings.operator, NOW + 28 * HOUR, 0.0) == ()
    assert [a.id for a in store.alerts()] == [told.id, over.id]
    assert len(store.undelivered()) == 4, "two messages by two channels"


def test_silence_goes_by_no_clock_that_jumps(state: Path, store: Store) -> None:
    settings = config(state, operator={"free_mb": None})
    operator = Operator(store, state, settings, NOW, 0.0)
    assert operator.look(settings, settings.operator, NOW + 1000 * HOUR, 60.0) == ()


def test_recovered_gliders_are_silent_for_good_reason(state: Path, store: Store) -> None:
    gliders = {"electa": {"recovered": True}, "sam": {"recovered": True}}
    settings = config(state, operator={"free_mb": None}, gliders=gliders)
    operator = Operator(store, state, settings, NOW, 0.0)
    assert operator.look(settings, settings.operator, NOW, 99 * HOUR) == ()


def test_files_quarantined_within_a_day_count(state: Path, store: Store) -> None:
    settings = config(state, operator={"free_mb": None, "quarantined_per_day": 2})
    operator = Operator(store, state, settings, NOW, 0.0)
    for i, age in enumerate((25, 23, 1)):
        store.record(File(f"/{i}", 1, 1, Status.QUARANTINED), NOW - age * HOUR)
    assert operator.look(settings, settings.operator, NOW, 0.0) == ()
    store.record(File("/more", 1, 1, Status.QUARANTINED), NOW)
    (told,) = operator.look(settings, settings.operator, NOW, 0.0)
    assert "3 files of no known glider quarantined in" in told.title


def test_files_of_one_glider_that_wait_are_a_trouble_until_they_are_taken(state: Path, store: Store) -> None:
    settings = config(state, operator={"free_mb": None})
    operator = Operator(store, state, settings, NOW, 0.0)
    lacks = File("/a", 1, 1, Status.WAITING, "sam", "s", "cache file ab.cac is missing: not in /c", "ab")
    store.record(replace(lacks, hindrance=Hindrance.NO_CACHE), NOW)
    store.record(replace(lacks, path="/b", hindrance=Hindrance.NO_CACHE), NOW + 5 * HOUR)
    gone = replace(lacks, path="/c", glider="electa", crc="", hindrance=Hindrance.GONE)
    store.record(gone, NOW)
    operator.came("sam", 5 * HOUR)
    assert operator.look(settings, settings.operator, NOW + 5.9 * HOUR, 5.9 * HOUR) == ()
    (told,) = operator.look(settings, settings.operator, NOW + 6.1 * HOUR, 6.1 * HOUR)
    assert told.title == f"GLIDERWATCH {MACHINE}: files of sam have waited for 6.1 h"
    assert "2 wait; the oldest since" in told.body and "ab.cac is missing: not in /c" in told.body
    for path in ("/a", "/b"):
        store.record(File(path, 1, 1, Status.TAKEN, "sam", "s"), NOW + 7 * HOUR)
    (over,) = operator.look(settings, settings.operator, NOW + 7 * HOUR, 7 * HOUR)
    assert over.title == f"GLIDERWATCH {MACHINE}: no files of sam wait any more"


def test_one_glider_is_missed_while_another_calls(state: Path, store: Store) -> None:
    """Of its own limit, though files of the fleet come all the time; not in a mute."""
    settings = config(state, operator={"free_mb": None})
    for k in range(4):
        store.record_sign(SegmentId(NOW + 3 * k * HOUR, "sam", f"s{k}"), None, NOW + 3 * k * HOUR)
    operator = Operator(store, state, settings, NOW + 9 * HOUR, 9 * HOUR)
    found = []
    for hour in range(10, 40, 3):
        operator.came("electa", hour * HOUR)
        found += operator.look(settings, settings.operator, NOW + hour * HOUR, hour * HOUR)
    (told,) = found
    assert told.title == f"GLIDERWATCH {MACHINE}: no file of sam for 25.0 h"
    operator.came("sam", 40 * HOUR)
    (over,) = operator.look(settings, settings.operator, NOW + 40 * HOUR, 40 * HOUR)
    assert over.title == f"GLIDERWATCH {MACHINE}: files of sam come again"


def test_a_channel_that_fails_is_told_by_the_others_and_silences_the_heartbeat_with_the_last(
    state: Path, store: Store
) -> None:
    settings = config(state, operator={"free_mb": None})
    rows = outbox.Outbox(state)
    store.post(alert("a"), ["mail"], NOW)
    rows.failed(1, "451 come back later", NOW)
    operator = Operator(store, state, settings, NOW, 0.0)
    assert operator.look(settings, settings.operator, NOW + HOUR, 0.0) == ()
    (told,) = operator.look(settings, settings.operator, NOW + 1.1 * HOUR, 0.0)
    assert "channel mail has not delivered" in told.title
    assert "451 come back later" in told.body
    assert [(u.alert, u.channel) for u in store.undelivered()] == [("a", "mail"), (told.id, "slack")]
    assert not operator.is_unheard(settings)

    rows.failed(2, "no", NOW)
    (second,) = operator.look(settings, settings.operator, NOW + 3 * HOUR, 0.0)
    assert "channel slack" in second.title
    assert operator.is_unheard(settings)
    for row in (1, 2):
        rows.delivered(row, NOW + 4 * HOUR)
    ended = operator.look(settings, settings.operator, NOW + 4 * HOUR, 0.0)
    assert sorted(a.title for a in ended) == [
        f"GLIDERWATCH {MACHINE}: channel mail does not fail any more",
        f"GLIDERWATCH {MACHINE}: channel slack does not fail any more",
    ]
    assert not operator.is_unheard(settings)
    rows.close()


def test_operators_hear_where_there_are_any_else_all(state: Path) -> None:
    recipients: dict[str, Any] = {
        "pilot": {"channels": ["mail"]},
        "boss": {"channels": ["slack"], "min_severity": "critical"},
    }
    assert list(channels(config(state, recipients=recipients), Severity.WARNING, "disk")) == ["mail"]
    recipients["boss"]["operator"] = True
    assert list(channels(config(state, recipients=recipients), Severity.WARNING, "disk")) == ["slack"]
    assert list(channels(config(state, recipients=recipients), Severity.WARNING, "channel/slack")) == []


# --------------------------------------------------------------------------- signs of life


def test_a_decoder_is_stuck_when_its_largest_file_should_have_been_done() -> None:
    decoding = Decoding()
    assert decoding.late(1e9) < 0, "it has nothing to do"
    decoding.expect(50_000_000)
    decoding.look(1, 1000.0)
    assert decoding.late(1000.0 + DECODING + 49) < 0
    assert decoding.late(1000.0 + DECODING + 51) > 0
    decoding.done(1100.0)
    assert decoding.late(1000.0 + DECODING + 51) < 0
    decoding.look(0, 1200.0)
    assert decoding.late(1e9) < 0
    decoding.look(1, 1200.0)
    assert decoding.late(1200.0 + DECODING + 1) > 0, "the large file is done"


def joined(beat: Heartbeat) -> None:
    """Wait for the thread of the last beat."""
    assert beat._thread is not None
    beat._thread.join(30)
    assert not beat._thread.is_alive()


def test_the_file_is_touched_when_due(tmp_path: Path) -> None:
    file = tmp_path / "alive"
    beat = Heartbeat(file, None, 60.0)
    beat.beat(100.0)
    joined(beat)
    file.unlink()
    beat.beat(159.0)
    joined(beat)
    assert not file.exists()
    beat.beat(160.0)
    joined(beat)
    assert file.exists()


def test_the_sign_stops_when_all_is_not_well_or_nobody_can_be_told(state: Path, store: Store) -> None:
    file = state.with_name("sign")
    settings = config(state, operator={"free_mb": None}, heartbeat={"file": str(file), "minutes": 1e-9})
    upkeep = Upkeep(settings, store)
    upkeep.use(settings)
    rows = outbox.Outbox(state)

    def is_given(is_well: bool = True) -> bool:
        file.unlink(missing_ok=True)
        upkeep.beat(is_well, 0)
        if upkeep._heartbeat._thread is not None:
            joined(upkeep._heartbeat)
        return file.exists()

    assert not is_given(is_well=False)
    assert is_given()
    store.post(alert("a"), ["mail", "slack"], time.time() - 2 * HOUR)
    rows.failed(1, "no", NOW)
    assert is_given(), "slack works"
    rows.failed(2, "no", NOW)
    assert not is_given()
    rows.delivered(1, NOW)
    assert is_given()
    rows.close()


def test_parts_that_make_no_progress_are_found(state: Path, store: Store) -> None:
    class Sending:
        is_alive, last = True, 0.0

        def alive(self) -> bool:
            return self.is_alive

        def progress(self) -> float:
            return time.monotonic() - self.last

    sending: Any = Sending()
    upkeep = Upkeep(config(state), store)
    upkeep.use(config(state))
    assert upkeep.is_well(sending, 0)
    sending.last = STALLED + 1
    assert not upkeep.is_well(sending, 0)
    sending.last, sending.is_alive = 0.0, False
    assert not upkeep.is_well(sending, 0)
    sending.is_alive = True
    upkeep._decoding.done(time.monotonic() - DECODING - 1)
    assert upkeep.is_well(sending, 0), "nothing is in work"
    upkeep._decoding.done(time.monotonic() - DECODING - 1)
    assert not upkeep.is_well(sending, 1)


class _Server(BaseHTTPRequestHandler):
    code = 200
    paths: list[str]

    def do_GET(self) -> None:
        self.paths.append(self.path)
        self.send_response(self.code)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        return


@pytest.fixture
def server() -> Iterator[tuple[HTTPServer, type[_Server]]]:
    handler = type("Handler", (_Server,), {"paths": []})
    made = HTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=made.serve_forever)
    thread.start()
    yield made, handler
    made.shutdown()
    made.server_close()
    thread.join()


def test_the_url_is_fetched_with_its_references_filled_in(
    state: Path, server: tuple[HTTPServer, type[_Server]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOKEN_OF_MINE", "s3cr3t-t0ken")
    url = f"http://127.0.0.1:{server[0].server_port}/ping/${{TOKEN_OF_MINE}}"
    beat = Heartbeat.of(config(state, heartbeat={"url": url, "minutes": 1}))
    beat.beat(0.0)
    joined(beat)
    assert server[1].paths == ["/ping/s3cr3t-t0ken"]


@pytest.mark.parametrize("path", ["ping/s3cr3t-t0ken", "ping s3cr3t-t0ken"])
def test_what_goes_wrong_is_told_without_secrets(server: tuple[HTTPServer, type[_Server]], path: str) -> None:
    server[1].code = 404
    address = f"http://user:s3cr3t-t0ken@127.0.0.1:{server[0].server_port}/{path}"
    told = heartbeat.fetch(address.replace("user:s3cr3t-t0ken@", "") if " " not in path else address)
    assert told is not None
    assert "127.0.0.1" in told
    assert "s3cr3t" not in told
    assert heartbeat.fetch("http://127.0.0.1:1/x") is not None


def test_a_server_that_hangs_holds_nothing_up() -> None:
    with socket.socket() as hanging:
        hanging.bind(("127.0.0.1", 0))
        hanging.listen()
        beat = Heartbeat(None, f"http://127.0.0.1:{hanging.getsockname()[1]}/", 10.0)
        beat.beat(0.0)
        first = beat._thread
        beat.beat(10.0)
        assert beat._thread is first, "the one before has not come back: no second thread"
        connection, _ = hanging.accept()
        connection.close()
        joined(beat)
        beat.beat(20.0)
        assert beat._thread is not first
        connection, _ = hanging.accept()
        connection.close()
        joined(beat)
