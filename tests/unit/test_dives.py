"""Segments in, dives out: fixes, holes, currents and what is told again."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gliderwatch.model import Dive, Segment, Series, Unusable
from gliderwatch.navigation.constants import LONGEST_DIVE
from gliderwatch.navigation.dives import Navigation, extend
from gliderwatch.navigation.flight import concatenated
from gliderwatch.navigation.track import closure
from missions import LAT, LON, START, Leg, cut, mission, opened, segment, series

KM = 1 / 111.195
LEGS = [
    Leg(current=(0.1, -0.05), heading=0.5),
    Leg(current=(0.15, 0.0), heading=1.0),
    Leg(current=(0.05, 0.1), heading=2.0),
    Leg(current=(0.2, 0.1), heading=3.0),
]


def told(segments: Sequence[Segment], state: Navigation | None = None) -> tuple[Navigation, list[Dive]]:
    """The state and the dives, as last told, after all segments."""
    dives: dict[float, Dive] = {}
    state = state or Navigation()
    for s in segments:
        state, more = extend(state, s)
        since = min((d.t_dive for d in more), default=float("inf"))
        dives = {t: d for t, d in dives.items() if t < since or d.end is not None}
        dives |= {d.t_dive: d for d in more}
    return state, [dives[t] for t in sorted(dives)]


def current_of(dive: Dive) -> tuple[float, float] | None:
    return None if dive.current is None else (round(dive.current.u, 6), round(dive.current.v, 6))


def with_samples(s: Segment, **quantities) -> Segment:
    """The segment with quantities replaced (None: taken out)."""
    held = {k: v for k, v in s.quantities.items() if k not in quantities}
    return replace(s, quantities=held | {k: series(v) for k, v in quantities.items() if v})


def fixes(s: Segment, *places: tuple[float, float]) -> Segment:
    """The segment with other fixes: (time, kilometres north of the origin)."""
    north = [(t, LAT + km * KM) for t, km in places]
    return with_samples(s, fix_lat=north, fix_lon=[(t, LON) for t, _ in places])


class TestHealthy:
    def test_one_dive_a_segment_with_its_final_current(self):
        _, dives = told(mission(LEGS))
        assert [d.segment for d in dives] == [f"unit-2023-318-0-{k}" for k in range(4)]
        assert [d.reason for d in dives] == [""] * 4
        assert [current_of(d) for d in dives[:3]] == [leg.current for leg in LEGS[:3]]
        assert [d.current.final for d in dives] == [True, True, True, False]

    @pytest.mark.parametrize("declination", [-0.28, 0.0, 0.22])
    def test_frames_are_right_in_the_whole_chain(self, declination):
        _, dives = told(mission(LEGS, declination=declination))
        for dive in dives[:3]:
            out = closure(dive.track, dive.current)
            assert out.along_speed == pytest.approx(0.3, abs=1e-3)
            assert out.across_misfit == pytest.approx(0.0, abs=1e-3)

    def test_the_dive_lies_between_its_fixes(self):
        _, dives = told(mission(LEGS))
        for k, dive in enumerate(dives):
            t0 = opened(LEGS, k)
            assert (dive.t_dive, dive.t_surface) == (t0 + 180, t0 + 180 + 7200)
            assert (dive.start.t, dive.end.t) == (t0 + 90, t0 + 180 + 7200 + 40)

    def test_many_small_files_make_the_same_dive(self):
        """A segment may be closed and the next opened under water."""
        whole = mission(LEGS[:1])[0]
        t = START + 4000.0
        first = replace(cut(whole, t), last_t=t)
        rest = {k: s.between(t + 1, np.inf) for k, s in whole.quantities.items()}
        second = replace(
            whole,
            id=replace(whole.id, opened_at=t + 30, name="b"),
            quantities={k: s for k, s in rest.items() if len(s)},
        )
        _, (dive,) = told([first, second])
        _, (alone,) = told([whole])
        assert dive.track.x.tolist() == alone.track.x.tolist() and dive.reason == ""

    def test_the_segment_is_not_changed(self):
        s = mission(LEGS)[1]
        before = {k: (v.t.tolist(), v.v.tolist()) for k, v in s.quantities.items()}
        extend(Navigation(), s)
        assert {k: (v.t.tolist(), v.v.tolist()) for k, v in s.quantities.items()} == before

    def test_a_segment_without_anything(self):
        state, dives = extend(Navigation(), segment("empty", START, {}))
        assert dives == [] and state.last_t == START
        _, dives = told([*mission(LEGS[:1]), segment("empty", opened(LEGS, 1), {}), *mission(LEGS)[1:]])
        assert len(dives) == 4


class TestUnusable:
    def test_not_surfaced_yet(self):
        s = mission(LEGS)[0]
        _, (dive,) = told([cut(s, START + 5000)])
        assert dive.end is None and dive.reason == "no fix" and dive.track is None
        assert dive.unusable is Unusable.NOT_SURFACED

    def test_no_fix_before_the_dive_and_none_after(self):
        """What has not surfaced has not surfaced, whatever else is missing."""
        s = with_samples(mission(LEGS)[0], fix_lat=None, fix_lon=None)
        _, (dive,) = told([s])
        assert dive.reason == "no fix"

    def test_no_fix_before_the_dive(self):
        s = mission(LEGS)[0]
        late = {
            n: [(t, v) for t, v in zip(s.get(n).t, s.get(n).v, strict=True) if t > START + 5000]
            for n in ("fix_lat", "fix_lon")
        }
        _, (dive,) = told([with_samples(s, **late)])
        assert dive.reason == "no fix before the dive" and dive.end is not None
        assert dive.unusable is Unusable.NO_FIX_BEFORE

    def test_no_heading(self):
        _, (dive,) = told([with_samples(mission(LEGS)[0], heading=None)])
        assert dive.reason == "" and dive.n_samples == 0  # depth and pitch tell how fast it was
        assert dive.features.heading_assumed

    def test_turning_with_few_headings(self):
        s = with_samples(
            mission([Leg(hours=6)])[0],
            heading=[(START + 200, 0.0), (START + 8000, 1.5), (START + 21000, 3.0)],
        )
        _, (dive,) = told([s])
        assert dive.features.heading_assumed
        assert any(note.startswith("headings missing") for note in dive.notes)

    def test_shorter_than_a_quarter_of_an_hour(self):
        _, dives = told(mission([Leg(hours=0.2), Leg(hours=0.24), Leg(hours=0.3)]))
        assert [d.t_dive for d in dives] == [opened([Leg(hours=0.2), Leg(hours=0.24)], 2) + 180]

    def test_a_fix_on_another_ocean(self):
        s = mission(LEGS)[0]
        t = START + 180 + 7200 + 40
        _, (dive,) = told([fixes(s, (START + 30, 0.0), (START + 90, 0.0), (t, 900.0))])
        assert dive.reason.startswith("wild fix: ") and dive.track is None
        assert dive.unusable is Unusable.WILD_FIX

    def test_days_without_a_fix_are_no_dive(self):
        legs = [Leg(hours=LONGEST_DIVE / 3600 + 1)]
        _, dives = told(mission(legs))
        assert dives == []

    def test_a_hole_hides_no_dive_of_a_glider_that_is_where_it_was(self):
        """At the dock, with tests hours apart."""
        first, last = mission([Leg(hours=0.05), Leg(hours=0.05)])
        later = {name: Series(s.t + 18000.0, s.v) for name, s in last.quantities.items()}
        identity = replace(last.id, opened_at=last.id.opened_at + 18000.0)
        last = replace(last, id=identity, last_t=last.last_t + 18000.0, quantities=later)
        here, there = START + 400.0, identity.opened_at + 30.0
        skipped = replace(last, id=replace(identity, name=identity.name[:-1] + "7"))
        for north, n in ((0.02, 0), (2.0, 1)):
            moved = fixes(skipped, (there, north), (there + 30.0, north + 0.002))
            _, dives = told([fixes(first, (START + 30.0, 0.0), (here, 0.003)), moved])
            assert [d.reason[:12] for d in dives] == ["data missing"] * n
        # nor between a segment that ended at the surface and the next one of its mission: that is a call
        adrift = fixes(last, (there, 2.0), (there + 30.0, 2.002))
        assert told([fixes(first, (START + 30.0, 0.0), (here, 0.003)), adrift])[1] == []

    def test_mostly_at_the_surface(self):
        s = mission(LEGS)[0]
        end = START + 180 + 7200
        late = fixes(s, (START + 30, 0.0), (START + 90, 0.0), (end + 9000, 3.0), (end + 9030, 3.0))
        depth = concatenated(late.quantities, {"depth": series([(end + 60, 0.4)])})
        _, (dive,) = told([replace(late, quantities=depth, last_t=end + 9100)])
        assert dive.reason == "mostly surface drift"
        assert dive.unusable is Unusable.SURFACE_DRIFT


class TestDrift:
    def test_between_two_dives_it_is_no_dive(self):
        """Half an hour at the surface, with fixes only at its ends."""
        legs = LEGS[:2]
        first, second = mission(legs)
        shift = 1800.0
        later = {k: series(list(zip(s.t + shift, s.v, strict=True))) for k, s in second.quantities.items()}
        second = replace(
            second,
            id=replace(second.id, opened_at=second.id.opened_at + shift),
            last_t=second.last_t + shift,
            quantities=later,
        )
        _, dives = told([first, second])
        assert len(dives) == 2 and all(d.reason == "" for d in dives)


class TestOldFix:
    """The end of the dive is 3 km north; 120 s after it comes the true fix."""

    def ended_by(self, *more: tuple[float, float]) -> Segment:
        s = mission(LEGS[:1])[0]
        t = START + 180 + 7200
        return fixes(s, (START + 30, 0.0), (START + 90, 0.1), *((t + dt, km) for dt, km in more))

    def test_repeated_it_ends_nothing(self):
        _, (dive,) = told([self.ended_by((40, 0.1), (80, 0.1))])
        assert dive.reason == "no fix"

    def test_first_of_the_surfacing_it_is_passed_over(self):
        _, (dive,) = told([self.ended_by((40, 0.3), (100, 3.0))])
        assert dive.end.t == START + 180 + 7200 + 100 and dive.reason == ""

    def test_a_dive_that_it_ended_is_withdrawn(self):
        first = self.ended_by((40, 0.5))
        state, (dive,) = told([first])
        assert dive.reason == "" and dive.end.lat == pytest.approx(LAT + 0.5 * KM)
        t = START + 180 + 7200 + 300
        state, (withdrawn,) = extend(state, fixes(segment("b", t - 10, {}), (t, 3.0), (t + 30, 3.01)))
        assert withdrawn.t_dive == dive.t_dive and withdrawn.reason == "stale fix"
        assert withdrawn.unusable is Unusable.STALE_FIX
        assert withdrawn.track is None and withdrawn.current is None
        assert withdrawn.end.lat == pytest.approx(LAT + 3 * KM)  # where it really surfaced
        assert state.fix.t == t + 30

    def test_a_withdrawn_dive_gets_no_current(self):
        state, _ = told([self.ended_by((40, 0.5))])
        t = START + 180 + 7200 + 300
        b = fixes(
            segment("b", t - 10, {"current_x": [(t, 0.3)], "current_y": [(t, 0.1)]}), (t, 3.0), (t + 30, 3.01)
        )
        _, (withdrawn,) = extend(state, b)
        assert withdrawn.current is None

    def test_zero_displacement_is_suspect_until_confirmed(self):
        state, (dive,) = told([self.ended_by((40, 0.11))])
        assert dive.reason == "no fix"
        t = START + 180 + 7200 + 400
        _, (dive,) = extend(state, fixes(segment("b", t - 10, {}), (t, 0.12)))
        assert dive.reason == "" and dive.end.t == START + 180 + 7200 + 40


class TestCurrent:
    def test_provisional_then_final(self):
        segments = mission(LEGS)
        state, (dive,) = extend(Navigation(), segments[0])
        assert current_of(dive) == (0.12, -0.07) and not dive.current.final
        _, (again, new) = extend(state, segments[1])
        assert again.t_dive == dive.t_dive and current_of(again) == (0.1, -0.05) and again.current.final
        assert again.track is dive.track
        assert current_of(new) == (0.17, -0.02)

    def test_final_after_the_next_dive_has_begun(self):
        """40 min after the surfacing the glider is under water again."""
        first, second = mission(LEGS[:2])
        t = second.id.opened_at + 1900
        late = with_samples(
            second,
            current_x=[(t, 0.3), *_tail(second, "current_x")],
            current_y=[(t, 0.2), *_tail(second, "current_y")],
            current_final_x=[(t, 0.3)],
            current_final_y=[(t, 0.2)],
        )
        late = replace(late, declination=0.0)
        _, dives = told([replace(first, declination=0.0), late])
        assert current_of(dives[0]) == (0.3, 0.2) and dives[0].current.final
        assert current_of(dives[1]) != (0.3, 0.2) and not dives[1].current.final

    def test_final_within_a_dive_whose_end_comes_with_the_next_file(self):
        first, second = (replace(s, declination=0.0) for s in mission(LEGS[:2]))
        t = second.id.opened_at + 1900
        half = with_samples(cut(second, t + 60), current_x=[(t, 0.3)], current_y=[(t, 0.2)])
        _, dives = told([first, half])
        # as far as is known the second dive may have ended just then: the value waits
        assert current_of(dives[0]) != (0.3, 0.2)
        rest = {k: s.between(t + 61, np.inf) for k, s in second.quantities.items()}
        end = replace(
            second,
            id=replace(second.id, opened_at=t + 90, name="c"),
            quantities={k: s for k, s in rest.items() if len(s)},
        )
        _, dives = told([first, half, end])
        assert current_of(dives[0]) == (0.3, 0.2)
        assert [d.reason for d in dives] == ["", ""]

    def test_without_a_sensor_for_corrected_values_the_second_is_final(self):
        _, dives = told(mission(LEGS, with_final=False))
        assert [d.current.final for d in dives] == [True, True, True, False]
        assert [current_of(d) for d in dives[:3]] == [leg.current for leg in LEGS[:3]]

    def test_a_stale_value_gives_none(self):
        """The glider goes on reporting the current of the first dive."""
        first, second = mission(LEGS[:2])
        stale = {
            f"current_{c}": [(t, first.get(f"current_{c}").v[-1]) for t in second.get("current_x").t]
            for c in "xy"
        }
        _, dives = told([first, with_samples(second, **stale, current_final_x=None, current_final_y=None)])
        assert dives[1].current is None

    def test_a_surfacing_without_a_fix_closes_nothing_and_takes_no_current(self):
        """Three dives; the fixes after the second and before the third are in no file. What was published
        between them is neither the first dive's, nor that of all the way to the next fix."""
        made = mission([*LEGS[:1], Leg(hours=3), Leg(hours=3)])
        t = opened([*LEGS[:1], Leg(hours=3)], 2)  # when the third segment opens
        ends = t - 1200.0, t + 3600.0
        second, third = (
            {k: (v.between(*span) if k in {"fix_lat", "fix_lon"} else v) for k, v in each.quantities.items()}
            for each, span in ((made[1], (0.0, ends[0])), (made[2], (ends[1], np.inf)))
        )
        _, dives = told([made[0]])
        kept = current_of(dives[0])
        _, dives = told([made[0], replace(made[1], quantities=second), replace(made[2], quantities=third)])
        assert len(dives) == 2
        first, long = dives
        # corrected at the start of the second segment, and not by what came four hours later
        assert current_of(first) == pytest.approx((0.1, -0.05)) and kept == pytest.approx((0.12, -0.07))
        assert long.features.surfacing_unseen and long.current is None
        assert any("surfaced without a fix" in note for note in long.notes)

    def test_a_value_from_before_the_first_dive_gives_none(self):
        s = mission(LEGS[:1])[0]
        early = {f"current_{c}": [(START + 60, 0.4)] for c in "xy"}
        _, (dive,) = told([with_samples(s, **early)])
        assert dive.current is None

    def test_the_current_of_a_short_dive_is_not_that_of_the_one_before(self):
        legs = [LEGS[0], Leg(hours=0.15, current=(0.9, 0.9)), LEGS[1]]
        _, dives = told(mission(legs))
        assert [current_of(d) for d in dives] == [LEGS[0].current, (0.17, -0.02)]


