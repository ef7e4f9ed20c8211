import math
from datetime import UTC, datetime

import numpy as np
import pytest

from gliderwatch.model import SegmentId
from gliderwatch.slocum.header import Header
from gliderwatch.slocum.sensors import QUANTITIES, SENSORS, build_segment, depth_of, model_declination

T0 = datetime(2022, 11, 7, tzinfo=UTC).timestamp()
HEADER = Header(
    SegmentId(T0, "electa", "electa-2022-310-0-1"), "350_nu.mi", "sbd", "0f682cb2", True, 2709, 104, 600
)


def build(**sensors):
    samples = {name: (np.array(t, float), np.array(v, float)) for name, (t, v) in sensors.items()}
    return build_segment(HEADER, samples, (0, 3, "ab"))


def times(n):
    return [T0 + 60.0 * i for i in range(n)]


@pytest.mark.parametrize(
    ("sensor", "raw", "name", "value"),
    [
        ("m_heading", 1.5, "heading", 1.5),
        ("c_heading", 1.5, "heading_commanded", 1.5),
        ("m_speed", 0.25, "speed_onboard", 0.25),
        ("m_vacuum", 10.0, "vacuum", 33863.89),
        ("m_ballast_pumped", -200.0, "ballast", -2e-4),
        ("m_de_oil_vol", 250.0, "oil_volume", 2.5e-4),
        ("m_battpos", -1.0, "battery_position", -0.0254),
        ("m_coulomb_amphr_total", 2.0, "charge_used", 7200.0),
        ("m_lithium_battery_relative_charge", 80.0, "battery_charge", 0.8),
        ("c_thruster_on", 40.0, "thruster_on", 0.4),
        ("m_depth_rate", -0.1, "depth_rate", -0.1),
        ("x_dr_state", 3.0, "dr_state", 3.0),
    ],
)
def test_units_become_si(sensor, raw, name, value):
    series = build(**{sensor: ([T0], [raw])}).get(name)
    assert series.t.tolist() == [T0]
    assert series.v.tolist() == pytest.approx([value])


def test_pressure_stands_in_for_a_depth_that_is_missing():
    """UNESCO (1983), technical papers in marine science 44, p. 28: 9712.653 m at 10000 dbar, 30 degrees."""
    bar = [0.0, 1.0, 100.0, 196.0]
    depth = build(m_pressure=(times(4), bar)).get("depth")
    assert depth.t.tolist() == times(4)
    assert depth.v.tolist() == pytest.approx([0.0, 9.92, 991.3, 1935.0], rel=3e-3)
    assert depth_of(np.array([1000.0])) == pytest.approx([9712.653], rel=3e-3)
    empty = build(m_pressure=(times(4), bar), m_depth=([], []))
    assert empty.get("depth").v.tolist() == depth.v.tolist()


def test_pressure_does_not_stand_in_for_a_depth_that_is_there():
    depth = build(m_pressure=(times(3), [1.0, 2.0, 3.0]), m_depth=([T0], [7.0])).get("depth")
    assert depth.v.tolist() == [7.0]


def test_positions_become_degrees():
    segment = build(m_gps_lat=([T0], [-3823.4376]), m_gps_lon=([T0], [17959.94]))
    assert segment.get("fix_lat").v.tolist() == pytest.approx([-(38 + 23.4376 / 60)])
    assert segment.get("fix_lon").v.tolist() == pytest.approx([179 + 59.94 / 60])


@pytest.mark.parametrize(
    ("sensors", "name"),
    [("m_gps_lat m_gps_lon", "fix"), ("m_lat m_lon", "dr"), ("c_wpt_lat c_wpt_lon", "waypoint")],
)
@pytest.mark.parametrize(
    ("raw", "lon"), [(18001.4865, -179.975225), (-18001.4865, 179.975225), (35959.4, -0.01), (36000.0, 0.0)]
)
def test_a_longitude_beyond_the_antimeridian_comes_back(sensors, name, raw, lon):
    lat_name, lon_name = sensors.split()
    segment = build(**{lat_name: (times(3), [-1722.0] * 3), lon_name: (times(3), [17958.0, raw, raw])})
    assert segment.get(f"{name}_lon").v.tolist() == pytest.approx([179 + 58 / 60, lon, lon])
    assert segment.notes == (f"2 values of {name}_lon beyond 180 degrees brought back to -180 to 180",)
    assert not segment.dropped


