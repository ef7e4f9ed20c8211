"""Each heuristic of health at work, just below and just above where it decides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from gliderwatch.health.battery import END, battery_end
from gliderwatch.health.leaks import trend
from gliderwatch.health.readings import History, Readings, joined, of_segment, recent
from gliderwatch.health.rule import Finding
from gliderwatch.health.rules import judge, usual_limits
from gliderwatch.model import Segment, SegmentId, Series, readonly
from gliderwatch.store.state_file import Store

T0, DAY, HOUR = 1.7e9, 86400.0, 3600.0
LIMITS = usual_limits()


def series(values: Sequence[float], step: float = HOUR, start: float = T0) -> Series:
    return Series(readonly(start + step * np.arange(len(values))), readonly(values))


def readings(**quantities: Series) -> Readings:
    """Of a segment with these."""
    return of_segment(Segment(SegmentId(T0, "a", "a-1"), "m", "sbd", T0 + HOUR, (1, 1, ""), quantities))


def history(name: str, before: Sequence[float], fresh: Sequence[float], step: float = HOUR) -> History:
    now = series(fresh, step, T0 + step * len(before))
    return History(({name: series(before, step)},), {name: now})


def found(rule: str, given: History) -> Finding | None:
    return judge(given, {rule: LIMITS[rule]}).get(rule)


# ------------------------------------------------------------------------ readings


@pytest.mark.parametrize(("n", "kept"), [(60, 60), (68, 24 + 10)])
def test_64_readings_of_a_file_are_kept_as_they_are_and_of_more_24_bins_and_the_last_10(
    n: int, kept: int
) -> None:
    assert len(readings(leak_voltage=series([2.5] * n, 60.0))["leak_voltage"]) == kept


@pytest.mark.parametrize(("apart", "n"), [(2.0, 1), (4.0, 2)])
def test_readings_within_3_s_are_one(apart: float, n: int) -> None:
    assert len(joined([series([1.0]), series([1.0], start=T0 + apart)])) == n


@pytest.mark.parametrize(("pause", "n"), [(2.5, 1), (3.5, 0)])
def test_three_days_without_readings_are_another_deployment(pause: float, n: int) -> None:
    rows: list[tuple[float, Readings]] = [(T0, {}), (T0 + pause * DAY, {})]
    assert len(recent(rows)) == n


def test_thirty_days_are_looked_back_on() -> None:
    assert len(recent([(T0 + DAY * k, {}) for k in range(50)])) == 30


@pytest.mark.parametrize(("depth", "name"), [(1.5, "gas_density_surface"), (3.0, ""), (6.0, "gas_density")])
def test_the_surface_ends_at_2_m_and_flight_begins_at_5_m(depth: float, name: str) -> None:
    given = {"vacuum": series([25e3] * 3), "vehicle_temperature": series([15.0] * 3)}
    assert [*readings(depth=series([depth] * 3), **given)][1:] == ([name] if name else [])


@pytest.mark.parametrize(("up", "turns"), [(4.0, 1), (7.0, 2)])
def test_5_m_part_two_approaches_of_the_bottom(up: float, turns: int) -> None:
    assert len(readings(altitude=series([30.0, 10.0, 10.0 + up, 9.9, 30.0], 60.0))["altitude"]) == turns


@pytest.mark.parametrize(("minutes", "turns"), [(9.0, 1), (11.0, 2)])
def test_10_min_out_of_range_part_two_approaches(minutes: float, turns: int) -> None:
    t = T0 + 60.0 * np.array([0.0, 1.0, 2.0, 2.0 + minutes, 3.0 + minutes])
    altitude = Series(readonly(t), readonly([12.0, 10.0, 11.0, 10.5, 12.0]))
    assert len(readings(altitude=altitude)["altitude"]) == turns


@pytest.mark.parametrize(("n", "has"), [(4, False), (5, True)])
def test_five_positions_in_flight_tell_how_a_motor_follows(n: int, has: bool) -> None:
    given = readings(
        fin=series([0.1] * n, 60.0), fin_commanded=series([0.0] * n, 60.0), depth=series([20.0] * n)
    )
    assert ("fin_error" in given) is has


def test_what_rules_found_in_the_last_45_days_makes_incidents() -> None:
    store = Store.open(":memory:")
    for day in range(0, 100, 2):
        store.health.put(
            "a", f"a-{day}", T0 + day * DAY, {"leak_voltage": series([2.5], start=T0 + day * DAY)}
        )
    assert len(store.health.judge("a", LIMITS)) == 23


# --------------------------------------------------------------------------- rules


@pytest.mark.parametrize(("n", "is_found"), [(19, False), (20, True)])
def test_20_readings_tell_what_is_usual_for_a_detector(n: int, is_found: bool) -> None:
    """Below its own median by 0.04 V, and still above the limits of all gliders."""
    assert (found("leak", history("leak_voltage", [2.52] * n, [2.48] * 2)) is not None) is is_found


@pytest.mark.parametrize(("n", "is_found"), [(7, False), (8, True)])
def test_8_files_tell_what_is_usual_of_one_value_a_file(n: int, is_found: bool) -> None:
    given = history("roll_in_flight", [0.0] * n, [0.5] * 2)
    assert (found("roll", given) is not None) is is_found


USUAL_NOISE = [0.0, 0.01, -0.01, 0.02, -0.02] * 4
"""rad: its median deviation is 0.01, a robust sigma of 0.0148."""


@pytest.mark.parametrize(("off", "is_found"), [(0.095, False), (0.12, True)])
def test_a_fin_is_off_by_0_1_rad(off: float, is_found: bool) -> None:
    given = history("fin_error", [0.0, 0.001, -0.001] * 4, [off] * 2)
    assert (found("motors", given) is not None) is is_found


@pytest.mark.parametrize(("sigmas", "is_found"), [(5.5, False), (7.5, True)])
def test_a_fin_that_is_seldom_where_it_should_be_is_off_by_six_sigma(sigmas: float, is_found: bool) -> None:
    before = [2.0 * v for v in USUAL_NOISE]
    given = history("fin_error", before, [sigmas * 1.4826 * 0.02] * 2)
    assert (found("motors", given) is not None) is is_found


@pytest.mark.parametrize(
    ("name", "least"), [("battery_position", 0.005), ("ballast", 30e-6), ("oil_volume", 30e-6)]
)
def test_other_motors_are_off_by_some_times_their_deadband(name: str, least: float) -> None:
    before = [0.0] * 12
    assert found("motors", history(f"{name}_error", before, [0.9 * least] * 2)) is None
    assert found("motors", history(f"{name}_error", before, [1.1 * least] * 2)) is not None


@pytest.mark.parametrize(("n", "is_found"), [(9, False), (10, True)])
def test_of_ten_calls_the_part_is_counted_that_was_cut(n: int, is_found: bool) -> None:
    given = history("call_cut", [0.0] * (n - 6) + [1.0] * 6, [0.0])
    assert (found("cut_calls", given) is not None) is is_found


def test_older_calls_do_not_count() -> None:
    assert found("cut_calls", history("call_cut", [1.0] * 10 + [0.0] * 5 + [1.0] * 5, [0.0])) is None


# ------------------------------------------------------------------------- battery


def charge(days: float, use: Sequence[float], step: float = 0.25) -> History:
    """Charge (0 to 1) every 6 h that falls by `use` (part a day), the last of it to the end."""
    n = int(days / step)
    rates = np.array([use[min(i * len(use) // n, len(use) - 1)] for i in range(n)])
    values = 0.9 - np.concatenate([[0.0], np.cumsum(rates * step)])
    return history("battery_charge", values[:-1].tolist(), [float(values[-1])], step * DAY)


@pytest.mark.parametrize(("days", "has"), [(1.75, False), (2.25, True)])
def test_four_blocks_of_half_a_day_tell_the_end(days: float, has: bool) -> None:
    assert (battery_end(charge(days, [0.02]), LIMITS["battery_end"]) is not None) is has


def test_the_end_is_that_of_the_use_of_the_last_ten_days() -> None:
    """Ten days at 1 % a day, then five at 4 % and five at 2 %: 3 % a day; 10 % are held back."""
    end = battery_end(charge(20.0, [0.01, 0.01, 0.04, 0.02]), LIMITS["battery_end"])
    assert end is not None
    assert end.left / DAY == pytest.approx((0.9 - 0.4 - 0.1) / 0.03, rel=0.02)


def test_the_interval_of_the_end_has_95_per_cent() -> None:
    """Two rates in turn, of which each half a day has one: a mean of 0.03 a day, sigma 0.0103, 20 blocks."""
    end = battery_end(charge(10.0, [0.02, 0.02, 0.04, 0.04] * 10, step=0.25), LIMITS["battery_end"])
    assert end is not None
    mean, sigma = 0.03, np.std([0.02, 0.04] * 10, ddof=1)
    reach = 2.093 * sigma * (1 / 20 + 1 / 20) ** 0.5  # Student's t of 19
    assert end.left / end.earliest == pytest.approx((mean + reach) / mean, rel=0.01)


@pytest.mark.parametrize(("part", "share"), [(0.04, 0.0), (0.06, 1.0)])
def test_a_twentieth_of_the_time_is_flown_with_the_thruster(part: float, share: float) -> None:
    given = charge(10.0, [0.02])
    use = series([part] * 100, 0.1 * DAY)
    end = battery_end(
        History(({**given.before[0], "thruster_use": use},), given.fresh), LIMITS["battery_end"]
    )
    assert end is not None
    assert end.thruster == share


# ----------------------------------------------------------------------- slow leak

INHG = 3386.389


def falling(files: int, a_day: float) -> History:
    """Gas density of so many files of which each day has some: the vacuum falls by 2 inHg a week."""
    t = np.arange(files) / a_day
    density = ((101325.0 - (8.0 - 2.0 * t / 7.0) * INHG) / 288.0).tolist()
    return history("gas_density", density[:-1], density[-1:], DAY / a_day)


@pytest.mark.parametrize(("days", "is_found"), [(1.375, False), (1.625, True)])
def test_the_shortest_window_of_a_slow_leak_is_two_days_and_a_half(days: float, is_found: bool) -> None:
    """Readings have to fill six tenths of it."""
    assert (found("slow_leak", falling(round(8 * days) + 1, 8.0)) is not None) is is_found


@pytest.mark.parametrize(("files", "is_found"), [(10, False), (11, True)])
def test_a_trend_has_more_than_ten_files(files: int, is_found: bool) -> None:
    assert (found("slow_leak", falling(files, 5.0)) is not None) is is_found


def test_a_trend_is_as_sure_as_three_sigma_in_any_of_three_windows() -> None:
    """Student's t of 99 independent values, of a chance of 0.00135 / 3."""
    t = np.arange(100) * HOUR
    *_, surely = trend(t, np.where(np.arange(100) % 2, 1000.0, -1000.0))
    assert surely == pytest.approx(3.43, abs=0.02)


