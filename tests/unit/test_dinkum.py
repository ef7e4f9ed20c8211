"""Bytes of Dinkum files, against bytes written out by hand."""

import struct

import lz4.block
import numpy as np
import pytest

from gliderwatch.simulate.dinkum import BLOCK, Generation, Header, Sensor, SensorList, compress, encode

HEADER = Header("01230004", "sim-2022-313-0-4", "sbd", "watch.mi", 1667897642.9)
SENSORS = SensorList(
    (
        Sensor("c_heading", "rad", 4),
        Sensor("m_depth", "m", 4),
        Sensor("m_gps_status", "enum", 1),
        Sensor("m_lat", "lat", 8),
        Sensor("m_present_time", "timestamp", 8),
        Sensor("x_count", "nodim", 2),
    ),
    frozenset({"m_depth", "m_gps_status", "m_lat", "m_present_time", "x_count"}),
)
NAN = float("nan")
VALUES = np.array(
    [
        [1.5, 2, 4530.25, 1e9, 300],
        [1.5, NAN, 4530.25, 1e9, NAN],
        [NAN, -3, NAN, 1e9 + 4, -300],
        [2.5, NAN, 4531.25, 1e9 + 8, NAN],
        [1.5, NAN, NAN, 1e9 + 12, NAN],
    ]
)


def body(order: str) -> bytes:
    """The data cycles of VALUES by hand: state bits, most significant first, then new values."""

    def row(states: tuple[int, int], codes: str, *values: float) -> bytes:
        return b"d" + bytes(states) + struct.pack(order + codes, *values)

    return (
        row((0b10101010, 0b10000000), "fbddh", 1.5, 2, 4530.25, 1e9, 300)
        + row((0b01000110, 0b00000000), "d", 1e9)
        + row((0b00100010, 0b10000000), "bdh", -3, 1e9 + 4, -300)
        + row((0b10001010, 0b00000000), "fdd", 2.5, 4531.25, 1e9 + 8)
        + row((0b10000010, 0b00000000), "fd", 1.5, 1e9 + 12)
    )


def test_header_has_the_14_tags_in_order() -> None:
    text = encode(HEADER, SENSORS, VALUES, ~np.isnan(VALUES)).split(b"sa\x34\x12")[0].decode()
    assert text == (
        "dbd_label:    DBD(dinkum_binary_data)file\n"
        "encoding_ver:    5\n"
        "num_ascii_tags:    14\n"
        "all_sensors:    F\n"
        "the8x3_filename:    01230004\n"
        "full_filename:    sim-2022-313-0-4\n"
        "filename_extension:    sbd\n"
        "mission_name:    watch.mi\n"
        "fileopen_time:    Tue_Nov__8_08:54:02_2022\n"
        "total_num_sensors:    6\n"
        "sensors_per_cycle:    5\n"
        "state_bytes_per_cycle:    2\n"
        f"sensor_list_crc:    {SENSORS.crc}\n"
        "sensor_list_factored:    1\n"
    )


@pytest.mark.parametrize(
    ("generation", "order", "end"), [(Generation.G2, ">", b"X"), (Generation.G3, "<", b"")]
)
def test_cycles_of_both_generations(generation: Generation, order: str, end: bytes) -> None:
    data = encode(HEADER, SENSORS, VALUES, ~np.isnan(VALUES), generation=generation)
    known = b"sa" + struct.pack(f"{order}Hfd", 0x1234, 123.456, 123456789.12345)
    assert data.endswith(b"sensor_list_factored:    1\n" + known + body(order) + end)


def test_sensor_list_is_in_the_file_unless_factored() -> None:
    listed = (
        b"s: F    0   -1 4 c_heading rad\n"
        b"s: T    1    0 4 m_depth m\n"
        b"s: T    2    1 1 m_gps_status enum\n"
        b"s: T    3    2 8 m_lat lat\n"
        b"s: T    4    3 8 m_present_time timestamp\n"
        b"s: T    5    4 2 x_count nodim\n"
    )
    assert SENSORS.text() == listed
    data = encode(HEADER, SENSORS, VALUES, ~np.isnan(VALUES), factored=False)
    assert b"sensor_list_factored:    0\n" + listed + b"sa" in data
    assert listed not in encode(HEADER, SENSORS, VALUES, ~np.isnan(VALUES))


def test_crc_changes_with_what_is_sent() -> None:
    other = SensorList(SENSORS.sensors, SENSORS.sent - {"x_count"})
    assert other.crc != SENSORS.crc
    assert len(SENSORS.crc) == 8
    assert SENSORS.crc == SENSORS.crc.lower()


def test_an_updated_nan_is_written_and_is_the_same_as_itself() -> None:
    sensors = SensorList((Sensor("m_depth", "m", 4),), frozenset({"m_depth"}))
    data = encode(HEADER, sensors, np.array([[NAN], [NAN]]), np.ones((2, 1), bool))
    assert data.endswith(b"d\x80\x00\x00\xc0\x7fd\x40")


@pytest.mark.parametrize("value", [128.0, -129.0, NAN])
def test_a_value_that_does_not_fit_is_refused(value: float) -> None:
    values = VALUES.copy()
    values[0, 1] = value
    with pytest.raises(ValueError, match="m_gps_status"):
        encode(HEADER, SENSORS, values, np.ones(values.shape, bool))


def test_columns_must_agree_with_the_list() -> None:
    with pytest.raises(ValueError, match="need 5 columns"):
        encode(HEADER, SENSORS, VALUES[:, :4], np.ones((5, 4), bool))
    with pytest.raises(ValueError, match="need 5 columns"):
        encode(HEADER, SENSORS, VALUES, np.ones((4, 5), bool))


@pytest.mark.parametrize("size", [0, 1, BLOCK, BLOCK + 1, 3 * BLOCK - 7])
def test_compressed_blocks_give_the_data_back(size: int) -> None:
    data = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8).tobytes()
    packed, blocks, at = compress(data), [], 0
    while at < len(packed):
        length = int.from_bytes(packed[at : at + 2], "big")
        blocks.append(lz4.block.decompress(packed[at + 2 : at + 2 + length], BLOCK))
        at += 2 + length
    assert b"".join(blocks) == data
    assert all(len(block) == BLOCK for block in blocks[:-1])
