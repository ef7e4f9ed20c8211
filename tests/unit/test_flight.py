"""What is flight and what is drift at the surface."""

from dataclasses import replace

import numpy as np
import pytest

from gliderwatch.navigation.flight import Flight, find_flight, lengthened
from missions import series

H = 3600.0


def every(step: float, start: float, end: float, value=0.0):
    """Samples from start to end; `value` a number or a function of time."""
    t = np.arange(start, end + 1e-9, step)
    return [(x, value(x) if callable(value) else value) for x in t]


def samples(**quantities):
    out = {name: series(v) for name, v in quantities.items() if name != "heading"}
    if "heading" in quantities:
        out["heading_e"] = series(quantities["heading"])
        out["heading_n"] = series(quantities["heading"])
    return out


def yo(t: float) -> float:
    return 5 + 95 * abs(np.sin(t / 900))


def glide(t: float) -> float:
    return 0.4 if np.sin(2 * t / 900) > 0 else -0.4


DIVE = (600.0, 2 * H)
"""Start and end of the dive in all cases; the fixes are at 0 and 2 h 10 min."""
LAST = 2 * H + 600


def test_dense_depth():
    depth = every(60, 0, 540) + every(60, *DIVE, yo) + every(60, DIVE[1] + 60, LAST)
    flight = find_flight(samples(depth=depth, pitch=every(60, 0, LAST, glide)), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=60)


def test_depth_only_near_the_surface_and_pitch():
    depth = [*every(30, 0, 540), (590, 3.5), (DIVE[1] - 10, 4.0), *every(30, DIVE[1] + 30, LAST)]
    flight = find_flight(samples(depth=depth, pitch=every(120, *DIVE, glide)), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=121)
    assert flight.evidence == "depth and pitch"


def test_level_flight_with_thruster_below_the_surface():
    """Hardly ever steep, but no depth is reported for hours, which a glider at the surface would."""
    depth = every(30, 0, 540) + every(30, DIVE[1] + 30, LAST)
    pitch = [*every(120, 700, DIVE[1] - 100, 0.05), (620, -0.35), (DIVE[1] - 20, 0.4)]
    flight = find_flight(samples(depth=depth, pitch=pitch), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=121)


def test_sparse_depth_does_not_cut_the_ends_of_a_dive():
    """Depth every 5 min, pitch in between."""
    depth = every(300, 450, DIVE[1] + 250, lambda t: yo(t) if DIVE[0] <= t <= DIVE[1] else 0.0)
    flight = find_flight(samples(depth=depth, pitch=every(60, *DIVE, glide)), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=61)


def test_pitch_only():
    pitch = every(120, 0, 500, 0.05) + every(120, *DIVE, glide) + every(120, DIVE[1] + 60, LAST, -0.1)
    flight = find_flight(samples(pitch=pitch), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=121)
    assert flight.evidence == "pitch"


@pytest.mark.parametrize("stuck", [0.0, -1.5])
def test_a_depth_that_never_changes_denies_no_glide(stuck):
    """A sensor that is broken, or a number in its place."""
    pitch = every(60, 0, 540, 0.05) + every(60, *DIVE, glide) + every(60, DIVE[1] + 60, LAST, 0.05)
    flight = find_flight(samples(depth=every(60, 0, LAST, stuck), pitch=pitch), 0, LAST)
    assert (flight.start, flight.end, flight.evidence) == (*DIVE, "pitch")


def test_state_of_dead_reckoning():
    state = every(60, 0, 540, 4) + every(60, *DIVE, 1) + every(60, DIVE[1] + 60, LAST, 2)
    flight = find_flight(samples(dr_state=state, heading=every(60, 0, LAST)), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=61)


def test_time_of_dead_reckoning_counts_while_it_grows():
    """At the surface its last value stays until the next dive."""
    grows = every(60, *DIVE, lambda t: t - DIVE[0])
    time = every(60, 0, 540, 5000.0) + grows + every(60, DIVE[1] + 60, LAST, DIVE[1] - DIVE[0])
    flight = find_flight(samples(dr_time=time, heading=every(60, 0, LAST)), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=121)


def test_heading_alone_takes_all_for_flight():
    flight = find_flight(samples(heading=every(600, *DIVE)), 0, LAST)
    assert (flight.start, flight.end, flight.evidence) == (0, LAST, "heading")


def test_heading_in_a_hole_of_the_depths():
    depth = every(30, 0, 540) + every(30, DIVE[1] + 30, LAST)
    flight = find_flight(samples(depth=depth, heading=every(600, *DIVE)), 0, LAST)
    assert (flight.start, flight.end) == pytest.approx(DIVE, abs=601)


def test_nothing_at_all():
    assert find_flight({}, 0, LAST) is None
    assert find_flight(samples(speed_onboard=every(60, 0, LAST, 0.3)), 0, LAST) is None


WAVES = np.random.default_rng(1).normal(0.0, 0.12, 1000)


def wavy(t: float) -> float:
    return float(WAVES[int(t / 60) % 1000])


@pytest.mark.parametrize("hours", [0.5, 1.0, 3.0])
class TestDrift:
    """A glider at the surface between two dives."""

    def test_with_depth(self, hours):
        drift = samples(depth=every(300, 0, hours * H, 0.3), pitch=every(60, 0, hours * H, -0.45))
        assert find_flight(drift, 0, hours * H) is None  # it floats nose down

    def test_with_pitch_in_waves(self, hours):
        flight = find_flight(samples(pitch=every(60, 0, hours * H, wavy)), 0, hours * H)
        assert flight is None or flight.duration < 120

    def test_with_depth_and_heading(self, hours):
        drift = samples(depth=every(300, 0, hours * H, 0.3), heading=every(60, 0, hours * H, 1.0))
        assert find_flight(drift, 0, hours * H) is None

    def test_with_dead_reckoning(self, hours):
        drift = samples(dr_time=every(60, 0, hours * H, 9000.0), heading=every(60, 0, hours * H))
        assert find_flight(drift, 0, hours * H) is None


class TestLengthened:
    """A flight of which the files hold the beginning, before a fix at `LAST`."""

    SEEN = Flight(600.0, 3000.0, "depth")
    SURFACE = every(30, 0, 540) + every(30, DIVE[1] + 30, LAST)

    def test_it_ends_where_the_glider_is_at_the_surface_again(self):
        flight = lengthened(self.SEEN, samples(depth=self.SURFACE), LAST, ())
        assert flight == replace(self.SEEN, end=DIVE[1] + 30)

    def test_a_position_tells_it_too_and_a_flat_pitch_of_a_turn_does_not(self):
        told = samples(fix_lat=[(7000, 1.0)], depth=[(700, 9.0)], pitch=[(3010, 0.0)])
        assert lengthened(self.SEEN, told, LAST, ()).end == 7000

    def test_pitch_tells_where_there_is_no_depth(self):
        assert lengthened(self.SEEN, samples(pitch=[(3010, 0.0)]), LAST, ()) == self.SEEN

    def test_it_ends_with_the_fix_at_last(self):
        assert lengthened(self.SEEN, samples(), LAST, ()).end == LAST

    def test_samples_near_by_leave_it_as_it_is(self):
        assert lengthened(self.SEEN, samples(depth=every(300, 0, LAST)), LAST, ()) == self.SEEN

    def test_a_missing_file_may_hold_a_drift(self):
        assert lengthened(self.SEEN, samples(depth=self.SURFACE), LAST, [(4000.0, 5000.0)]) == self.SEEN