def _tail(s: Segment, name: str) -> list[tuple[float, float]]:
    """The value at the end of a segment of a mission."""
    return [(float(s.get(name).t[-1]), float(s.get(name).v[-1]))]


class TestHoles:
    def halves(self) -> list[Segment]:
        """The second dive in three files of 40 min, so that one can be missing."""
        first, second, third = mission(LEGS[:3])
        edges = [second.id.opened_at + x for x in (0.0, 2500.0, 5000.0, 99999.0)]
        parts = []
        for k, (a, b) in enumerate(pairwise(edges)):
            held = {n: s.between(a, b - 1e-6) for n, s in second.quantities.items()}
            held = {n: s for n, s in held.items() if len(s)}
            name = f"{second.id.name}-{k}"
            parts.append(
                replace(
                    second,
                    id=replace(second.id, opened_at=a, name=name),
                    quantities=held,
                    last_t=min(b - 30, second.last_t),
                )
            )
        return [first, *parts, third]

    def test_a_missing_file_is_missing_data(self):
        a, b, _, d, e = self.halves()
        _, dives = told([a, b, d, e])
        assert dives[1].reason.startswith("data missing: 0.7 of 2.")
        assert [x.unusable for x in dives] == [None, Unusable.DATA_MISSING, None]
        assert [x.reason for x in (dives[0], dives[2])] == ["", ""]

    def test_nothing_is_missing_when_it_is_there(self):
        _, dives = told(self.halves())
        _, whole = told(mission(LEGS[:3]))
        assert [d.reason for d in dives] == ["", "", ""]
        assert dives[1].track.x == pytest.approx(whole[1].track.x)

    def test_a_whole_dive_that_is_missing_is_told_as_such(self):
        segments = mission(LEGS)
        _, dives = told([segments[0], *segments[2:]])
        assert [d.reason[:12] for d in dives] == ["", "data missing", "", ""]
        assert dives[1].end.t == segments[2].get("fix_lat").t[0]
        assert dives[1].t_dive >= dives[0].t_surface and dives[1].t_surface <= dives[2].t_dive

    def test_its_current_is_not_that_of_the_dive_before(self):
        segments = mission(LEGS)
        _, dives = told([segments[0], *segments[2:]])
        assert current_of(dives[0]) == (0.12, -0.07) and not dives[0].current.final
        assert current_of(dives[1]) == LEGS[1].current

    def test_half_an_hour_at_the_surface_between_missions_hides_no_dive(self):
        first, second = mission(LEGS[:2])
        waited = 1500.0
        later = {k: series(list(zip(s.t + waited, s.v, strict=True))) for k, s in second.quantities.items()}
        second = replace(
            second,
            id=replace(second.id, opened_at=second.id.opened_at + waited),
            quantities=later,
            last_t=second.last_t + waited,
        )
        _, dives = told([first, second])
        assert [d.reason for d in dives] == ["", ""]
        assert current_of(dives[0]) == LEGS[0].current


