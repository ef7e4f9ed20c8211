import pytest

from gliderwatch.ingest import names


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("00920000.sbd", "sbd"),
        ("01330000.scd", "sbd"),
        ("usf-sam-2019-251-4-12.MBD", "mbd"),
        ("x.mcd", "mbd"),
        ("X.DBD", "dbd"),
        ("x.dCd", "dbd"),
        ("usf-sam-2019-251-4-12.tbd", None),
        ("x.ebd", None),
        ("x.sbd.part", None),
        ("sbd", None),
        (".sbd", None),
        (".usf-sam-2019-251-4-12.sbd", None),
        ("~x.sbd", None),
        ("x.sbd~", None),
        ("x.sbd.filepart", None),
        ("x.filepart.sbd", None),
        ("x.tmp.SBD", None),
        ("x.Part.scd", None),
        ("tmp-2019-251-4-12.sbd", "sbd"),
        ("template.sbd", "sbd"),
        ("x.mlg", None),
        ("", None),
    ],
)
def test_kind_of_flight_data_in_either_case(name, kind):
    assert names.kind(name) == kind


@pytest.mark.parametrize("name", ["8bc72b32.cac", "8BC72B32.CAC", "8bc72b32.ccc", "8bc72b32.Ccc"])
def test_cache_names(name):
    assert names.is_cache(name)
    assert not names.is_cache(name + "x")


@pytest.mark.parametrize("name", [".8bc72b32.cac", "8bc72b32.tmp.cac", "8bc72b32.cac~"])
def test_a_cache_file_under_way_is_none(name):
    assert not names.is_cache(name)


def test_fuller_kinds_rank_higher():
    assert names.rank("sbd") < names.rank("mbd") < names.rank("dbd")
    with pytest.raises(KeyError):
        names.rank("tbd")


@pytest.mark.parametrize(
    ("full_name", "glider"),
    [
        ("electa-2022-308-3-2", "electa"),
        ("usf-sam-2019-251-4-12", "usf-sam"),
        ("maria-997-2022-164-7-0", "maria-997"),
        ("Unit_1033-2025-25-0-10", "unit_1033"),
        ("a-2019-1-2-3-2020-4-5-6", "a-2019-1-2-3"),
        ("-2022-308-3-2", None),
        ("electa-2022-308-3", None),
        ("electa-22-308-3-2", None),
        ("electa-2022-308-3-2-x", None),
        ("00920000", None),
        ("electa-٢٠٢٢-308-3-2", None),
        ("electa-2022-308-3-2\n", None),
    ],
)
def test_the_glider_in_a_full_name(full_name, glider):
    assert names.glider_of(full_name) == glider


def test_a_long_name_is_told_from_an_8x3_name():
    assert names.is_long("usf-sam-2019-251-4-12.sbd")
    assert names.is_long("usf-sam-2019-251-4-12.SCD")
    assert not names.is_long("02000000.sbd")
    assert not names.is_long("usf-sam-2019-251-4-12.sbd.tmp.sbd")