def test_no_fix_is_no_value_and_not_an_error():
    segment = build(
        m_gps_lat=(times(4), [3823.0, 69696969.0, 0.0, 3824.0]),
        m_gps_lon=(times(4), [-6319.0, 69696969.0, 0.0, -6320.0]),
    )
    assert segment.get("fix_lat").t.tolist() == [times(4)[0], times(4)[3]]
    assert segment.dropped == {}


def test_a_bad_latitude_takes_its_longitude_with_it():
    segment = build(m_lat=(times(3), [3823.0, 9923.0, 3824.0]), m_lon=(times(3), [-6319.0, -6319.5, -6320.0]))
    assert segment.get("dr_lat").t.tolist() == segment.get("dr_lon").t.tolist() == [T0, T0 + 120]
    assert segment.dropped == {"dr_lat": 1, "dr_lon": 1}


def test_sixty_minutes_are_not_a_position():
    segment = build(m_lat=([T0], [3860.0]), m_lon=([T0], [-6319.0]))
    assert "dr_lat" not in segment.quantities
    assert segment.dropped == {"dr_lat": 1, "dr_lon": 1}


def test_a_latitude_on_the_equator_is_a_position():
    assert len(build(m_lat=([T0], [0.0]), m_lon=([T0], [-6319.0])).get("dr_lat")) == 1


def test_positions_are_matched_by_time():
    segment = build(
        m_gps_lat=(times(3), [3823.0, 3824.0, 3825.0]), m_gps_lon=(times(3)[1:], [-6319.0, -6320.0])
    )
    assert segment.get("fix_lat").t.tolist() == segment.get("fix_lon").t.tolist() == times(3)[1:]
    assert segment.dropped == {"fix_lat": 1}


def test_a_position_with_one_coordinate_is_none():
    assert "fix_lat" not in build(m_gps_lat=([T0], [3823.0])).quantities


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, -0.001, 6.2832, 1e30])
def test_values_out_of_range_are_dropped_and_counted(bad):
    segment = build(m_heading=(times(3), [0.0, bad, 6.28]))
    assert segment.get("heading").v.tolist() == [0.0, 6.28]
    assert segment.dropped == {"heading": 1}


@pytest.mark.parametrize(
    "bad", [math.nan, math.inf, 0.0, 1e9, T0 - 7201, T0 + 60 * 86400 + 1, -1e300, 1e300, T0]
)
def test_absurd_or_repeated_times_are_dropped_and_counted(bad):
    segment = build(m_pitch=([T0, bad, T0 + 60], [0.1, 0.2, 0.3]))
    assert segment.get("pitch").v.tolist() == [0.1, 0.3]
    assert segment.dropped == {"pitch": 1}


def test_samples_are_put_in_order_of_time():
    segment = build(m_pitch=([T0 + 60, T0 + 10, T0 + 30], [0.3, 0.1, 0.2]))
    assert segment.get("pitch").t.tolist() == [T0 + 10, T0 + 30, T0 + 60]
    assert segment.get("pitch").v.tolist() == [0.1, 0.2, 0.3]


def test_arrays_are_read_only():
    series = build(m_pitch=([T0], [0.3])).get("pitch")
    for array in (series.t, series.v):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_average_speed_before_speed():
    both = {"m_avg_speed": ([T0], [0.25]), "m_speed": ([T0], [0.5])}
    assert build(**both).get("speed_onboard").v.tolist() == [0.25]
    assert build(**(both | {"m_avg_speed": ([], [])})).get("speed_onboard").v.tolist() == [0.5]


