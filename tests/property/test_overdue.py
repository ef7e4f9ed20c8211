"""Whatever a glider and its files do: what is said of its silence is true, and said once."""

from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.model import Kind
from silent import CALL, DAY, HOUR, INTERVAL, T0, Clock, Sea

gaps = st.lists(st.floats(0.3, 20.0), min_size=1, max_size=12)
"""Hours from surfacing to surfacing: usual, early, late, or days of nothing."""


def surfacings(hours: list[float]) -> list[float]:
    times = [T0]
    for h in hours:
        times.append(times[-1] + max(h * HOUR, CALL + 60.0))
    return times


@settings(max_examples=40, deadline=None)
@given(gaps, st.sampled_from([None, 0.25, 2.0]))
def test_a_clock_that_ticks_says_what_a_replay_says(hours, margin):
    """To the letter: ticks every few minutes on one side, whenever something is due on the other."""
    live, replay = Clock(Sea(), margin), Clock(Sea(), margin)
    now = T0
    for t in surfacings(hours):
        end = t + CALL
        live_at = now
        while live_at < end:
            live.at(live_at)
            live_at += 300.0
        live.at(end - 1e-3)  # the daemon wakes when something is due, so nothing is late
        replay.exactly(end - 1e-3, now)
        for clock in (live, replay):
            clock.sea.call(t)
            clock.at(end)
        now = end
    assert live.alerts == replay.alerts
    assert live.silences == replay.silences


@settings(max_examples=40, deadline=None)
@given(gaps, st.data())
def test_files_in_any_order_at_any_time(hours, data):
    """Ids are unique; a silence ends once; in the end, every one told that never was is withdrawn."""
    times = surfacings(hours)
    last = times[-1] + CALL
    arrivals = [(t + CALL + data.draw(st.sampled_from([0.0, 0.0, 3.0, 15.0])) * HOUR, t) for t in times]
    clock = Clock(Sea().call(T0 - INTERVAL))
    hourly = [(T0 + k * HOUR, None) for k in range(int((last + DAY - T0) // HOUR))]
    events = sorted([*arrivals, *hourly], key=lambda e: e[0])
    for now, t in events:
        if t is not None:
            clock.sea.call(t, at=now)
        clock.at(now)
        said = clock.silences
        assert clock.at(now) == [] and clock.silences == said
    ids = [a.id for a in clock.alerts]
    assert len(set(ids)) == len(ids)
    ends = [a.incident for a in clock.alerts if a.kind == Kind.ALL_CLEAR]
    assert len(set(ends)) == len(ends)
    calls = [T0 - INTERVAL, *times]
    for silence in clock.silences:
        call = silence.missed
        in_time = [t for t in calls if call.last_sign < t <= call.due]
        if silence.called is not None:  # in time, and withdrawn where its file did not come as the call ended
            assert bool(in_time) == (silence.called <= call.due)
            assert not silence.withdrawn or in_time
