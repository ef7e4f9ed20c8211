"""A new way of flying is told once, as a notice, and a fault that begins then is told as well."""

from statistics import median

import pytest

from gliderwatch.model import Kind, Severity
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.score.graft import Graft, GraftKind, grafted, navigate, own_speeds
from gliderwatch.score.sensors import LEFT_OUT, left_out
from gliderwatch.service.routing import NOBODY
from missions import Leg, feed, mission, real

USUAL, FASTER = Leg(hours=2.0), Leg(speed=0.5, hours=1.2)


def told(segments):
    return feed(segments, speaking=NOBODY).alerts()


def test_a_faster_glider_is_a_notice_after_three_dives_and_no_alarm():
    alerts = told(mission([USUAL] * 8 + [FASTER] * 8))
    assert [a.kind for a in alerts] == [Kind.REGIME]
    notice = alerts[0]
    assert notice.title.startswith("unit NEW NORMAL: flies faster, 0.4")
    assert "unless you say otherwise" in notice.body
    assert (notice.severity, notice.audience, notice.incident) == (Severity.INFO, Severity.WARNING, "")


def test_files_that_come_together_do_not_hide_it():
    store = feed(mission([USUAL] * 8 + [FASTER] * 6)[:-1])
    assert store.alerts() == []
    last = mission([USUAL] * 8 + [FASTER] * 6)[-1:]
    assert [a.kind for a in feed(last, speaking=NOBODY, store=store).alerts()] == [Kind.REGIME]


@pytest.fixture
def hybrid(shared_data):
    """A mission that switched its thruster on after 16 h, from a glider that does not send that."""
    segments = real(shared_data, "electa-2022")
    return segments, median(own_speeds(navigate(segments)).values())


@pytest.mark.real
def test_a_hybrid_that_does_not_send_its_thruster_flies_in_a_new_way(hybrid):
    segments, _ = hybrid
    launch = navigate(segments)[0].t_dive
    first = [s for s in segments if s.id.opened_at < launch + 40 * 3600]
    alerts = told(left_out(first, LEFT_OUT["thruster"]))
    assert [a.kind for a in alerts] == [Kind.REGIME]
    assert "flies faster, 0.49 m/s" in alerts[0].title


@pytest.mark.real
@pytest.mark.parametrize("hours", [30.0, 60.0, 90.0])
def test_drag_in_the_new_way_of_flying_is_told_within_three_surfacings(hybrid, hours):
    segments, usual = hybrid
    dives = navigate(segments)
    onset = dives[0].t_dive + 3600 * hours
    third = [dive.t_surface for dive in dives if dive.t_surface > onset][2]
    slowed = left_out(grafted(segments, Graft(GraftKind.SLOWED, 0.5), onset, usual), LEFT_OUT["thruster"])
    state, opened = GliderState(), []
    for segment in slowed:
        outcome = process(state, segment, GliderParams())
        state = outcome.state
        opened += [(i.kind, i.opened_at) for i in outcome.incidents if i.opened_at > onset]
        if opened or segment.id.opened_at > third:
            break
    assert {kind for kind, _ in opened} == {Kind.ANOMALY}
    assert min(at for _, at in opened) <= third
