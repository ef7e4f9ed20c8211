"""Acknowledgements, mutes by command, copies: what holds, until when, and what is left behind."""

from __future__ import annotations

import os
import sqlite3
import time as clock
from contextlib import closing
from dataclasses import replace
from datetime import UTC, time
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from alert_support import DISAGREE, SLOW, alert, incident
from dives_by_letters import Talk, World
from gliderwatch.cli import manage, tables
from gliderwatch.cli.status import (
    acknowledge_incident,
    give_incident_back,
    incident_entries,
    overview,
    status_as_json,
)
from gliderwatch.config import Config, load
from gliderwatch.errors import GliderwatchError, StateError
from gliderwatch.incidents.acknowledgement import acknowledge, with_mute
from gliderwatch.incidents.notifications import NotificationState, Thread, as_notified, due_notifications
from gliderwatch.incidents.send_schedule import QuietHours, Wait
from gliderwatch.model import Call, Fix, Kind, Severity
from gliderwatch.params import Attention
from gliderwatch.service import transaction
from gliderwatch.service.routing import NOBODY, post_alerts
from gliderwatch.store import maintenance
from gliderwatch.store.database import MEMORY
from gliderwatch.store.state_file import Store
from gliderwatch.store.watch_health import failing

NOW = 1_700_000_000.0


@pytest.fixture
def config(tmp_path: Path) -> Config:
    """Of a glider electa whose state holds one open incident and one that is over."""
    path = tmp_path / "gliderwatch.yml"
    places = f"dockserver: {{roots: [{tmp_path}]}}\nstate: {{path: {tmp_path}/state.sqlite}}\n"
    path.write_text(f"{places}gliders: {{electa: }}\n", encoding="utf-8")
    store = Store.open(tmp_path / "state.sqlite")
    over = incident(id="electa/anomaly/1", opened_at=1.0, cleared_at=2.0)
    for i in (over, incident()):
        put_incident(store, i)
    store._db.execute(
        "INSERT INTO segments VALUES ('electa', 0, 'electa-1', '[0, 0, \"\"]', 0, 0, 0, 0, x'00', NULL)"
    )
    store.close()
    return load(path)


def put_incident(store: Store, i: object) -> None:
    from gliderwatch.store import codec

    row = (i.id, i.glider, i.opened_at, i.cleared_at, codec.plain_encode(i))  # type: ignore[attr-defined]
    store._db.execute("INSERT INTO incidents VALUES (?, ?, ?, ?, ?)", row)


