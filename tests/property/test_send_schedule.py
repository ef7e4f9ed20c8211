"""Quiet hours of any kind, in any zone, at any time."""

from __future__ import annotations

from datetime import UTC, datetime, time, timedelta
from zoneinfo import ZoneInfo

from hypothesis import given
from hypothesis import strategies as st

from gliderwatch.incidents.send_schedule import QuietHours
from gliderwatch.model import Severity

HOUR = 3600.0
ZONES = (
    "UTC",
    "Europe/Amsterdam",
    "America/New_York",
    "Australia/Lord_Howe",
    "Pacific/Apia",
    "Antarctica/Troll",
)
CLOCKS = st.builds(time, st.integers(0, 23), st.integers(0, 59))
DST = [datetime(2026, 3, 8), datetime(2026, 3, 29), datetime(2026, 4, 5), datetime(2026, 10, 25)]
TIMES = st.one_of(
    st.floats(0.0, 4e9),
    st.builds(
        lambda day, hours: (day + timedelta(hours=hours)).replace(tzinfo=UTC).timestamp(),
        st.sampled_from(DST),
        st.floats(-30.0, 30.0),
    ),
)


@given(CLOCKS, CLOCKS, st.sampled_from(ZONES), TIMES)
def test_they_end_soon_and_never_before_now_or_in_themselves(
    start: time, end: time, zone: str, now: float
) -> None:
    hours = QuietHours(start, end, ZoneInfo(zone), Severity.CRITICAL)
    if start == end:
        return
    until = hours.until(now)
    assert not hours.holds(until)
    assert until >= now
    assert (until == now) is not hours.holds(now)
    free = (start.hour - end.hour) * 60 + start.minute - end.minute
    # a clock that is put forward can leave out all of a short day, and the one of Samoa left out a date
    most = 26 if free % 1440 > 120 and zone != "Pacific/Apia" else 72
    assert until - now <= most * HOUR