def test_no_echo_is_no_value():
    segment = build(m_altitude=(times(2), [0.0, 30.0]), m_water_depth=(times(2), [-1.0, 60.0]))
    assert segment.get("altitude").v.tolist() == [30.0]
    assert segment.get("water_depth").v.tolist() == [60.0]
    assert segment.dropped == {}


def test_the_last_time_is_that_of_the_last_cycle():
    segment = build(m_present_time=(times(5), times(5)), m_pitch=([T0], [0.1]))
    assert segment.last_t == times(5)[-1]
    assert build(m_pitch=([T0 + 7], [0.1])).last_t == T0 + 7
    assert build().last_t == T0


def test_identity_comes_from_the_header():
    segment = build()
    assert (segment.id, segment.mission, segment.kind) == (HEADER.id, "350_nu.mi", "sbd")
    assert segment.completeness == (0, 3, "ab")
    assert segment.quantities == {}


def test_the_variation_that_the_glider_reports_is_west_positive():
    segment = build(m_gps_mag_var=(times(4), [0.0, 0.2845, 0.2827, 0.2845]))
    assert segment.declination == pytest.approx(-0.2845)
    assert segment.declination_source == "glider"


def test_without_it_the_model_at_the_first_fix():
    segment = build(
        m_gps_mag_var=([T0], [0.0]),
        m_gps_lat=([T0 + 60], [3823.0]),
        m_gps_lon=([T0 + 60], [-6240.0]),
        m_lat=([T0], [-3823.0]),
        m_lon=([T0], [6240.0]),
    )
    assert math.degrees(segment.declination) == pytest.approx(-15.5, abs=0.1)
    assert segment.declination_source == "WMM2020"


def test_else_at_the_first_dead_reckoned_position_else_unknown():
    segment = build(m_lat=([T0], [3823.0]), m_lon=([T0], [-6240.0]))
    assert math.degrees(segment.declination) == pytest.approx(-15.5, abs=0.1)
    segment = build(m_heading=([T0], [1.0]))
    assert (segment.declination, segment.declination_source) == (None, "")


@pytest.mark.parametrize(
    ("year", "lat", "lon", "degrees", "name"),
    [
        # Test values published with each model, at sea level.
        (2010, 80, 0, -6.13, "WMM2010"),
        (2020, 80, 0, -1.28, "WMM2020"),
        (2020, 0, 120, 0.16, "WMM2020"),
        (2020, -80, 240, 69.36, "WMM2020"),
        (2025, 80, 0, 1.28, "WMM2025"),
    ],
)
def test_the_model_of_the_epoch(year, lat, lon, degrees, name):
    declination, source = model_declination(lat, lon, datetime(year, 1, 1, tzinfo=UTC).timestamp())
    assert math.degrees(declination) == pytest.approx(degrees, abs=0.011)
    assert source == name


@pytest.mark.parametrize(("year", "name"), [(2014, "WMM2010"), (2015, "WMM2015v2"), (2024, "WMM2020")])
def test_each_model_holds_for_five_years(year, name):
    assert model_declination(28.4, -80.3, datetime(year, 12, 31, tzinfo=UTC).timestamp())[1] == name


@pytest.mark.parametrize(("year", "name"), [(2005, "WMM2010 extrapolated"), (2031, "WMM2025 extrapolated")])
def test_beyond_the_models_the_nearest_is_extrapolated_and_says_so(year, name):
    declination, source = model_declination(28.4, -80.3, datetime(year, 6, 1, tzinfo=UTC).timestamp())
    assert -8.0 < math.degrees(declination) < -5.0
    assert source == name


def test_every_row_of_the_table_is_complete():
    assert len({row.name for row in QUANTITIES}) == len(QUANTITIES)
    assert len(set(SENSORS)) == len(SENSORS)
    for row in QUANTITIES:
        assert row.unit
        assert row.about
        assert row.low < row.high