class TestAcknowledged:
    def test_reminders_stop_and_the_all_clear_comes(self) -> None:
        notified = {
            taken_on: self._kinds("0" + "1" * 30, "0" + "1" * 30 + "00", taken_on) for taken_on in (0, 1)
        }
        assert notified[0] == ["anomaly", "reminder", "reminder", "all_clear"]  # after 1 and 2 days
        assert notified[1] == ["anomaly", "all_clear"]

    def test_they_come_again_when_it_grows_worse(self) -> None:
        assert self._kinds("0" + "1" * 12, "0" + "1" * 12 + "S", 1) == ["anomaly", "reminder"]

    def _kinds(self, letters: str, end: str, taken_on: int) -> list[str]:
        talk = Talk(reminder_hours=24.0)
        kinds = talk.update(letters[:3])
        (opened,) = World.of(letters[:3]).incidents()
        acks = {opened.id: acknowledge(opened, "ann", "", 0.0)} if taken_on else {}
        for facts in [World.of(letters[:n]) for n in range(4, len(letters) + 1)] + [World.of(end)]:
            talk.notified, new = due_notifications(talk.notified, facts, talk.reminder_hours, False, acks)
            kinds += [str(a.kind) for a in new]
        return kinds

    def test_it_holds_when_late_data_change_the_id(self) -> None:
        """The dive before the first flagged one comes late, and is flagged too."""
        talk, letters = Talk(reminder_hours=24.0), "0 11" + "1" * 20
        talk.update(letters[:5])
        (opened,) = World.of(letters[:5]).incidents()
        acks = {opened.id: acknowledge(opened, "ann", "", 0.0)}
        for n in range(6, len(letters) + 1):
            facts = World.of("01" + letters[2:n])
            assert {i.id for i in facts.incidents()}.isdisjoint(acks)
            talk.notified, new = due_notifications(talk.notified, facts, 24.0, False, acks)
            assert "reminder" not in {str(a.kind) for a in new}

    @pytest.mark.parametrize(
        ("changes", "holds"),
        [
            ({}, True),
            ({"worst": replace(SLOW, speed=0.111)}, True),
            ({"dives": 40}, True),
        ],
    )
    def test_what_is_worse(self, changes: dict[str, object], holds: bool) -> None:
        assert acknowledge(incident(), "ann", "", 0.0).holds(replace(incident(), **changes)) is holds  # type: ignore[arg-type]

    @pytest.mark.parametrize(("speed", "holds"), [(0.148, True), (0.145, False)])
    def test_below_two_thirds_of_the_lower_bound_is_worse(self, speed: float, holds: bool) -> None:
        mild = incident(worst=replace(SLOW, speed=0.15))
        worse = incident(worst=replace(SLOW, speed=speed))  # the bound is 0.22
        assert acknowledge(mild, "ann", "", 0.0).holds(worse) is holds

    def test_worse_by_severity_speed_and_flow_error(self) -> None:
        mild = incident(severity=Severity.WARNING)
        assert not acknowledge(mild, "ann", "", 0.0).holds(incident())
        fast = incident(worst=replace(SLOW, speed=0.40))
        for speed, holds in ((0.44, True), (0.46, False)):
            now = incident(worst=replace(SLOW, speed=speed))
            assert acknowledge(fast, "ann", "", 0.0).holds(now) is holds
        flow = incident(worst=DISAGREE, kind=Kind.FALSE_ALARM)
        for error, holds in ((0.50, True), (0.53, False)):
            now = replace(flow, worst=replace(DISAGREE, p_e=error))
            assert acknowledge(flow, "ann", "", 0.0).holds(now) is holds

    def test_the_same_once_more_changes_nothing(self, config: Config) -> None:
        first, is_new = acknowledge_incident(config, "electa/anomaly/1667639520", "ann", "on it", NOW)
        again, is_new_again = acknowledge_incident(
            config, "electa/anomaly/1667639520", "ann", "on it", NOW + 60
        )
        assert (is_new, is_new_again) == (True, False)
        (kept,) = incident_entries(config)
        assert kept == again == first
        assert kept.ack is not None
        assert (kept.ack.by, kept.ack.note, kept.ack.at) == ("ann", "on it", NOW)

    def test_another_note_takes_its_place(self, config: Config) -> None:
        acknowledge_incident(config, "electa/anomaly/1667639520", "ann", "", NOW)
        noted, is_new = acknowledge_incident(config, "electa/anomaly/1667639520", "bob", "mine now", NOW + 60)
        assert is_new
        assert incident_entries(config) == [noted]

    def test_the_glider_is_enough_the_others_hear_of_it_and_it_can_be_undone(self, config: Config) -> None:
        noted, is_new = acknowledge_incident(config, "electa", "ann", "on it", NOW)
        assert is_new and noted.incident.id == "electa/anomaly/1667639520"
        given = give_incident_back(config, "electa", "ann", "", NOW + 60)
        assert given.ack is None and incident_entries(config) == [given]
        with manage.reading(config) as store:
            made = [a for a in store.alerts() if a.kind is Kind.ACKNOWLEDGED]
        assert [a.title for a in made] == [
            "electa ann is on it (anomaly)",
            "electa given back by ann (anomaly)",
        ]
        assert {a.incident for a in made} == {noted.incident.id}
        with pytest.raises(GliderwatchError, match="nothing to undo"):
            give_incident_back(config, "electa", "ann", "", NOW + 90)

    @pytest.mark.parametrize("identity", ["electa/anomaly/7", "electa/anomaly/1", ""])
    def test_what_is_not_open_is_refused_with_what_is(self, config: Config, identity: str) -> None:
        with pytest.raises(GliderwatchError, match=r"open are:\n  electa/anomaly/1667639520$"):
            acknowledge_incident(config, identity, "ann", "", NOW)
        assert [n.ack for n in incident_entries(config, every=True)] == [None, None]


def test_incidents_of_one_glider_or_all_open_or_every(config: Config) -> None:
    assert [n.incident.id for n in incident_entries(config)] == ["electa/anomaly/1667639520"]
    assert next(n.incident.id for n in incident_entries(config, "Electa", every=True)) == "electa/anomaly/1"
    with pytest.raises(GliderwatchError, match="there is no glider elekta; known are: electa"):
        incident_entries(config, "elekta")