def test_a_vacuum_without_noise_is_a_hundredth_of_an_inch_off_its_line() -> None:
    """A fifth of a step of the sensor; of residuals that are none the correlation is 1 / n."""
    t = np.arange(20) * HOUR
    _, sigma, _ = trend(t, np.zeros(20))
    spread = np.sqrt(np.sum((t - t.mean()) ** 2))
    assert sigma == pytest.approx(0.01 * INHG / spread * ((1 + 1 / 20) / (1 - 1 / 20)) ** 0.5)


def test_the_vacuum_falls_as_much_as_it_does_at_one_temperature() -> None:
    leak = found("slow_leak", falling(14, 8.0))
    assert leak is not None
    assert "falls by 2.00 +-" in leak.text


def test_gas_density_is_pressure_by_kelvin() -> None:
    given = readings(
        vacuum=series([25e3] * 3), vehicle_temperature=series([15.0] * 3), depth=series([9.0] * 3)
    )
    assert given["gas_density"].v == pytest.approx((101325.0 - 25e3) / 288.15)


def test_readings_that_follow_each_other_are_never_more_alike_than_nine_tenths() -> None:
    """Up for a quarter, down for a half, up again: their correlation is 0.95, and counts as 0.9."""
    t, v = np.arange(80.0), np.repeat([1e4, -1e4, -1e4, 1e4], 20)
    slope, sigma, _ = trend(t, v)
    variance, spread = 80 * 1e8 / 78, 80 * (80**2 - 1) / 12
    assert slope == pytest.approx(0.0, abs=1e-6)
    assert sigma == pytest.approx((variance / spread * 1.9 / 0.1) ** 0.5, rel=1e-6)


def test_a_reading_five_deviations_off_the_line_is_drawn_in() -> None:
    """At three deviations: it has some six tenths of its weight, and so of the slope that it makes."""
    t, v = np.arange(40.0), np.tile([1e4, -1e4], 20)
    v[-1] = 7.5e4
    part = trend(t, v)[0] / np.polyfit(t, v, 1)[0]
    assert 0.5 < part < 0.75


def test_what_a_battery_holds_is_given_in_ampere_hours_and_reckoned_in_coulombs() -> None:
    (limit,) = (limit for limit in END.limits if limit.name == "capacity")
    assert (limit.unit, limit.si) == ("Ah", 3600.0)