class TestDeclination:
    def test_the_gliders_own_goes_before_a_model(self):
        """Short files without it are not turned by another angle than the rest of the dive."""
        first, second = mission(LEGS[:2], declination=-0.284)
        modelled = replace(second, declination=-0.270, declination_source="WMM2020")
        state, _ = told([first, modelled])
        assert state.declination == -0.284
        _, dives = told([first, modelled])
        assert not any("model" in note for d in dives for note in d.notes)

    def test_a_model_where_the_glider_never_tells(self):
        segments = [replace(s, declination_source="WMM2020") for s in mission(LEGS[:2])]
        _, dives = told(segments)
        assert "magnetic declination from the model WMM2020" in dives[1].notes

    def test_the_last_known_where_a_segment_has_none(self):
        first, second = mission(LEGS[:2], declination=0.2)
        _, dives = told([first, replace(second, declination=None)])
        assert dives[1].track.heading[5] == pytest.approx([np.sin(1.0), np.cos(1.0)])

    def test_none_at_all_is_said(self):
        _, dives = told([replace(s, declination=None) for s in mission(LEGS[:2])])
        assert any("declination unknown" in note for note in dives[0].notes)


def test_notes_on_the_data():
    s = replace(mission(LEGS[:1])[0], dropped={"pitch": 3})
    _, (dive,) = told(
        [
            with_samples(
                s,
                heading=None,
                heading_commanded=list(zip(s.get("heading").t, s.get("heading").v, strict=True)),
            )
        ]
    )
    assert "3 values of pitch out of range dropped" in dive.notes
    assert "commanded heading used, the measured one is not in the file" in dive.notes


def test_heading_alone_is_said_to_be_unsure():
    _, dives = told([with_samples(s, pitch=None, depth=None) for s in mission(LEGS[:1])])
    assert any("cannot be told from flight" in note for note in dives[0].notes)


def test_the_state_does_not_grow():
    legs = LEGS * 10
    sizes = []
    state = Navigation()
    for s in mission(legs):
        state, _ = extend(state, s)
        sizes.append(sum(len(x) for x in state.carry.values()))
    assert max(sizes[1:]) == sizes[-1] < 40