class TestAsTold:
    """After all was assessed anew: what was said, as of what is known now."""

    @staticmethod
    def _told_anew(before: str, after: str) -> tuple[list[str], list[str]]:
        """Messages after other code sees other dives: with and without `as_told`."""
        talk, without = Talk(), Talk()
        for n in range(1, len(before) + 1):
            talk.update(before[:n])
            without.update(before[:n])
        talk.notified = as_notified(talk.notified, World.of(after))
        return talk.update(after), without.update(after)

    @pytest.mark.parametrize(
        ("before", "after", "without"),
        [
            ("0110000", "0000000", ["correction"]),  # over, and never was
            ("0110000", "0111000", ["correction"]),  # over, and ended later
            ("0011111", "001S111", ["correction"]),  # open, at another speed
            ("0000000", "0110000", ["all_clear"]),  # was never reported, and is over
            ("0011111", "1111111", ["correction"]),  # open, and began earlier
        ],
    )
    def test_what_is_over_or_as_it_was_is_told_to_nobody(
        self, before: str, after: str, without: list[str]
    ) -> None:
        assert self._told_anew(before, after) == ([], without)

    @pytest.mark.parametrize(
        ("before", "after", "told"),
        [
            ("0000000", "0000111", ["anomaly"]),
            ("0000111", "0000000", ["correction"]),
            ("0111111", "0111100", ["all_clear"]),
            ("0111100", "0111111", ["correction"]),
        ],
    )
    def test_what_matters_now_is_told(self, before: str, after: str, told: list[str]) -> None:
        assert self._told_anew(before, after) == (told, told)


class TestMute:
    @pytest.mark.parametrize(
        ("date", "hours", "end"),
        [
            ("2023-11-15", None, 1_700_006_400.0),
            ("2023-11-15 01:00", None, 1_700_010_000.0),
            (None, 2, NOW + 7200),
        ],
    )
    def test_ends_by_date_or_after_hours(self, date: str | None, hours: float | None, end: float) -> None:
        assert manage.end_of_mute(date, hours, NOW) == end

    @pytest.mark.parametrize(
        ("date", "hours", "told"),
        [
            (None, None, "either --until DATE"),
            ("2023-11-15", 2.0, "either --until DATE"),
            ("tomorrow", None, "--until must be a date"),
            ("2023-02-30", None, "is no date that exists"),
            ("2023-11-14", None, "past"),
            (None, 0.0, "past"),
            (None, -3.0, "past"),
            (None, float("nan"), "past"),
            (None, float("inf"), "past"),
            ("2033-11-14", None, "recovered: true"),
        ],
    )
    def test_other_ends_are_refused(self, date: str | None, hours: float | None, told: str) -> None:
        with pytest.raises(GliderwatchError, match=told):
            manage.end_of_mute(date, hours, NOW)

    @pytest.mark.parametrize(
        ("configured", "told", "counts"),
        [(None, 5.0, 5.0), (5.0, None, 5.0), (5.0, 9.0, 9.0), (9.0, 5.0, 9.0)],
    )
    def test_the_later_counts(self, configured: float | None, told: float | None, counts: float) -> None:
        store = Store.open(MEMORY)
        if told is not None:
            store.notes.mute("electa", told, 0.0)
        heeded = with_mute(Attention(2.0, configured, True), store.notes.muted_until("electa"))
        assert heeded == Attention(2.0, counts, True)
        assert with_mute(Attention(), store.notes.muted_until("other")) == Attention()

    def test_puts_off_what_is_told_of_silence(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(transaction.overdue, "next_tick", lambda *_: 100.0)
        store = Store.open(MEMORY)
        assert transaction.next_tick(store, "electa", NOBODY, 0.0) == 100.0
        store.notes.mute("electa", 500.0, 0.0)
        assert transaction.next_tick(store, "electa", NOBODY, 0.0) == 500.0
        store.notes.unmute("electa", 50.0)
        assert transaction.next_tick(store, "electa", NOBODY, 0.0) == 100.0

    def test_is_taken_back(self, config: Config) -> None:
        manage.mute_glider(config, "ELECTA", NOW + 60, NOW)
        assert manage.unmute_glider(config, "electa", NOW) == ["electa: not muted any more"]
        assert manage.unmute_glider(config, "electa", NOW) == ["electa: was not muted"]

    def test_is_only_of_gliders_that_are_known(self, config: Config) -> None:
        with pytest.raises(GliderwatchError, match=r"no glider elekta.*known are: electa"):
            manage.mute_glider(config, "elekta", NOW + 60, NOW)

    def test_what_the_configuration_mutes_no_command_undoes(self, config: Config, tmp_path: Path) -> None:
        path = tmp_path / "gliderwatch.yml"
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("electa: ", "electa: {muted_until: 2023-12-01}"), encoding="utf-8")
        muted = load(path)
        assert manage.mute_glider(muted, "electa", NOW + 60, NOW)[1:] == [
            "muted_until of the configuration is later and counts: 2023-12-01 00:00 UTC"
        ]
        with pytest.raises(GliderwatchError, match=r"2023-12-01.*systemctl reload gliderwatch"):
            manage.unmute_glider(muted, "electa", NOW)


