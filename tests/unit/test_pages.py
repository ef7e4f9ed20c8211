"""Pages: what they say of a glider, that nothing in them is foreign, and that they are always whole."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.figures.coast import world
from gliderwatch.fleet.cross_check import Fault
from gliderwatch.health.battery import End
from gliderwatch.health.rule import Finding
from gliderwatch.incidents.aborts import Episode
from gliderwatch.incidents.acknowledgement import acknowledge
from gliderwatch.incidents.calls import CallsWithoutFile
from gliderwatch.incidents.health import HealthThread
from gliderwatch.incidents.neighbours import Comparison
from gliderwatch.incidents.notices import AbortReport, HealthIncident
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.incidents.overdue import ExpectedCall
from gliderwatch.incidents.unjudged import UnjudgedThread
from gliderwatch.incidents.whereabouts import whereabouts
from gliderwatch.messages.samples import SAMPLES
from gliderwatch.model import (
    Alert,
    Assessment,
    Call,
    Fix,
    Happening,
    Incident,
    Kind,
    NextSurfacing,
    Severity,
)
from gliderwatch.navigation.geodesy import to_plane
from gliderwatch.pages import facts, writing
from gliderwatch.pages.reading import SHOWN
from gliderwatch.pages.render import Frame, file_of, fleet_page, glider_page, page_policy, sheet_page, summary
from gliderwatch.pages.view import GliderView, verdict, worst_first
from gliderwatch.params import Attention

NOW = 1_700_000_000.0
HOUR = 3600.0
HOSTILE = '<script>alert(1)</script>"><img src=http://evil.example/x onerror=alert(1)>'


def dive(hours_ago: float = 0.5, **changes: object) -> Assessment:
    made = Assessment(
        glider="electa",
        segment="electa-2023-300-1-1",
        t_dive=NOW - (hours_ago + 3) * HOUR,
        t_surface=NOW - hours_ago * HOUR,
        lat=24.21,
        lon=-83.01 + 0.02 * hours_ago,
        flag=0,
        reason="",
        speed=0.25,
        speed_min=0.2,
        speed_max=0.32,
        flow_u=0.1,
        flow_v=0.05,
        reference_u=0.1,
        reference_v=0.04,
        reference_final=True,
        p_e=0.02,
        gamma_f=0.3,
        clle_max=None,
        excitation=None,
        n_samples=100,
        evidence={"duration_h": 3.0, "speed_sigma": 0.02, "roll_mean": 0.03, "depth_max": 190.0},
        notes=(),
        parameters="",
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def view(**changes: object) -> GliderView:
    dives = tuple(dive(3.5 * k + 0.5) for k in reversed(range(6)))
    expected = NextSurfacing(NOW - 0.5 * HOUR, NOW + 3 * HOUR, 900.0, 24.25, -82.95, 1e6, 2e5, 8e5, "test")
    awaited = ExpectedCall(NOW - 0.5 * HOUR, NOW + 3 * HOUR, NOW + 7 * HOUR, 3.5 * HOUR)
    made = GliderView("electa", NOW, dives, expected=expected, awaited=awaited)
    return replace(made, **changes)  # type: ignore[arg-type]


def incident(kind: Kind = Kind.ANOMALY, **changes: object) -> Incident:
    slow = dive(flag=1, speed=0.12)
    made = Incident(
        "electa/anomaly/1",
        "electa",
        kind,
        Severity.CRITICAL,
        slow.t_dive,
        slow.t_surface,
        None,
        2,
        slow,
        slow,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def aborted() -> NotificationState:
    told = AbortReport(Happening.ABORTING, NOW - HOUR, "LEAK", Severity.CRITICAL)
    return NotificationState(aborts=(Episode("electa/abort/1", (told,), 1, NOW - HOUR),))


LATE = ExpectedCall(NOW - 9 * HOUR, NOW - 5 * HOUR, NOW - HOUR, 3.5 * HOUR)


@pytest.mark.parametrize(
    ("changes", "word", "colour"),
    [
        ({}, "NORMAL", "ok"),
        ({"incidents": (incident(),)}, "SLOW", "bad"),
        ({"incidents": (incident(last=dive(speed=0.5)),)}, "FAST", "bad"),
        ({"incidents": (incident(Kind.FALSE_ALARM),)}, "DISAGREES", "warn"),
        ({"incidents": (incident(cleared_at=NOW),)}, "NORMAL", "ok"),
        ({"awaited": LATE, "incidents": (incident(),)}, "OVERDUE", "bad"),
        ({"awaited": replace(LATE, due=NOW + HOUR)}, "LATE", "warn"),
        ({"notified": aborted(), "awaited": LATE}, "ABORTED", "bad"),
        ({"dives": (dive(flag=1, reason="slow"),)}, "WATCH", "warn"),
        ({"dives": (dive(flag=None, reason="no heading"),)}, "NO FLAG", "quiet"),
        ({"dives": (), "expected": None, "awaited": None}, "NO DIVE YET", "quiet"),
        ({"attention": Attention(recovered=True), "incidents": (incident(),)}, "RECOVERED", "quiet"),
        ({"now": NOW + 40 * 86400.0, "incidents": (incident(),)}, "OVER", "quiet"),
    ],
)
def test_the_worst_is_said_in_a_word(changes, word, colour):
    found = verdict(view(**changes))
    assert (found.word, found.colour) == (word, colour)


def test_the_fleet_is_worst_first_and_what_is_over_last():
    views = (
        view(name="a-well"),
        view(name="b-recovered", attention=Attention(recovered=True)),
        view(name="c-overdue", awaited=LATE),
        view(name="d-slow", incidents=(incident(),)),
        view(name="e-aborted", notified=aborted()),
    )
    assert [v.name for v, _ in worst_first(views)] == [
        "e-aborted",
        "c-overdue",
        "d-slow",
        "a-well",
        "b-recovered",
    ]
    assert summary([verdict(v) for v in views]) == "5 gliders: 3 in trouble"


def found(
    rule: str = "leak", severity: Severity = Severity.CRITICAL, *, is_over: bool = False
) -> NotificationState:
    finding = Finding(rule, severity, NOW - 2 * HOUR, "leak detector at 2.1 V, twice in a row below 2.3 V")
    made = HealthIncident(
        f"electa/health/{rule}/1",
        "electa",
        rule,
        severity,
        NOW - 2 * HOUR,
        NOW - HOUR,
        None,
        finding,
        finding,
    )
    return NotificationState(health=(HealthThread(made.id, made, 1, NOW - HOUR, is_over),))


@pytest.mark.parametrize(
    ("state", "word", "colour"),
    [
        (found(), "LEAK", "bad"),
        (found("battery_end", Severity.WARNING), "BATTERY END", "warn"),
        (found(is_over=True), "NORMAL", "ok"),
        (NotificationState(empty=CallsWithoutFile("electa/call/1", NOW - HOUR, 3, 1)), "NO FILES", "warn"),
        (
            NotificationState(unknown=UnjudgedThread("electa/unknown/1", NOW - HOUR, 1, NOW)),
            "NOT JUDGED",
            "warn",
        ),
        (
            NotificationState(neighbours=Comparison(NOW, Fault.LOSS, "electa/neighbours/1", NOW)),
            "NEIGHBOURS",
            "warn",
        ),
    ],
)
def test_what_is_beside_the_flight_is_in_the_word_too(state, word, colour):
    one = view(notified=state)
    assert (verdict(one).word, verdict(one).colour) == (word, colour)
    page = glider_page(one, Frame(NOW, NOW + 900), world())
    assert ("Nobody has it." in page) == (word in {"LEAK", "BATTERY END", "NO FILES"})


def test_what_goes_on_beside_the_worst_is_named_too():
    one = view(incidents=(incident(),), notified=replace(aborted(), health=found().health))
    page = glider_page(one, Frame(NOW, NOW + 900), world())
    for words in (
        "It fell out of its mission: LEAK.",
        "anomaly since 18:43. Nobody has it.",
        "leak since 20:13.",
    ):
        assert words in page, words
    assert page.count('<rect class="bad open"') == 3  # its timeline


def test_the_days_of_the_battery_count_from_now():
    end = End(NOW - 86400.0, 11 * 86400.0, 8 * 86400.0, 15 * 86400.0, "battery_charge")
    (fact,) = facts.battery(view(battery=end))
    assert fact.text == "10 days left (7 to 14)"
    (fact,) = facts.battery(view(battery=replace(end, latest=np.inf)))
    assert fact.text == "10 days left (7 to more)"
    (fact,) = facts.battery(view(battery=replace(end, left=3600.0)))
    assert fact.text.startswith("empty since")


def test_a_glider_that_aborted_drifts_from_its_last_fix():
    t = NOW - HOUR / 4
    call = Call("electa", "x.log", t, t, fix=Fix(t, 24.0, -83.0))
    where = view(calls=(call,), notified=aborted()).whereabouts(HOUR)
    assert where is not None
    east, north = to_plane(where.lat, where.lon, 24.0, -83.0)
    assert (east, north) == pytest.approx((0.1 * 4500, 0.05 * 4500), rel=0.02)


# --------------------------------------------------------------------------- where it is


def test_between_two_surfacings_it_is_on_the_way_and_the_error_grows_in_step():
    e = view().expected
    assert e is not None
    places = [
        whereabouts(e, (24.21, -83.0), (0.1, 0.0), e.t + HOUR, e.after + k * (e.t - e.after))
        for k in (0.0, 0.5, 1.0)
    ]
    first, half, last = (p for p in places if p is not None)
    assert (first.lat, first.lon) == pytest.approx((24.21, -83.0), abs=1e-9)
    assert (last.lat, last.lon) == pytest.approx((e.lat, e.lon), abs=1e-6)
    assert to_plane(half.lat, half.lon, 24.21, -83.0) * 2 == pytest.approx(
        to_plane(e.lat, e.lon, 24.21, -83.0), rel=1e-3
    )
    assert first.major < half.major < last.major
    # the ellipse of the surfacing that is expected: its longer axis is that of its covariance
    cov = np.array([[e.east, e.cross], [e.cross, e.north]])
    assert last.major == pytest.approx(np.sqrt(5.991 * np.linalg.eigvalsh(cov)[1]), rel=0.01)


def test_a_glider_that_is_overdue_drifts_with_the_current():
    e, after = view().expected, 10 * HOUR
    assert e is not None
    found = whereabouts(e, (24.21, -83.0), (0.2, 0.0), e.t + HOUR, e.t + after)
    assert found is not None
    east, north = to_plane(found.lat, found.lon, e.lat, e.lon)
    assert east == pytest.approx(0.2 * after, rel=0.01)
    assert abs(north) < 50.0


# --------------------------------------------------------------------------- what stands in a page


class Seen(HTMLParser):
    """The elements of a page, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def hostile() -> GliderView:
    """A glider whose every text is an attack."""
    bad = incident(id=HOSTILE, glider=HOSTILE)
    alert = Alert(
        HOSTILE, HOSTILE, NOW, Kind.ANOMALY, Severity.CRITICAL, Severity.CRITICAL, HOSTILE, *(HOSTILE,) * 3
    )
    call = Call(
        HOSTILE,
        HOSTILE,
        NOW - HOUR,
        NOW - HOUR,
        fix=Fix(NOW - HOUR, 24.2, -83.0),
        reason=HOSTILE,
        mission=HOSTILE,
    )
    ack = acknowledge(bad, HOSTILE, HOSTILE, NOW)
    return view(
        name=HOSTILE,
        dives=(dive(flag=None, reason=HOSTILE), dive(0.2, reason=HOSTILE)),
        incidents=(bad,),
        acks={bad.id: ack},
        alerts=(alert, alert),
        calls=(call,),
        log=f"error {HOSTILE}\n{HOSTILE}",
        waypoint=(24.5, -82.9),
    )


