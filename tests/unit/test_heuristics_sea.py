"""The heuristics of the sea do what their page says: each case lies just on one side of a bound."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from gliderwatch.model import Fix, readonly
from gliderwatch.sea import gauss_markov, ocean_files, smoother
from gliderwatch.sea.flow_forecast import Currents, learn, notes, predict, unknown_sea
from gliderwatch.sea.gauss_markov import FlowParams, crossing, intensities, prior, rates
from gliderwatch.sea.ocean_field import Field
from gliderwatch.sea.smoother import MeanCurrent
from gliderwatch.sea.tides import Constituent, aliasing

HOUR, DAY = 3600.0, 86400.0
FLOW = FlowParams()


class TestFlow:
    def test_sizes_before_any_dive(self):
        sizes = np.sqrt(prior(FLOW))[::2]
        assert sizes == pytest.approx(
            [0.3, 0.08, 0.06, *[0.25] * 2, *[0.12] * 2, *[0.06] * 2, *[0.15] * 2, *[0.12] * 2, 0.0]
        )

    def test_memories(self):
        fades = -1 / rates(30.0, FLOW).real[:3]
        assert fades == pytest.approx([18 * DAY, 30 * HOUR, 3 * DAY])

    def test_a_tide_changes_by_8_percent_in_a_day_and_by_half_a_millimetre_at_least(self):
        state = np.zeros(FLOW.size)
        assert math.sqrt(intensities(state, 1.0, FLOW)[3] * DAY) == pytest.approx(0.08 * 0.005)
        state[6:8] = 0.5
        assert math.sqrt(intensities(state, 1.0, FLOW)[3] * DAY) == pytest.approx(0.08 * 0.5, rel=1e-3)

    def test_a_current_differs_by_half_of_itself_over_30_km(self):
        ground = np.array([0.3, 0.0])
        assert crossing(np.array([1.0, 0.0]), ground, 1e5, FLOW) == pytest.approx(0.5)
        assert gauss_markov.crossing(np.array([1.0, 0.0]), ground, 3e5, FLOW) == 1.0


def fix(t: float) -> Fix:
    return Fix(t, 41.0, -60.0)


class TestForecast:
    def test_kinds_of_sea(self):
        """Restless by 0.3 and 3, inertial motion by 0.1 and 1, tides by 0.03 and 0.3 of what is usual; and
        three with weather alone, in one of which what passes is gone in 10 h."""
        each = np.arange(13)
        sizes = np.sqrt(unknown_sea().cov[:, each, each])
        sea = np.sqrt([0.3] * 4 + [3] * 4 + [0.3, 3, 1])
        assert sizes[:, 0] == pytest.approx(0.3)
        assert sizes[:, 1] == pytest.approx(0.08 * sea * np.sqrt([1] * 10 + [10 / 30]))
        assert sizes[:, 2] == pytest.approx(0.06 * sea * np.array([0.1, 0.1, 1, 1] * 2 + [0.01] * 3))
        assert sizes[:, 3] == pytest.approx(0.25 * np.array([0.03, 0.3] * 4 + [0.001] * 3))

    def test_what_lasts_changes_a_hundred_times_less_where_what_passes_is_soon_gone(self):
        state = self.learnt(Currents(), [0.1, 0.0])
        spreads = []
        for kind in (8, 9, 10):
            fit = np.full(11, -1e3)
            fit[kind] = 0.0
            alone = replace(state, sea=replace(state.sea, fit=readonly(fit), scale=np.ones(11)))
            start = state.end + 2.9 * DAY
            spreads.append(predict(alone, fix(start), fix(start + 60)).cov[0, 0])
        lasts, own = math.exp(-2 * 2.9 / 18), np.array([0.3, 3.0, 0.03])
        passes = 0.08**2 * np.array([0.3, 3.0, 1 / 3])
        unknown = 1 / (1 / 0.3**2 + 1 / passes)  # what passed on the dive may have lasted
        assert spreads == pytest.approx(unknown * lasts + 0.3**2 * own * (1 - lasts) + passes, rel=0.06)

    def learnt(self, state, current, dives=None):
        state = state if dives is None else replace(state, dives=dives)
        start = (state.end or 0.0) + 600
        return learn(state, fix(start), fix(start + 3 * HOUR), np.array(current), 0.006)

    def test_the_scale_begins_wide_is_learnt_over_40_dives_and_is_bounded(self):
        assert set(unknown_sea().scale) == {1.5}
        wild = self.learnt(Currents(), [50.0, 0.0])
        assert wild.sea.scale == pytest.approx(1.5 * (1 + 8 / 7))
        late = self.learnt(Currents(), [50.0, 0.0], dives=500)
        assert late.sea.scale == pytest.approx(1.5 * (1 + 8 / 40))
        for k in range(40):
            wild = self.learnt(wild, [50.0 * (-1) ** k, 0.0])
        assert set(wild.sea.scale) == {9.0}
        for k in range(400):
            wild = self.learnt(wild, [0.0, 0.0], k)
        assert wild.sea.scale.min() == 0.1

    def test_a_wild_dive_counts_as_in_student_s_t_of_6(self):
        state = self.learnt(Currents(), [0.1, 0.0])
        near, far = self.learnt(state, [1e3, 0.0]), self.learnt(state, [1e4, 0.0])
        assert near.sea.fit - far.sea.fit == pytest.approx((6 + 2) / 2 * math.log(100), rel=1e-3)

    def test_a_likelihood_is_forgotten_in_100_dives(self):
        state = self.learnt(Currents(), [0.1, 0.0])
        raised = replace(state, sea=replace(state.sea, fit=readonly(state.sea.fit + 100.0)))
        more = self.learnt(raised, [0.1, 0.0]).sea.fit - self.learnt(state, [0.1, 0.0]).sea.fit
        assert more == pytest.approx(99.0)

    @pytest.mark.parametrize(("errors", "named"), [(1.9, False), (2.1, True)])
    def test_a_tide_is_named_from_two_standard_errors_on(self, errors, named):
        state = self.learnt(Currents(), [0.1, 0.0])
        mean, cov = np.zeros_like(state.sea.mean), np.zeros_like(state.sea.cov)
        each = np.arange(13)
        mean[:, 3, 0], cov[:, each, each] = errors * math.sqrt(2 * 2 * 1e-4), 1e-4  # both ways, both parts
        seen = replace(state, sea=replace(state.sea, mean=mean, cov=cov, scale=np.ones(11)))
        start = state.end + 600
        assert ("M2" in predict(seen, fix(start), fix(start + HOUR)).source) == named

    @pytest.mark.parametrize(("days", "known"), [(2.9, True), (3.1, False)])
    def test_after_three_days_the_sea_is_unknown(self, days, known):
        state = learn(Currents(), fix(0.0), fix(3 * HOUR), np.array([0.1, 0.0]), 0.006)
        start = 3 * HOUR + days * DAY
        assert (predict(state, fix(start), fix(start + 3 * HOUR)) is not None) == known

    @pytest.mark.parametrize(
        ("apart", "n", "noted"), [(1.09, 8, True), (1.11, 8, False), (1.0, 7, False), (1.0, 9, True)]
    )
    def test_a_tide_hides_behind_eight_even_intervals(self, apart, n, noted):
        state = Currents()
        for k in range(n + 1):
            end = (k + 1) * 6.21 * HOUR + (apart - 1) * 6.21 * HOUR * (k >= 5)
            state = learn(state, fix(end - 2 * HOUR), fix(end), np.array([0.1, 0.0]), 0.006)
        assert bool(notes(state)) == noted


class TestTides:
    @pytest.mark.parametrize(("hours", "half"), [(6.4, True), (6.6, False)])
    def test_a_whole_number_of_half_periods(self, hours, half):
        (note,) = aliasing([Constituent.M2], hours * HOUR, 2 * HOUR)
        assert ("one half" in note) == half

    def test_a_tide_is_seen_at_42_percent_of_its_period(self):
        (note,) = aliasing([Constituent.M2], 6.2 * HOUR, 2 * HOUR)
        assert f"every {0.42 * 12.42:.1f} h or more often" in note

    @pytest.mark.parametrize(("hours", "away"), [(10.1, False), (10.4, True)])
    def test_a_fifth_of_a_tide_is_lost_in_noise(self, hours, away):
        (note,) = aliasing([Constituent.M2], hours * HOUR, hours * HOUR)
        assert ("averages" in note) == away


class TestField:
    def field(self, u: float = 0.1, land: int = 0) -> Field:
        east = np.full((2, 1, 2, 3), u)
        east[..., :land] = np.nan
        return Field(
            readonly([0.0, HOUR]),
            readonly([]),
            readonly([20.0, 21.0]),
            readonly([0.0, 1.0, 2.0]),
            east,
            east,
            "test",
        )

    @pytest.mark.parametrize(("hours", "known"), [(23, True), (25, False)])
    def test_it_holds_for_a_day(self, hours, known):
        assert isinstance(self.field().at((1 + hours) * HOUR, 20.5, 1.0, 10.0), tuple) == known

    @pytest.mark.parametrize(("lon", "wet"), [(0.4, False), (0.6, True)])
    def test_half_of_a_place_is_water(self, lon, wet):
        assert isinstance(self.field(land=1).at(0.0, 20.5, lon, 10.0), tuple) == wet

    def test_it_is_read_at_eight_places(self, monkeypatch):
        seen: list[float] = []
        at = Field.at
        monkeypatch.setattr(Field, "at", lambda self, t, *place: (seen.append(t), at(self, t, *place))[1])
        self.field().between(Fix(0.0, 20.2, 0.2), Fix(HOUR, 20.8, 1.8), 10.0)
        assert len(seen) == 8

    @pytest.mark.parametrize(("speed", "known"), [(9.0, True), (11.0, False)])
    def test_no_current_is_faster_than_10_metres_a_second(self, speed, known):
        """A fill value that the file does not call one."""
        values = xr.DataArray([0.2, -speed], dims="time", attrs={"units": "m s-1"})
        assert np.isfinite(ocean_files._values(Path("of-a-model.nc"), values, ["time"])).tolist() == [
            True,
            known,
        ]


class TestSmoother:
    def mission(self, current, n: int = 60) -> list[MeanCurrent]:
        """Dives of 3 h, one after the other, in a current to the east (m/s) by the time (h)."""
        return [
            MeanCurrent(3 * k * HOUR, 3 * (k + 1) * HOUR, readonly([current(3 * k + 1.5), 0.0]), 0.02, 54.0)
            for k in range(n)
        ]

    def test_currents_are_given_each_half_hour(self):
        found = smoother.smooth(self.mission(lambda hours: 0.1, 4), FlowParams())
        assert max(np.diff(found.delayed.t)) == 1800.0

    def test_where_a_dive_begins_two_fixes_are_a_metre_apart(self):
        params = FlowParams()
        steps, _ = smoother._forward(self.mission(lambda hours: 0.1, 2), params, 1.0, HOUR)
        assert np.sqrt(np.diag(steps[0].cov)[params.mean]) == pytest.approx([1.0, 1.0])

    def test_the_calmest_sea_is_a_tenth_and_the_liveliest_ten_times_as_restless(self):
        """And a tide that is not there is a thirtieth of the prior, a strong one is the prior itself."""
        chance = np.random.default_rng(1)
        calm = smoother.smooth(self.mission(lambda hours: 0.1), FlowParams())
        wild = smoother.smooth(self.mission(lambda hours: float(chance.normal(0.0, 0.8))), FlowParams())
        tide = smoother.smooth(
            self.mission(lambda hours: 1.5 * math.cos(hours * 2 * math.pi / 12.42)), FlowParams()
        )
        assert (calm.scale, calm.tides) == (0.1, 0.03)
        assert wild.scale == 10.0
        assert tide.tides == 1.0
