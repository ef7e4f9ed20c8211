"""Whatever becomes known in whatever order: nothing is said twice, nothing that changed stays unsaid."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from dives_by_letters import HOUR, STEP, Talk, World, dive
from gliderwatch.incidents.constants import FLOW_CHANGE, NEWS, SETTLES, SPEED_CHANGE
from gliderwatch.model import Kind

LETTERS = "0011122S-"
append = st.tuples(st.just("append"), st.sampled_from(LETTERS), st.just(0.0))
revise = st.tuples(st.just("revise"), st.sampled_from(LETTERS), st.floats(0.0, 1.0))
remove = st.tuples(st.just("remove"), st.just(""), st.floats(0.0, 1.0))
insert = st.tuples(st.just("insert"), st.sampled_from(LETTERS), st.floats(0.0, 1.0))
current = st.tuples(st.just("current"), st.just(""), st.floats(0.0, 1.0))
any_change = st.one_of(append, append, append, revise, remove, insert, current)
steps = st.lists(any_change, max_size=40)


def change(world: World, what: str, letter: str, where: float, step: int) -> None:
    """One more dive, or data that come late: another flag, a dive that goes or comes, a final current."""
    times = sorted(world.dives)
    end = int(times[-1] // STEP) if times else -1
    k = int(times[min(int(where * len(times)), len(times) - 1)] // STEP) if times else 0
    if what == "append":
        world.dives[(end + 1) * STEP] = dive(end + 1, letter)
    elif what == "insert":
        k = int(where * (end + 1))
        world.dives[k * STEP] = dive(k, letter)
    elif times and what == "revise":
        world.dives[k * STEP] = dive(k, letter, n_samples=step)
    elif len(times) > 1 and what == "remove":
        del world.dives[k * STEP]
    elif times and what == "current":
        world.dives[k * STEP] = replace(world.dives[k * STEP], reference_u=0.1 * (step % 7))


def check_all_is_said(talk: Talk, world: World) -> None:
    """Each thread tells what is known, each incident that is news has one thread."""
    latest = world.last_surfacing(float("inf"))
    incidents = {i.id: i for i in world.incidents()}
    live = [t for t in talk.notified.threads if not t.withdrawn]
    about = [t.reported.id for t in live]
    assert len(set(about)) == len(about) and set(about) <= set(incidents)
    for thread in live:
        now = incidents[thread.reported.id]
        assert (thread.reported.since, thread.reported.cleared_at) == (now.since, now.cleared_at)
        now_ = world.dive(thread.dive.t_dive)
        if now_ is not None and now_.speed is not None and thread.dive.speed is not None:
            assert now_.flag == thread.dive.flag
            assert abs(now_.speed - thread.dive.speed) <= SPEED_CHANGE
            assert abs(now_.reference_u - thread.dive.reference_u) <= FLOW_CHANGE
    about += [identity for t in talk.notified.threads for identity in t.formerly]
    explained = {i.opened_at for i in incidents.values() if i.kind is Kind.ANOMALY}
    for incident in incidents.values():
        news = incident.cleared_at is None or latest.t_surface - incident.cleared_at < NEWS
        is_explained = incident.kind is Kind.FALSE_ALARM and incident.cleared_at in explained
        assert not news or is_explained or incident.id in about


@settings(max_examples=200)
@given(steps, st.sampled_from([None, 6.0, 24.0]), st.booleans())
def test_any_history(changes, reminder_hours, notices):
    world, talk = World({}), Talk(reminder_hours, notices)
    spoken: dict[str, float] = {}
    surfacings: list[float] = []
    for step, (what, letter, where) in enumerate(changes):
        change(world, what, letter, where, step)
        before = len(talk.alerts)
        talk.update(world)
        latest = world.last_surfacing(float("inf"))
        for alert in talk.alerts[before:]:
            if alert.kind == Kind.REMINDER:
                assert latest.t_surface - spoken[alert.incident] >= 0.8 * reminder_hours * HOUR
            if alert.kind == Kind.SURFACING:
                surfacings.append(alert.time)
            spoken[alert.incident] = latest.t_surface
        if latest is not None:
            check_all_is_said(talk, world)
        notified = talk.notified
        assert talk.update(world) == [] and talk.notified == notified
    ids = [a.id for a in talk.alerts]
    assert len(set(ids)) == len(ids)
    assert surfacings == sorted(set(surfacings))


@settings(max_examples=100)
@given(st.text(LETTERS, max_size=40))
def test_at_once_or_dive_by_dive_people_end_with_the_same_open_incidents(letters):
    one, by_one = Talk(), Talk()
    one.update(letters)
    for n in range(1, len(letters) + 1):
        by_one.update(letters[:n])
    assert (
        open_now(one) == open_now(by_one) == {i.id for i in World.of(letters).incidents() if not i.cleared_at}
    )


def open_now(talk: Talk) -> set[str]:
    """The incidents that people take for open."""
    return {t.reported.id for t in talk.notified.threads if t.is_open}


@settings(max_examples=200)
@given(
    st.lists(st.tuples(st.one_of(append, revise, remove, insert, current), st.floats(0.0, 90.0)), max_size=40)
)
def test_within_an_hour_a_thread_has_one_message_but_for_alarms_and_nothing_is_lost(changes):
    """Files come within minutes of each other, whatever is in them: as those of two days that come at
    once."""
    world, talk = World({}), Talk(None)
    talk.is_in_time, talk.now = False, 41 * STEP
    last: dict[str, float] = {}
    for step, ((what, letter, where), minutes) in enumerate(changes):
        change(world, what, letter, where, step)
        was_open = {t.id for t in talk.notified.threads if t.is_open}
        n = len(talk.alerts)
        talk.update(world, minutes)
        is_open = {t.id: t.reported.kind for t in talk.notified.threads if t.is_open}
        for alert in talk.alerts[n:]:
            if talk.now - last.get(alert.incident, -SETTLES) < SETTLES:
                assert alert.incident in is_open
                assert alert.kind in (Kind.ANOMALY, Kind.FALSE_ALARM) or alert.incident not in was_open
            last[alert.incident] = talk.now
        alarms = {i.kind for i in world.incidents() if i.cleared_at is None}
        assert alarms <= set(is_open.values()), "an alarm is not delayed"
        assert (talk.notified.settles is None) or talk.now < talk.notified.settles <= talk.now + SETTLES
    if world.dives:
        talk.update(world, 60.0)
        check_all_is_said(talk, world)