def all_pages(one: GliderView) -> list[str]:
    frame = Frame(NOW, NOW + 900.0)
    return [
        fleet_page((one, view(name="other")), frame, world()),
        glider_page(one, frame, world()),
        sheet_page(one, frame, world()),
    ]


@pytest.mark.parametrize("one", [hostile(), view(awaited=LATE, incidents=(incident(),))])
def test_no_page_asks_another_host_or_runs_what_came_in_a_file(one):
    for page in all_pages(one):
        seen = Seen(page)
        assert [tag for tag, _ in seen.tags].count("script") == 1
        assert not [tag for tag, _ in seen.tags if tag in {"img", "link", "iframe", "object", "base"}]
        for tag, attributes in seen.tags:
            assert not [name for name in attributes if name.startswith("on") or name == "style"], tag
            for name in ("src", "href", "action", "xlink:href"):
                target = attributes.get(name) or ""
                is_map = tag == "a" and target.startswith("https://www.openstreetmap.org/?mlat=")
                assert is_map or not re.match(r"[a-z]+:|//", target), (tag, target)
        assert f'content="{page_policy()}"' in page.replace("&#39;", "'")
        assert len(page) < 150_000


def test_a_page_answers_what_a_pilot_asks():
    call = Call("electa", "x.log", NOW - 2000, NOW - 1800, fix=Fix(NOW - 1900, 24.2, -83.0), reason="leak")
    message = replace(SAMPLES[Kind.ANOMALY](NOW), incident="electa/anomaly/1")
    one = view(incidents=(incident(),), alerts=(message,), calls=(call,), waypoint=(24.5, -82.9))
    text = " ".join(" ".join(Seen(glider_page(one, Frame(NOW, NOW + 900), world())).text).split())
    for words in (
        "electa SLOW",
        "0.12 m/s through the water, normal is 0.20-0.32 m/s",
        "Since 18:43, 3.5 h. Nobody has it.",
        "What to do",
        "As of 2023-11-14 22:13 UTC",
        "stale at 22:28",
        "24° 12.600' N, 083° 00.000' W 24.21000, -83.00000 map",
        "Next call 15 Nov 01:13 ± 29 min",
        "in 3.0 h",
        "leak",
        "sudo -u gliderwatch gliderwatch ack electa",
        message.title,
    ):
        assert words in text, words


