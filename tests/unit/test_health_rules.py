"""Rules of health: what each finds, what it leaves alone, and that one of its limits can be taken away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from gliderwatch.config.fields import Health, limits_of
from gliderwatch.health.battery import battery_end, without_resets
from gliderwatch.health.leaks import trend
from gliderwatch.health.readings import History, of_call, of_segment, recent
from gliderwatch.health.rule import Finding, Limits
from gliderwatch.health.rules import RULES, judge, usual_limits
from gliderwatch.model import Call, CallReading, Fix, Segment, SegmentId, Series, Severity, readonly

T0 = 1.7e9
DAY, HOUR, INHG = 86400.0, 3600.0, 3386.389
USUAL = usual_limits()
Given = Mapping[str, Sequence[float]]


def series(values: Sequence[float], start: float = T0, step: float = HOUR) -> Series:
    return Series(readonly(start + step * np.arange(len(values))), readonly(values))


def history(before: Given, fresh: Given, step: float = HOUR) -> History:
    """Readings one a step, the fresh ones after those before."""
    n = max((len(v) for v in before.values()), default=0)
    old = {name: series(v, step=step) for name, v in before.items()}
    new = {name: series(v, T0 + step * n, step) for name, v in fresh.items()}
    return History((old,), new)


def found(rule: str, h: History, **changed: float | None) -> Finding | None:
    limits: dict[str, Limits] = {rule: {**USUAL[rule], **changed}}
    return judge(h, limits).get(rule)


def severity(finding: Finding | None) -> Severity | None:
    return None if finding is None else finding.severity


WARNING, CRITICAL = Severity.WARNING, Severity.CRITICAL


@pytest.mark.parametrize(
    ("rule", "name", "values", "expected"),
    [
        ("leak", "leak_voltage", [2.49, 2.39, 2.39], CRITICAL),
        ("leak", "leak_voltage_forward", [2.49, 2.44, 2.43], WARNING),
        ("leak", "leak_voltage_science", [2.49, 2.30, 2.49], None),  # one reading is no leak
        ("leak", "leak_voltage", [2.478, 2.478, 2.478], None),  # the lowest of a healthy mission
        ("digifin_leak", "digifin_leak", [1022, 886, 1022, 886, 1022], None),  # a known glitch
        ("digifin_leak", "digifin_leak", [1022, 1001, 1000, 1001], WARNING),
        ("digifin_leak", "digifin_leak", [1022, 900, 900, 900, 900, 900], CRITICAL),
        ("vacuum", "vacuum", [6.09 * INHG] * 3, None),  # the lowest of a healthy mission
        ("vacuum", "vacuum", [10.58 * INHG] * 3, None),  # the highest
        ("vacuum", "vacuum", [5.9 * INHG] * 2, WARNING),
        ("vacuum", "vacuum", [4.4 * INHG] * 2, CRITICAL),
        ("vacuum", "vacuum", [11.6 * INHG] * 2, CRITICAL),
        ("battery_voltage", "battery_voltage", [13.98] * 3, None),
        ("battery_voltage", "battery_voltage", [10.9, 10.9], WARNING),
        ("battery_voltage", "battery_voltage", [10.4, 10.4], CRITICAL),
        ("battery_charge", "battery_charge", [0.21, 0.21], None),
        ("battery_charge", "battery_charge", [0.19, 0.19], WARNING),
        ("battery_charge", "battery_charge", [0.14, 0.14], CRITICAL),
        ("mission_time", "mission_time", [39 * DAY, 39.1 * DAY], None),
        ("mission_time", "mission_time", [41 * DAY, 41.1 * DAY], WARNING),
        ("mission_time", "mission_time", [44.5 * DAY, 44.6 * DAY], CRITICAL),
        ("memory", "heap_free", [283620.0] * 2, None),
        ("memory", "heap_free", [59e3] * 2, WARNING),
        ("memory", "heap_free", [49e3] * 2, CRITICAL),
        ("memory", "disk_free", [99e6] * 2, WARNING),
        ("fix", "fix_age", [29 * 60.0, 29 * 60.0], None),
        ("fix", "fix_age", [31 * 60.0, 31 * 60.0], WARNING),
        ("devices", "errors:digifin", [0, 0, 1, 1], CRITICAL),
        ("devices", "errors:digifin", [0, 0, 8, 0], None),  # a garbled digit
        ("devices", "warnings:all", [1, 91, 1], None),
        ("mission_time", "mission_time", [4 * DAY, 44.5 * DAY, 4.1 * DAY], None),
        ("devices", "errors:argos", [3, 4, 4], WARNING),
        ("devices", "errors:all", [7, 0, 0], None),  # a reset
        ("devices", "warnings:all", [1, 11, 11], WARNING),
        ("devices", "oddities:all", [277, 277 + 1001, 277 + 1002], WARNING),
        ("devices", "oddities:all", [277, 277 + 999, 277 + 999], None),
    ],
)
def test_limits(rule: str, name: str, values: list[float], expected: Severity | None) -> None:
    finding = found(rule, history({}, {name: values}))
    assert severity(finding) == expected
    if finding is not None:
        assert finding.quantity == name and len(finding.last) == len(values)


def test_two_in_a_row_may_be_in_two_files() -> None:
    assert severity(found("leak", history({"leak_voltage": [2.38]}, {"leak_voltage": [2.38]}))) == CRITICAL
    assert found("leak", history({"leak_voltage": [2.38, 2.38]}, {"leak_voltage": [2.49]})) is None


def test_leak_detector_below_its_own_median() -> None:
    before = {"leak_voltage": [2.495] * 30}
    assert severity(found("leak", history(before, {"leak_voltage": [2.46, 2.46]}))) == WARNING
    assert found("leak", history(before, {"leak_voltage": [2.47, 2.47]})) is None
    assert found("leak", history(before, {"leak_voltage": [2.46] * 2}), below_usual=None) is None
    assert found("leak", history({}, {"leak_voltage": [2.46, 2.46]})) is None  # nothing is usual yet


def test_altitude_is_judged_where_a_minimum_is_configured() -> None:
    low = history({}, {"altitude": [20.0, 7.0, 7.0]})
    assert found("altitude", low) is None
    assert severity(found("altitude", low, minimum=5.0)) == WARNING
    assert found("altitude", low, minimum=4.0) is None


def test_roll_steps_against_its_own() -> None:
    rng = np.random.default_rng(1)
    before = {"roll_in_flight": (0.1 + 0.02 * rng.standard_normal(20)).tolist()}
    assert severity(found("roll", history(before, {"roll_in_flight": [0.5, 0.5]}))) == WARNING
    assert found("roll", history(before, {"roll_in_flight": [0.5, 0.1]})) is None
    wide = {"roll_in_flight": np.linspace(0.1, 0.67, 20).tolist()}  # as of a healthy mission
    assert found("roll", history(wide, {"roll_in_flight": [0.67, 0.67]})) is None


def test_roll_that_stays_off_is_not_taken_for_usual() -> None:
    rng = np.random.default_rng(1)
    usual, off = 0.1 + 0.02 * rng.standard_normal(20), 0.5 + 0.02 * rng.standard_normal(120)
    lost = {"roll_in_flight": [*usual.tolist(), *off.tolist()]}
    still = found("roll", history(lost, {"roll_in_flight": [0.5]}))
    assert still is not None and still.t == T0 + 20 * HOUR
    assert "off the usual 5.9" in still.text
    assert found("roll", history(lost, {"roll_in_flight": [0.1]})) is None


def test_motor_that_does_not_do_what_is_commanded() -> None:
    before = {"ballast_error": [1e-6, -1e-6, 2e-6] * 5}
    assert severity(found("motors", history(before, {"ballast_error": [-60e-6, -60e-6]}))) == WARNING
    assert found("motors", history(before, {"ballast_error": [-20e-6, -20e-6]})) is None


def test_calls_that_are_cut() -> None:
    assert found("cut_calls", history({"call_cut": [1, 0] * 5}, {"call_cut": [1]})) is None
    assert (
        severity(found("cut_calls", history({"call_cut": [1, 1, 0, 1, 0] * 2}, {"call_cut": [0]}))) == WARNING
    )
    assert found("cut_calls", history({"call_cut": [1] * 9}, {"call_cut": [1]})) is None  # too few


class TestSlowLeak:
    def rows(self, rate: float, days: float = 6.0, seed: int = 0) -> History:
        """One density a file, eight a day; the vacuum falls at a rate (inHg a week)."""
        rng = np.random.default_rng(seed)
        t = np.arange(0, days * DAY, DAY / 8)
        vacuum = (8.0 - rate * t / (7 * DAY) + 0.05 * rng.standard_normal(len(t))) * INHG
        density = ((101325 - vacuum) / 288).tolist()
        return history({"gas_density": density[:-1]}, {"gas_density": density[-1:]}, step=DAY / 8)

    def test_half_an_inch_a_week_is_found_and_an_even_vacuum_is_not(self) -> None:
        finding = found("slow_leak", self.rows(0.5))
        assert severity(finding) == WARNING and finding is not None
        assert "inHg a week" in finding.text
        assert [seed for seed in range(40) if found("slow_leak", self.rows(0.0, seed=seed))] == []

    def test_a_fifth_of_an_inch_a_week_is_none(self) -> None:
        """However sure it is: over twelve days its standard error is 0.015."""
        assert found("slow_leak", self.rows(0.3, days=12.0)) is not None
        assert found("slow_leak", self.rows(0.2, days=12.0)) is None

    def test_at_the_surface_alone(self) -> None:
        h = self.rows(1.0)
        surface = History(({"gas_density_surface": h.get("gas_density")},), {})
        fresh = series([float(h.get("gas_density").v[-1])], T0 + 6 * DAY)
        assert found("slow_leak", History(surface.before, {"gas_density_surface": fresh})) is not None

    def test_slope_and_its_error_of_known_lines(self) -> None:
        t = np.arange(0, 4 * DAY, 3 * HOUR)
        slopes, errors = [], []
        for seed in range(200):
            noise = np.random.default_rng(seed).standard_normal(len(t))
            slope, sigma, surely = trend(t, 1000 - 2e-3 * t + 200 * noise)
            slopes.append(slope)
            errors.append(sigma)
            assert surely > 3.4
        assert np.mean(slopes) == pytest.approx(-2e-3, abs=2 * np.std(slopes) / 14)
        assert np.std(slopes) <= np.mean(errors) <= 1.5 * np.std(slopes)


class TestBatteryEnd:
    def charge(self, days: float, per_day: float, start: float = 1.0, seed: int = 0) -> list[float]:
        rng = np.random.default_rng(seed)
        use = per_day / 8 * (1 + 0.2 * rng.standard_normal(int(days * 8)))
        return (start - np.cumsum(use)).tolist()

    def of(
        self, values: list[float], name: str = "battery_charge", **changed: float | None
    ) -> Finding | None:
        h = history({name: values[:-1]}, {name: values[-1:]}, step=DAY / 8)
        return found("battery_end", h, **changed)

    def test_days_left_and_their_interval(self) -> None:
        limits, inside, n = USUAL["battery_end"], 0, 200
        for seed in range(n):  # the true end is that of the same use, drawn anew
            before = self.charge(8, 0.04, seed=seed)
            later = self.charge(40, 0.04, before[-1], seed=seed + 1000)
            h = history({"battery_charge": before[:-1]}, {"battery_charge": before[-1:]}, step=DAY / 8)
            end = battery_end(h, limits)
            assert end is not None
            truth = float(np.interp(-0.1, -np.array(later), DAY / 8 * (1 + np.arange(len(later)))))
            inside += end.earliest <= truth <= end.latest
            assert end.left == pytest.approx(truth, rel=0.15)
        assert 0.90 * n <= inside <= n

    def test_severity_by_days_and_by_recovery(self) -> None:
        values = self.charge(6, 0.04)  # 76 % are left: 16 days to 10 %
        assert self.of(values) is None
        assert severity(self.of(values, warning_days=20 * DAY)) == WARNING
        assert severity(self.of(values, critical_days=20 * DAY)) == CRITICAL
        now = T0 + 6 * DAY
        assert self.of(values, recovery=now + 10 * DAY, warning_days=20 * DAY) is None
        finding = self.of(values, recovery=now + 20 * DAY)
        assert severity(finding) == CRITICAL and finding is not None
        assert "planned recovery" in finding.text

    def test_coulombs_with_a_reset(self) -> None:
        used = series([100.0, 110.0, 120.0, 5.0, 15.0])
        assert without_resets(used).v.tolist() == [100.0, 110.0, 120.0, 125.0, 135.0]
        amount = np.linspace(0, 300 * 3600, 49)
        assert self.of(amount.tolist(), "charge_used", capacity=500 * 3600.0) is not None  # 3 days
        assert self.of(amount.tolist(), "charge_used") is None

    def test_volts_tell_the_end_of_alkaline_cells_alone(self) -> None:
        """From 15 V by 0.2 V a day, eight days: 12 days are left to 11 V."""
        rng = np.random.default_rng(3)
        volts = 15.0 - 0.2 * np.arange(64) / 8 + 0.03 * rng.standard_normal(64)
        h = history(
            {"battery_voltage": volts[:-1].tolist()}, {"battery_voltage": volts[-1:].tolist()}, DAY / 8
        )
        for chemistry in ("alkaline", "lithium", "rechargeable", None):
            limits = limits_of(Health(), None, chemistry)["battery_end"]
            end = battery_end(h, limits)
            assert (end is not None) is (chemistry == "alkaline")
            if end is not None:
                assert end.earliest < 12.1 * DAY < end.latest
                assert end.left == pytest.approx(12.1 * DAY, rel=0.1)
        given = Health.model_validate({"battery_end": {"volts": 13.0}})
        assert limits_of(given, None, "alkaline")["battery_end"]["volts"] == 13.0

    def test_day_with_thruster_is_no_month(self) -> None:
        use = np.array([0.02] * 56 + [0.16] * 8) / 8  # the last day with the thruster
        charge, with_it = (1 - np.cumsum(use)).tolist(), [0.0] * 56 + [1.0] * 8
        names = ("battery_charge", "thruster_use")
        before = dict(zip(names, (charge[:-1], with_it[:-1]), strict=True))
        fresh = dict(zip(names, (charge[-1:], with_it[-1:]), strict=True))
        end = battery_end(history(before, fresh, step=DAY / 8), USUAL["battery_end"])
        assert end is not None and end.idle is not None
        left = charge[-1] - 0.1
        assert end.idle == pytest.approx(left / 0.02 * DAY, rel=0.1)
        assert left / 0.16 * DAY * 2 < end.left < end.idle

    def test_gauge_that_jumps_is_no_use(self) -> None:
        values = self.charge(6, 0.02)
        jumped = [v - (0.5 if k > 44 else 0.0) for k, v in enumerate(values)]
        finding = self.of(jumped, warning_days=30 * DAY)
        assert finding is not None and "days" in finding.text
        days = float(finding.text.split(" in ")[1].split()[0])
        assert days == pytest.approx((jumped[-1] - 0.1) / 0.02, rel=0.15)


class TestReadings:
    def segment(self, **quantities: Series) -> Segment:
        return Segment(SegmentId(T0, "a", "a-1"), "m", "sbd", T0 + HOUR, (1, 1, ""), quantities)

    def test_many_readings_are_thinned_and_a_single_wild_one_goes(self) -> None:
        v = np.full(2000, 2.49)
        v[1000] = 1.0
        v[500:900] = 2.42
        thin = of_segment(self.segment(leak_voltage=series(v.tolist(), step=4.0)))["leak_voltage"]
        assert len(thin) <= 40 and thin.v.min() == 2.42 and thin.v[-1] == 2.49

    def test_lowest_altitude_of_each_turn(self) -> None:
        """Sampled once a minute: 3.3 m up is noise, 7 m are another turn; nothing for 7 min is one turn, and
        nothing for 11 min are two."""
        first = [30.0, 14.0, 6.0, 13.0, 6.5, 20.0, 30.0, 14.0, 7.0, 10.5, 7.2, 25.0, 14.0, 8.0]
        parts = [(0.0, first), (13 * 60 + 420.0, [12.0, 30.0, 9.5]), (15 * 60 + 420 + 660.0, [5.0, 12.0])]
        runs = [series(v, T0 + start, 60.0) for start, v in parts]
        t, v = (np.concatenate([getattr(run, name) for run in runs]) for name in "tv")
        turns = of_segment(self.segment(altitude=Series(readonly(t), readonly(v))))["altitude"]
        assert turns.v.tolist() == [6.0, 6.5, 7.0, 8.0, 9.5, 5.0]

    def test_readings_of_a_call(self) -> None:
        call = Call(
            "a",
            "a.log",
            T0,
            T0 + 100,
            fix=Fix(T0 - 2000, 1.0, 2.0),
            readings=(CallReading("vacuum", T0 - 5, 8 * INHG), CallReading("vacuum", T0 - 60, 9 * INHG)),
            announced=("1.sbd",),
        )
        readings = of_call(call)
        assert readings["vacuum"].v.tolist() == [9 * INHG, 8 * INHG]
        assert readings["fix_age"].v.tolist() == [2100.0]
        assert readings["call_cut"].v.tolist() == [1.0]

    def test_another_deployment_begins_anew(self) -> None:
        rows = [(T0 + k * DAY, {"vacuum": series([float(k)])}) for k in (0, 1, 2, 9, 10)]
        assert [r["vacuum"].v[0] for r in recent(rows)] == [9.0]


def test_rules_have_names_of_their_own_and_nothing_is_found_in_nothing() -> None:
    assert len({rule.name for rule in RULES}) == len(RULES)
    assert judge(History((), {}), USUAL) == {}
    assert judge(history({}, {"vacuum": [0.0, 0.0]}), {}) == {}
