"""The heuristics of the sea do what their page says: each case lies just on one side of a bound."""

import math

import numpy as np
import pytest

from gliderwatch.model import Fix, readonly
from gliderwatch.sea import flow_forecast, gauss_markov
from gliderwatch.sea.flow_forecast import (
    PLAIN_GRID,
    TIDAL_GRID,
    Currents,
    Score,
    choice,
    init_bank,
    learn,
    learn_bank,
    notes,
    predict,
)
from gliderwatch.sea.gauss_markov import FlowParams, crossing, intensities, prior, rates
from gliderwatch.sea.ocean_field import Field
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


class TestForecast:
    def test_what_is_tried(self):
        """Changes in 3 h and memories without tides; with tides amplitudes of M2 too."""
        steps = PLAIN_GRID.sigma * np.sqrt(2 * -np.expm1(-3 * HOUR / PLAIN_GRID.tau))
        assert sorted(set(steps.round(6))) == [0.015, 0.04, 0.12]
        assert sorted(set((PLAIN_GRID.tau / HOUR).round(6))) == [10, 30, 100, 1000]
        steps = TIDAL_GRID.sigma * np.sqrt(2 * -np.expm1(-3 * HOUR / TIDAL_GRID.tau))
        assert sorted(set(steps.round(6))) == [0.02, 0.08]
        assert sorted(set((TIDAL_GRID.tau / HOUR).round(6))) == [30, 300]
        assert sorted(set(np.sqrt(TIDAL_GRID.prior[:, 0]).round(6))) == [0.05, 0.2]
        assert np.sqrt(TIDAL_GRID.q * DAY / TIDAL_GRID.prior) == pytest.approx(0.1)

    def learnt(self, bank, current, dives=0):
        start = bank.t + 600
        return learn_bank(bank, start, start + 3 * HOUR, np.array(current), 0.006, dives, PLAIN_GRID)[0]

    def test_the_scale_begins_wide_is_learnt_over_40_dives_and_is_bounded(self):
        bank = init_bank(0.0, PLAIN_GRID)
        assert set(bank.scale) == {1.5}
        wild = self.learnt(bank, [50.0, 0.0])
        assert wild.scale == pytest.approx(1.5 * (1 + 8 / 7))
        late = self.learnt(bank, [50.0, 0.0], dives=500)
        assert late.scale == pytest.approx(1.5 * (1 + 8 / 40))
        for k in range(40):
            wild = self.learnt(wild, [50.0 * (-1) ** k, 0.0])
        assert set(wild.scale) == {9.0}
        for k in range(400):
            wild = self.learnt(wild, [0.0, 0.0], k)
        assert wild.scale.min() == 0.1

    def test_a_wild_dive_counts_as_in_student_s_t_of_6(self):
        bank = self.learnt(init_bank(0.0, PLAIN_GRID), [0.1, 0.0])
        near, far = self.learnt(bank, [1e3, 0.0]), self.learnt(bank, [1e4, 0.0])
        assert near.fit - far.fit == pytest.approx((6 + 2) / 2 * math.log(100), rel=1e-3)

    def test_a_likelihood_is_forgotten_in_100_dives(self):
        bank = self.learnt(init_bank(0.0, PLAIN_GRID), [0.1, 0.0])
        raised = flow_forecast.Bank(bank.t, bank.mean, bank.cov, readonly(bank.fit + 100.0), bank.scale)
        assert self.learnt(raised, [0.1, 0.0]).fit - self.learnt(bank, [0.1, 0.0]).fit == pytest.approx(99.0)

    @pytest.mark.parametrize(("days", "known"), [(2.9, True), (3.1, False)])
    def test_after_three_days_the_sea_is_unknown(self, days, known):
        state = learn(Currents(), 0.0, 3 * HOUR, np.array([0.1, 0.0]), 0.006)
        start = 3 * HOUR + days * DAY
        assert (predict(state, start, start + 3 * HOUR) is not None) == known

    @pytest.mark.parametrize(("dives", "chosen"), [(5.9, "persistence"), (6.1, "tides")])
    def test_six_dives_decide(self, dives, chosen):
        score = Score(dives, persistence=1.0, residual=0.5, tides=0.1, gain=1.0, gain_squared=0.01)
        assert choice(Currents(score=score)) == chosen

    @pytest.mark.parametrize(("errors", "chosen"), [(1.9, "residual"), (2.1, "tides")])
    def test_tides_are_better_by_two_standard_errors(self, errors, chosen):
        score = Score(9.0, persistence=1.0, residual=0.5, tides=0.1, gain=errors, gain_squared=1.0)
        assert choice(Currents(score=score)) == chosen

    @pytest.mark.parametrize(
        ("apart", "n", "noted"), [(1.09, 8, True), (1.11, 8, False), (1.0, 7, False), (1.0, 9, True)]
    )
    def test_a_tide_hides_behind_eight_even_intervals(self, apart, n, noted):
        state = Currents()
        for k in range(n + 1):
            end = (k + 1) * 6.21 * HOUR + (apart - 1) * 6.21 * HOUR * (k >= 5)
            state = learn(state, end - 2 * HOUR, end, np.array([0.1, 0.0]), 0.006)
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