def test_a_glider_not_heard_for_years_is_nowhere_and_nothing_is_to_be_done():
    message = replace(SAMPLES[Kind.ANOMALY](NOW), incident="electa/anomaly/1")
    one = replace(view(incidents=(incident(),), alerts=(message,)), now=NOW + 900 * 86400.0)
    page = glider_page(one, Frame(one.now, one.now + 900, live="events"), world())
    assert one.is_over and one.whereabouts() is None
    words = " ".join(" ".join(Seen(page).text).split())
    assert "OVER" in words and "Last fix" in words
    assert "Now about" not in words and '<div class="do">' not in page
    assert "daily sheet explore" in words  # one link beside the other


def test_an_acknowledgement_is_seen():
    one = incident()
    acks = {one.id: acknowledge(one, "Ann", "on it", NOW)}
    page = glider_page(view(incidents=(one,), acks=acks), Frame(NOW, NOW + 900), world())
    assert "Ann has it." in page
    assert "Ann: on it" in page


def test_the_pages_of_a_long_mission_stay_small():
    names = (
        "pitch_dive",
        "pitch_climb",
        "roll_std",
        "ballast_dive",
        "ballast_climb",
        "vacuum",
        "across_misfit",
    )
    names += ("across_sigma", "depth_rate_dive", "depth_rate_climb", "own_speed", "depth_max", "speed_sigma")
    evidence = [{name: 0.1 + 0.01 * ((k * len(name)) % 17) for name in names} for k in range(SHOWN)]
    dives = tuple(dive(3.0 * (SHOWN - k), evidence=evidence[k]) for k in range(SHOWN))
    many = view(dives=dives, incidents=tuple(incident(id=f"i{k}", cleared_at=NOW) for k in range(40)))
    assert max(map(len, all_pages(many))) < 150_000


