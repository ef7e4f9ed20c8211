import pytest

import dinkum
from gliderwatch.slocum.cycles import intact, parse_sensor_list

SENSORS, LENGTH = parse_sensor_list(dinkum.sensor_list(), 0, len(dinkum.SENSORS) + 1)


def test_a_sensor_list():
    assert SENSORS.names == tuple(name for name, _, _ in dinkum.SENSORS)
    assert SENSORS.sizes == tuple(size for _, size, _ in dinkum.SENSORS)
    assert len(dinkum.sensor_list()) == LENGTH


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[:-1],
        lambda text: text[: len(text) // 2],
        lambda text: text.replace(b"    1    1", b"    1    2"),
        lambda text: text.replace(b" 8 m_lat", b" 3 m_lat"),
        lambda text: text.replace(b"s: T    4", b"s: T    5"),
        lambda text: text.replace(b"m_lat", b"m\xfflat"),
        lambda text: b"",
    ],
)
def test_a_damaged_sensor_list_is_refused(damage):
    with pytest.raises(ValueError, match="line"):
        parse_sensor_list(damage(dinkum.sensor_list()), 0, len(dinkum.SENSORS) + 1)


@pytest.mark.parametrize("order", ["<", ">"])
def test_whole_data_are_intact(order):
    data = dinkum.cycles(dinkum.rows(40), order=order)
    assert intact(data, 0, SENSORS) == (40, len(data) - 1, 0)
    assert intact(data[:-1], 0, SENSORS) == (40, len(data) - 1, 0)
    assert intact(b"header" + data, 6, SENSORS) == (40, len(data) + 5, 0)


def test_padding_after_the_end_is_not_data():
    data = dinkum.cycles(dinkum.rows(40))
    assert intact(data + b"\x1a" * 500, 0, SENSORS) == (40, len(data) - 1, 0)


def test_a_cut_keeps_the_cycles_before_it_and_is_not_damage():
    data = dinkum.cycles(dinkum.rows(40))
    ends = [end for end in range(len(data)) if intact(data[:end], 0, SENSORS)[1] == end]
    counts = [intact(data[:end], 0, SENSORS)[0] for end in range(len(data))]
    assert counts == sorted(counts)
    assert all(intact(data[:end], 0, SENSORS)[2] == 0 for end in range(len(data)))
    assert counts[ends[20] + 1] == counts[ends[20]] == 19  # ends[0] is before any byte is there


def test_damage_keeps_the_cycles_before_it_and_counts_the_bytes_lost():
    data = bytearray(dinkum.cycles(dinkum.rows(40)))
    _, tenth, _ = intact(dinkum.cycles(dinkum.rows(40))[:-1], 0, SENSORS)
    ends = [intact(bytes(data[:end]), 0, SENSORS)[1] for end in range(len(data))]
    tenth = sorted(set(ends))[10]
    data[tenth] = 0
    n, end, lost = intact(bytes(data), 0, SENSORS)
    assert n < 10
    assert end < tenth
    assert lost == len(data) - end


def test_values_that_do_not_begin_where_they_must():
    with pytest.raises(ValueError, match="do not begin"):
        intact(b"xx" + dinkum.cycles(dinkum.rows(5)), 0, SENSORS)


def test_no_values_at_all():
    assert intact(b"", 0, SENSORS) == (0, 0, 0)