class TestWaiting:
    """Who waits for an acknowledgement, and what `ack`, `mute` and `status` do about it."""

    @pytest.fixture(autouse=True)
    def held(self, config: Config) -> None:
        """An alert that the duty pilot got and that waits for the chief; a notice that waits for morning."""
        quiet = QuietHours(time(22), time(7), UTC, Severity.CRITICAL)
        waits = {"mail": [Wait()], "sms": [Wait(after=1800.0)]}
        notified = NotificationState((Thread(incident().id, incident(), incident().last, 1, 0.0),))
        with closing(Store.open(Path(config.state.path))) as store:
            post_alerts(store, "electa", notified, [alert()], lambda a: waits, NOW)
            notice = alert("n", incident="", audience=Severity.INFO)
            post_alerts(store, "electa", notified, [notice], lambda a: {"post": [Wait(quiet=quiet)]}, NOW)

    def waiting(self, config: Config) -> list[tuple[str, str]]:
        with closing(Store.reading(Path(config.state.path))) as store:
            return [(u.alert, u.channel) for u in store.undelivered()]

    def test_an_acknowledgement_withdraws_what_waits_for_it(self, config: Config) -> None:
        assert self.waiting(config) == [("a1", "mail"), ("a1", "sms"), ("n", "post")]
        acknowledge_incident(config, incident().id, "ann", "", NOW + 60)
        assert self.waiting(config) == [("a1", "mail"), ("n", "post")]

    def test_so_does_a_mute(self, config: Config) -> None:
        manage.mute_glider(config, "electa", NOW + 3600, NOW + 60)
        assert self.waiting(config) == [("a1", "mail"), ("n", "post")]

    def test_what_comes_after_it_is_for_who_was_told(self, config: Config) -> None:
        acknowledge_incident(config, incident().id, "ann", "", NOW + 60)
        with closing(Store.open(Path(config.state.path))) as store:
            correction = [alert("a2", kind=Kind.CORRECTION)]
            post_alerts(
                store,
                "electa",
                store.notified("electa"),
                correction,
                lambda a: {"sms": [Wait(after=1.0)]},
                NOW,
            )
        assert self.waiting(config) == [("a1", "mail"), ("n", "post")]

    def test_status_tells_what_is_held_and_that_it_is_no_trouble(
        self, config: Config, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("gliderwatch.cli.status.time.time", lambda: NOW + 60)
        view = overview(config)
        assert [u.channel for u in view.undelivered] == ["mail"]
        assert status_as_json(view)["held"] == [
            {
                "alert": "a1",
                "channel": "sms",
                "until": "2023-11-14T22:43:20.000Z",
                "unless_acknowledged": True,
            },
            {
                "alert": "n",
                "channel": "post",
                "until": "2023-11-15T07:00:00.000Z",
                "unless_acknowledged": False,
            },
        ]
        console = Console(file=StringIO(), width=200)
        tables.status(view, console)
        assert isinstance(console.file, StringIO)
        assert [line for line in console.file.getvalue().splitlines() if line.startswith("held")] == [
            "held until 2023-11-14 22:43 UTC, unless acknowledged: a1 by sms",
            "held until 2023-11-15 07:00 UTC (quiet hours): n by post",
        ]


class TestBackup:
    def test_is_whole_and_alone(self, config: Config, tmp_path: Path) -> None:
        target = tmp_path / "copies" / "copy.sqlite"
        target.parent.mkdir()
        writer = Store.open(tmp_path / "state.sqlite")
        with writer.transaction():  # what is not committed is not in the copy, and holds nobody up
            writer.notes.mute("electa", 9.0, 0.0)
            assert maintenance.backup(Path(config.state.path), target) == target.stat().st_size
        writer.close()
        assert [p.name for p in target.parent.iterdir()] == ["copy.sqlite"]
        copy = Store.reading(target)
        assert len(copy.incidents("electa")) == 2
        assert copy.notes.muted_until("electa") is None
        copy.close()
        assert target.stat().st_mode == (tmp_path / "state.sqlite").stat().st_mode

    @pytest.mark.parametrize("kind", ["file", "folder", "link"])
    def test_never_overwrites(self, config: Config, tmp_path: Path, kind: str) -> None:
        target = tmp_path / "copy"
        if kind == "file":
            target.write_text("precious", encoding="utf-8")
        elif kind == "folder":
            target.mkdir()
        else:
            target.symlink_to(tmp_path / "nowhere")
        with pytest.raises(GliderwatchError, match="is there already"):
            maintenance.backup(Path(config.state.path), target)
        assert kind != "file" or target.read_text(encoding="utf-8") == "precious"
        assert not (tmp_path / "nowhere").exists()

    def test_not_even_what_came_meanwhile(
        self, config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        target = tmp_path / "copy"
        monkeypatch.setattr(
            maintenance, "_sync", lambda path: target.write_text("precious", encoding="utf-8")
        )
        with pytest.raises(GliderwatchError, match="is there now"):
            maintenance.backup(Path(config.state.path), target)
        assert target.read_text(encoding="utf-8") == "precious"
        assert not (tmp_path / "copy.part").exists()

    def test_of_a_damaged_state_is_not_kept(self, config: Config, tmp_path: Path) -> None:
        state = tmp_path / "state.sqlite"
        with sqlite3.connect(state) as db:
            db.execute("PRAGMA journal_mode = DELETE")
            root = db.execute("SELECT rootpage FROM sqlite_schema WHERE name = 'incidents'").fetchone()[0]
            size = db.execute("PRAGMA page_size").fetchone()[0]
        data = bytearray(state.read_bytes())
        data[(root - 1) * size : root * size] = os.urandom(size)
        state.write_bytes(data)
        with pytest.raises(StateError, match=r"not whole.*set.* aside"):
            maintenance.backup(Path(config.state.path), tmp_path / "copy")
        assert not list(tmp_path.glob("copy*"))

    def test_into_a_folder_that_is_not_there_is_refused(self, config: Config, tmp_path: Path) -> None:
        with pytest.raises(GliderwatchError, match=r"No such file or directory\. Name another place"):
            maintenance.backup(Path(config.state.path), tmp_path / "nowhere" / "copy")


def test_a_state_of_an_earlier_release_is_read_but_not_written(config: Config, tmp_path: Path) -> None:
    path = tmp_path / "state.sqlite"
    with closing(Store.open(path)) as store:
        store.post(alert(), ["mail"], NOW)
    with sqlite3.connect(path) as db:
        db.executescript(
            "DROP TABLE mutes; DROP TABLE acks; DROP INDEX outbox_by_delivery; PRAGMA user_version = 2;"
            "ALTER TABLE outbox DROP COLUMN held_until; ALTER TABLE outbox DROP COLUMN escalates;"
            "ALTER TABLE outbox DROP COLUMN delivery; ALTER TABLE files DROP COLUMN hindrance;"
            "DROP INDEX files_by_segment; DROP TABLE calls; DROP TABLE health; DROP TABLE field_settings;"
            "DROP TABLE field_batches; DROP TABLE field_checkpoints; DROP TABLE field_soundings;"
            "DROP TABLE field_advice; DROP TABLE layers; DROP TABLE relays;"
        )
    assert [u.held_until for u in overview(config).undelivered] == [0.0]
    assert failing(path, NOW) == {}
    assert [n.ack for n in incident_entries(config)] == [None]
    with pytest.raises(StateError, match="systemctl restart gliderwatch"):
        manage.mute_glider(config, "electa", NOW + 60, NOW)
    Store.open(path).close()
    assert manage.mute_glider(config, "electa", NOW + 60, NOW) == ["electa: muted until 2023-11-14 22:14 UTC"]


def test_status_tells_what_a_later_call_told_and_the_files_that_never_came(
    config: Config, tmp_path: Path
) -> None:
    now = clock.time()
    call = Call(
        "electa",
        "electa.log",
        now - 9000,
        now - 8000,
        fix=Fix(now - 9050, 61.5, 2.5),
        waypoint=(61.25, 2.75),
        reason="timeout expired",
        segment="electa-2022-308-3-2",
        short="01030002",
        announced=("01030002.sbd", "01030001.tbd"),
    )
    with closing(Store.open(tmp_path / "state.sqlite")) as store:
        store.calls.keep("/x/electa.log", call, "{}", now)
    view = status_as_json(overview(config))["gliders"]["electa"]
    assert view["last_call"]["fix"]["lat"] == 61.5 and view["last_call"]["because"] == "timeout expired"
    assert [each["file"] for each in view["announced_and_not_come"]] == ["01030002.sbd"]