def test_fifty_gliders_fit_in_one_page():
    names = [f"unit_{k:04d}" for k in range(50)]
    page = fleet_page(tuple(view(name=name) for name in names), Frame(NOW, NOW + 900), world())
    assert len(page) < 150_000
    assert all(f'href="{file_of(name)}"' in page for name in names)


def test_no_name_of_a_glider_leads_out_of_the_folder(tmp_path):
    for name in ("../../etc/x", "a/b", ".", "..", "index", "a b", "\n"):
        file = file_of(name)
        assert "/" not in file
        assert file != "index.html"
        assert (tmp_path / file).resolve().parent == tmp_path


# --------------------------------------------------------------------------- files


def test_a_page_that_cannot_be_written_says_so(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(Exception, match=r"cannot be written: .*pages\.folder"):
        writing.put(tmp_path / "file" / "index.html", "x")


def test_what_a_killed_writer_left_is_removed_and_nothing_else(tmp_path):
    for name in (".index.html.1.part", "index.html"):
        (tmp_path / name).write_text("x")
    writing.clear(tmp_path, (tmp_path / "index.html").stat().st_mtime + 60.0)
    assert len(list(tmp_path.iterdir())) == 2
    writing.clear(tmp_path, (tmp_path / "index.html").stat().st_mtime + 7200.0)
    assert [p.name for p in tmp_path.iterdir()] == ["index.html"]


def test_pages_are_for_all_to_read(tmp_path):
    path = Path(tmp_path / "new" / "index.html")
    writing.put(path, "whole")
    assert path.read_text() == "whole"
    assert path.stat().st_mode & 0o777 == 0o644
