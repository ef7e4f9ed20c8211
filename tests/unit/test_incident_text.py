"""What an alert tells a pilot, and that nothing from a file can break out of it."""

import re
import unicodedata
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st

import written
from alert_support import DISAGREE, DIVE, HEALTHY, SLOW, SURFACE, incident
from gliderwatch.messages import notice_text
from gliderwatch.messages.formatting import angle, clean, duration, flow, map_link, place, speed
from gliderwatch.model import Alert, Assessment, Kind, Severity

WHO = {"alert_id": "a1", "audience": Severity.CRITICAL}


class Reader(HTMLParser):
    """What a mail client would show of an HTML message, and its tags and links."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.links: list[str] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.links += [value or "" for name, value in attrs if name == "href"]

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def shown(self) -> str:
        return " ".join("".join(self.words).split())


def opened(assessment: Assessment = SLOW, kind: Kind = Kind.ANOMALY) -> Alert:
    return written.opened(incident(assessment, kind=kind), assessment, **WHO)


def section(body: str, heading: str) -> list[str]:
    block = next(b for b in body.split("\n\n") if b.startswith(heading + "\n"))
    return [line.removeprefix("- ") for line in block.strip().split("\n")[1:]]


MAP = "https://www.openstreetmap.org/?mlat=24.20575&mlon=-83.02057&zoom=9"
FACTS = [
    "electa",
    "2022-11-05 09:12 UTC (2 dives)",
    "2022-11-05 12:34 UTC",
    "24° 12.345' N, 083° 01.234' W (24.20575, -83.02057)",
    "0.11 m/s (normal 0.22-0.30)",
    "Current, estimated: 0.23 m/s towards 041° true",
    "Current as the glider reckons it: 0.21 m/s towards 039° true (final)",
    "p_E 0.031 (limit 0.300)",
    "For: a lost or bent wing",
    "What to do",
]


class TestOpened:
    def test_title_says_it_all(self) -> None:
        assert opened().title == "electa SLOW 0.11 m/s (normal 0.22-0.30): lost wing?"

    def test_first_line_says_what_and_how_bad(self) -> None:
        assert opened().body.startswith("electa is slow since 2022-11-05 09:12 UTC (2 dives): 0.11 m/s")
        usual = replace(SLOW, evidence={**SLOW.evidence, "usual_speed": 0.25})
        assert ", 55 % below its usual 0.25; " in opened(usual).body.split("\n")[0]

    @pytest.mark.parametrize("fact", FACTS)
    def test_text_and_html_hold_each_fact(self, fact: str) -> None:
        made = opened()
        assert fact in made.body
        assert fact in Reader(made.html).shown

    def test_map_is_linked_in_both(self) -> None:
        made = opened()
        assert f"Map: {MAP}\n" in made.body
        assert Reader(made.html).links == [MAP]

    def test_html_has_no_tables_and_the_title(self) -> None:
        reader = Reader(opened().html)
        assert not reader.tags & {"table", "script", "img"}
        assert opened().title in reader.shown

    def test_fields_for_delivery(self) -> None:
        made = opened()
        assert (made.id, made.audience, made.kind) == ("a1", Severity.CRITICAL, Kind.ANOMALY)
        assert (made.incident, made.time) == ("electa/anomaly/1667639520", SURFACE)

    def test_evidence_is_weighed(self) -> None:
        pro = section(opened().body, "For: a lost or bent wing")
        assert "0.11 m/s through the water, out of the normal range" in pro[0]
        assert "mean roll 18 degrees" in pro
        assert "magnetic declination from WMM2025" in section(opened().body, "Data")

    def test_absent_evidence_is_left_out(self) -> None:
        bare = replace(
            SLOW,
            evidence={},
            notes=(),
            p_e=None,
            flow_u=None,
            clle_max=None,
            excitation=None,
            lat=None,
            lon=None,
        )
        body = opened(bare).body
        assert "For: " not in body and "Against: " not in body
        assert "Map:" not in body
        assert "Where: unknown" in body
        assert "Current, estimated: unknown" in body
        assert "None" not in body
        assert "nan" not in body
        assert "this dive:" not in body

    def test_not_a_number_is_missing(self) -> None:
        nan = float("nan")
        odd = replace(
            SLOW, lat=nan, speed=nan, flow_u=nan, p_e=nan, evidence=dict.fromkeys(SLOW.evidence, nan)
        )
        made = opened(odd)
        assert "nan" not in made.title + made.body
        assert "speed not known (normal 0.22-0.30)" in made.title

    def test_doubts_about_the_data_are_named(self) -> None:
        evidence = {
            "heading_steadiness": 0.995,
            "duration_h": 0.6,
            "unobserved_h": 1.2,
            "drift_h": 0.8,
            "fix_gap_minutes": 42.0,
        }
        data = " ".join(section(opened(replace(SLOW, evidence=evidence, reference_final=False)).body, "Data"))
        for words in ("heading hardly changed", "0.6 h", "1.2 h", "0.8 h", "42 min", "provisional"):
            assert words in data

    def test_what_the_numbers_rest_on(self) -> None:
        body = opened().body
        assert "812 samples in 3.4 h" in section(body, "Data")
        assert "CLLE at most 84 m" in section(body, "In symbols")
        assert any("excitation 0.41" in line for line in section(body, "In symbols"))

    def test_what_to_do_follows_the_evidence(self) -> None:
        assert "roll and fin" in section(opened().body, "What to do")[0]
        fast = opened(replace(SLOW, speed=0.45))
        assert fast.title.startswith("electa FAST 0.45 m/s") and "electa is fast since" in fast.body
        assert "thruster" in section(fast.body, "What to do")[0]

    def test_speed_that_rounds_into_the_range_shows_why_it_is_flagged(self) -> None:
        assert "0.217 m/s (normal 0.22" in opened(replace(SLOW, speed=0.217)).title


class TestFalseAlarm:
    def test_says_that_the_speed_is_not_known(self) -> None:
        made = opened(replace(DISAGREE, reason="the current is wrong"), Kind.FALSE_ALARM)
        assert made.title == "electa MEASUREMENTS DISAGREE: current wrong"
        first = made.body.split("\n")[0]
        assert "its speed is not known" in first
        assert "the track misses by 0.31 m/s across the heading" in first
        assert "current not known" in made.body.split("\n")[1]

    def test_no_word_for_people_sounds_like_ignore_me(self) -> None:
        """The papers' word for flag 2 is not in what a pilot reads; the kind for machines keeps it."""
        told = incident(DISAGREE, kind=Kind.FALSE_ALARM)
        made = [
            opened(DISAGREE, Kind.FALSE_ALARM),
            written.reminder(told, DISAGREE, 24.0, alert_id="r", audience=Severity.WARNING),
            written.all_clear(told, DISAGREE, alert_id="c", audience=Severity.WARNING),
            written.surfacing(DISAGREE, None, alert_id="s"),
        ]
        assert made[0].kind == "false_alarm"
        assert not [a for a in made if "false alarm" in f"{a.title} {a.body}".lower()]

    def test_evidence_is_that_of_measurements(self) -> None:
        body = opened(DISAGREE, Kind.FALSE_ALARM).body
        pro = " ".join(section(body, "For: the current estimated here and that of the glider differ"))
        assert "across the heading the track misses by 0.31 m/s" in pro
        assert "are 0.58 m/s apart" in pro
        # a speed that needs the current is no evidence where the current is in doubt
        assert "less current gives" not in body


class TestThread:
    def test_reminder(self) -> None:
        made = written.reminder(incident(), SLOW, 26.0, **WHO)
        assert made.kind is Kind.REMINDER
        assert made.severity is Severity.CRITICAL
        assert made.title == "electa STILL SLOW after 26.0 h: 0.11 m/s"
        assert "still open, after 26.0 h" in made.body and len(made.brief.rstrip().split("\n")) == 5
        assert "As bad as ever" in made.body

    def test_reminder_after_a_dive_without_result(self) -> None:
        made = written.reminder(
            incident(), replace(HEALTHY, flag=None, reason="no fix", speed=None), 26.0, **WHO
        )
        assert "Latest dive: not assessed (no fix)" in made.body

    def test_all_clear(self) -> None:
        made = written.all_clear(incident(cleared_at=SURFACE + 3600), HEALTHY, **WHO)
        assert (made.kind, made.severity, made.audience) == (Kind.ALL_CLEAR, Severity.INFO, Severity.CRITICAL)
        assert made.title == "electa ALL CLEAR: 0.25 m/s (normal 0.22-0.30)"
        assert "It lasted 4.4 h, since 2022-11-05 09:12 UTC." in made.body

    def test_correction_withdraws(self) -> None:
        made = written.correction(incident(), None, HEALTHY, "the final current of the dive arrived", **WHO)
        assert (made.kind, made.severity) == (Kind.CORRECTION, Severity.INFO)
        assert made.title == "electa CORRECTION: anomaly withdrawn, 0.25 m/s"
        assert "is withdrawn, because the final current of the dive arrived." in made.body
        assert "worst 0.11 m/s, open" in made.body
        assert "So it is now: no incident" in made.body

    def test_correction_changes_numbers(self) -> None:
        now = replace(SLOW, speed=0.151)
        made = written.correction(incident(), incident(now), now, "a missing segment arrived", **WHO)
        assert made.severity is Severity.CRITICAL
        assert (
            "Reported before: anomaly since 2022-11-05 09:12 UTC, 2 dives, worst 0.11 m/s, open" in made.body
        )
        assert "So it is now: anomaly since 2022-11-05 09:12 UTC, 2 dives, worst 0.15 m/s, open" in made.body

    def test_all_of_one_incident_share_its_thread(self) -> None:
        made = [
            written.opened(incident(), SLOW, **WHO),
            written.reminder(incident(), SLOW, 24, **WHO),
            written.all_clear(incident(), HEALTHY, **WHO),
            written.correction(incident(), None, HEALTHY, "", **WHO),
        ]
        assert {a.incident for a in made} == {incident().id}


class TestNotices:
    def test_surfacing(self) -> None:
        made = written.surfacing(HEALTHY, DIVE - 1800, alert_id="s")
        assert made.title == "electa surfaced 12:34 UTC: 0.25 m/s, normal"
        assert (made.kind, made.severity, made.incident) == (Kind.SURFACING, Severity.INFO, "")
        assert "3.9 h after the one before" in made.body
        assert "24° 12.345' N" in made.body
        assert "current 0.23 m/s" in made.body

    def test_first_surfacing_has_no_one_before(self) -> None:
        assert "the one before" not in written.surfacing(HEALTHY, None, alert_id="s").body

    def test_operator(self) -> None:
        made = notice_text.operator(
            "no new files",
            "None for 6 h.\n\nWhat to do: check it.",
            SURFACE,
            severity=Severity.WARNING,
            machine="dockserver-2",
            **WHO,
        )
        assert made.title == "GLIDERWATCH dockserver-2: no new files"
        assert made.body == (
            "GLIDERWATCH dockserver-2, 2022-11-05 12:34 UTC: no new files.\n"
            "None for 6 h.\n\nWhat to do\n- Check it.\n\nHelp: docs/pilots.md, GLIDERWATCH\n"
        )
        assert made.kind is Kind.OPERATOR


nasty = st.text(max_size=300) | st.sampled_from(
    [
        "<script>alert(1)</script>",
        "a\r\nBcc: x@y.z",
        "\x1b[31m",
        "&lt;b&gt;",
        "{{ 7*7 }}",
        "\u202eatcele",
        "\ud800",
    ]
)


class TestNothingBreaksOut:
    @given(glider=nasty, segment=nasty, note=nasty, why=nasty)
    def test_in_any_message(self, glider: str, segment: str, note: str, why: str) -> None:
        dive = replace(SLOW, glider=glider, segment=segment, notes=(note,), reason=why)
        case = incident(dive)
        for made in (
            written.opened(case, dive, **WHO),
            written.reminder(case, replace(dive, flag=None), 24, **WHO),
            written.all_clear(case, dive, **WHO),
            written.correction(case, None, dive, why, **WHO),
            written.surfacing(dive, None, alert_id="s"),
            notice_text.operator(note, why, SURFACE, severity=Severity.INFO, machine=glider, **WHO),
        ):
            self.check(made)

    def check(self, made: Alert) -> None:
        assert len(made.title) <= 200
        for text in (made.title, made.body.replace("\n", ""), made.html.replace("\n", "")):
            assert not any(unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") for c in text)
            text.encode("utf-8")
        reader = Reader(made.html)
        allowed = {"html", "head", "meta", "body", "p", "b", "br", "ul", "li", "a", "hr"}
        assert reader.tags <= allowed
        assert all(link.startswith("https://www.openstreetmap.org/?mlat=") for link in reader.links)
        assert made.title in reader.shown

    @given(nasty)
    def test_a_name_is_one_line_and_stays_itself(self, text: str) -> None:
        line = clean(text)
        assert len(line) <= 200
        assert clean(line) == line
        if re.fullmatch(r"[a-z0-9_-]{1,60}", text):
            assert line == text


class TestWords:
    @pytest.mark.parametrize(
        ("lat", "lon", "words"),
        [
            (0.0, 0.0, "00° 00.000' N, 000° 00.000' E"),
            (-0.5, 179.9999999, "00° 30.000' S, 180° 00.000' E"),
            (9.99999999, -9.5, "10° 00.000' N, 009° 30.000' W"),
        ],
    )
    def test_place(self, lat: float, lon: float, words: str) -> None:
        assert place(lat, lon).startswith(words)

    @given(st.floats(-90, 90), st.floats(-180, 180))
    def test_place_reads_back(self, lat: float, lon: float) -> None:
        found = re.match(r"(\d\d)° (\d\d\.\d{3})' ([NS]), (\d{3})° (\d\d\.\d{3})' ([EW]) ", place(lat, lon))
        assert found is not None
        read = (float(found[1]) + float(found[2]) / 60) * (1 if found[3] == "N" else -1)
        assert float(found[2]) < 60
        assert read == pytest.approx(lat, abs=1e-5)

    @pytest.mark.parametrize(
        ("u", "v", "words"),
        [(0.1, 0.0, "090"), (0.0, -0.1, "180"), (-0.1, 0.0, "270"), (-0.0001, 0.1, "000"), (0.1, 0.1, "045")],
    )
    def test_flow_is_named_by_where_it_goes(self, u: float, v: float, words: str) -> None:
        assert flow(u, v).endswith(f"towards {words}° true")

    def test_small_things(self) -> None:
        assert speed(-0.004) == "0.00 m/s"
        assert duration(59.0 * 60) == "59 min"
        assert duration(3 * 86400) == "3.0 days"
        assert angle(-0.5) == "-29 degrees"
        assert map_link(None, 1.0) == ""
