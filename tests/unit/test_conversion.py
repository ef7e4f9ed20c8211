"""State of an earlier layout is converted, and no layout changes without a converter."""

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest

from gliderwatch.errors import LayoutError, StateError
from gliderwatch.estimation import healthy_baseline
from gliderwatch.incidents.acknowledgement import Ack
from gliderwatch.incidents.notifications import NotificationState
from gliderwatch.layers.advice import Layered
from gliderwatch.model import Alert, Assessment, Incident, Kind, NextSurfacing, Segment
from gliderwatch.params import GliderParams
from gliderwatch.pipeline import GliderState, process
from gliderwatch.store import codec, conversion, database
from gliderwatch.store.conversion import converted, moved, version
from gliderwatch.store.state_file import Store
from missions import Leg, mission

LAYOUTS = Path(__file__).parents[1] / "golden" / "layouts"
RECORDS = {GliderState: "checkpoint", Segment: "segment"}
ROWS = {
    Assessment: "assessments",
    Incident: "incidents",
    NextSurfacing: "expected",
    NotificationState: "said",
    Ack: "acks",
    Alert: "alerts",
    Layered: "layers",
}


# ------------------------------------------------------------------- layouts


def layout(kind: type) -> str:
    """The shape of a value's JSON, a line for each field with its path: what a converter has to know of.

    Names of classes are not in it, for they are not in the JSON. ``?`` marks what may be left out.
    """
    return "".join(f"{line}\n" for line in _lines("", msgspec.inspect.type_info(kind)))


def _lines(path: str, of: msgspec.inspect.Type) -> Iterator[str]:
    inspect = msgspec.inspect
    match of:
        case inspect.DataclassType(fields=fields) | inspect.StructType(fields=fields):
            yield f"{path or '.'}: object"
            for field in fields:
                optional = "" if field.required else "?"
                yield from _lines(f"{path}.{field.encode_name}{optional}", field.type)
        case inspect.UnionType(types=types):
            for one in sorted(types, key=lambda t: type(t).__name__):
                yield from _lines(path, one)
        case inspect.VarTupleType(item_type=item) | inspect.ListType(item_type=item):
            yield from _lines(f"{path}[]", item)
        case inspect.TupleType(item_types=items):
            for n, item in enumerate(items):
                yield from _lines(f"{path}[{n}]", item)
        case inspect.DictType(value_type=value):
            yield from _lines(f"{path}{{}}", value)
        case inspect.EnumType(cls=cls):
            yield f"{path}: one of {', '.join(repr(member.value) for member in cls)}"
        case inspect.CustomType(cls=cls):
            yield f"{path}: {cls.__name__}"
        case _:
            yield f"{path}: {type(of).__name__.removesuffix('Type').lower()}"


@pytest.mark.parametrize("kind", RECORDS, ids=RECORDS.get)
def test_the_layout_of_a_record_is_that_of_its_version(kind):
    """Fails for whoever changes a field of the state without a converter.

    Leave the files of earlier layouts alone. Add a converter to `conversion.CONVERTERS`, then run
    `python tests/golden/write_layouts.py`: it writes the file of the new layout.
    """
    file = LAYOUTS / f"{RECORDS[kind]}-{version(kind)}.txt"
    assert file.exists(), f"{file.name} is missing: run python tests/golden/write_layouts.py"
    assert layout(kind) == file.read_text(), "the layout changed: add a converter (CONTRIBUTING.md)"


@pytest.mark.parametrize("kind", ROWS, ids=ROWS.get)
def test_the_layout_of_a_row_is_as_it_was_kept(kind):
    """Fails for whoever changes a field of a row: a migration has to convert the rows there are.

    Add the migration, with a function of `conversion.ROW_CONVERTERS` where a field goes or is renamed, then
    run `python tests/golden/write_layouts.py`.
    """
    assert layout(kind) == (LAYOUTS / f"{ROWS[kind]}.txt").read_text(), "the layout changed: migrate its rows"


@dataclass
class Inner:
    x: float
    notes: tuple[str, ...] = ()


@dataclass
class Outer:
    a: Inner | None
    b: Mapping[str, Inner]
    c: tuple[float, Kind]


def test_a_layout_names_every_field_however_deep():
    kinds = ", ".join(repr(str(kind)) for kind in Kind)
    assert layout(Outer).splitlines() == [
        ".: object",
        ".a: object",
        ".a.x: float",
        ".a.notes?[]: str",
        ".a: none",
        ".b{}: object",
        ".b{}.x: float",
        ".b{}.notes?[]: str",
        ".c[0]: float",
        f".c[1]: one of {kinds}",
    ]
    assert len(layout(GliderState).splitlines()) > 1000


# ---------------------------------------------------------------- conversion


def renamed(state):
    moved(state, "settled", "before_last")
    return state


def flattened(state):
    moved(state, "memory.estimate", "estimate")
    return state


def test_columns_of_the_healthy_dives_are_those_that_are_kept():
    """No type shows how wide the array is: with another column no kept state could be continued.

    A new number needs a converter too (CONTRIBUTING.md, "a change of the state"), and then a line here.
    """
    assert list(healthy_baseline._COLUMN) == [
        *("roll_mean", "pitch_dive", "pitch_climb", "pitch_asymmetry", "depth_rate_dive", "depth_rate_climb"),
        *("rate_ratio", "ballast_dive", "ballast_climb", "yos_per_hour", "duration_h", "vacuum"),
        *("depth_max", "thruster"),
    ]


def test_records_of_each_layout_go_through_all_converters_since(monkeypatch):
    monkeypatch.setattr(conversion, "CONVERTERS", {GliderState: (renamed, flattened)})
    assert version(GliderState) == 3 and version(Segment) == 1
    old = {"settled": 1, "memory": {"estimate": 2, "watches": 3}}
    today = {"before_last": 1, "estimate": 2, "memory": {"watches": 3}}
    assert converted(json.loads(json.dumps(old)), GliderState, 1) == today
    half = {"before_last": 1, "memory": {"estimate": 2, "watches": 3}}
    assert converted(half, GliderState, 2) == today
    assert converted(today, GliderState, 3) is today


def test_a_move_makes_the_way_to_its_target_and_needs_its_source():
    state = {"a": {"b": 1, "c": 2}}
    moved(state, "a.b", "x.y.z")
    assert state == {"a": {"c": 2}, "x": {"y": {"z": 1}}}
    with pytest.raises(KeyError):
        moved(state, "a.b", "q")


def old_record(state: GliderState) -> bytes:
    """A record of layout 1 in which `last` had another name."""
    data = json.loads(zlib.decompress(codec.encode(state)))["data"]
    data["latest"] = data.pop("last")
    return zlib.compress(json.dumps({"v": 1, "data": data}).encode())


def latest(state):
    moved(state, "latest", "last")
    return state


def test_a_record_of_an_earlier_layout_is_read_as_todays(monkeypatch):
    monkeypatch.setattr(conversion, "CONVERTERS", {GliderState: (latest,)})
    state = GliderState()
    for segment in mission([Leg(heading=0.5 * k) for k in range(3)]):
        state = process(state, segment, GliderParams()).state
    assert state.last is not None
    today = codec.encode(codec.decode(old_record(state), GliderState))
    assert today == codec.encode(state), "to the last bit"
    assert json.loads(zlib.decompress(today))["v"] == 2


def test_a_record_that_its_converter_cannot_take_is_no_damage(monkeypatch):
    monkeypatch.setattr(conversion, "CONVERTERS", {GliderState: (latest,)})
    for data in ({}, [], 3, None):
        with pytest.raises(LayoutError):
            codec.decode(zlib.compress(json.dumps({"v": 1, "data": data}).encode()), GliderState)


def test_a_migration_converts_the_text_of_rows(tmp_path, monkeypatch):
    path = tmp_path / "state.sqlite"
    Store.open(path).close()
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO said VALUES ('unit', ?)", ('{"threads": [], "seen": 5.5}',))

    def surfaced(said):
        moved(said, "seen", "surfaced")
        return said

    monkeypatch.setattr(conversion, "ROW_CONVERTERS", {"said_of_old": surfaced})
    monkeypatch.setattr(database, "SCHEMA", database.SCHEMA + 1)
    monkeypatch.setattr(
        database, "MIGRATIONS", {database.SCHEMA: "UPDATE said SET data = said_of_old(data);"}
    )
    assert Store.open(path).notified("unit") == NotificationState(surfaced=5.5)


def test_a_migration_whose_converter_fails_changes_nothing(tmp_path, monkeypatch):
    path = tmp_path / "state.sqlite"
    Store.open(path).close()
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO said VALUES ('unit', '{}')")

    def failing(said):
        raise KeyError("seen")

    monkeypatch.setattr(conversion, "ROW_CONVERTERS", {"said_of_old": failing})
    monkeypatch.setattr(database, "SCHEMA", database.SCHEMA + 1)
    monkeypatch.setattr(
        database,
        "MIGRATIONS",
        {database.SCHEMA: "DELETE FROM files; UPDATE said SET data = said_of_old(data);"},
    )
    with pytest.raises(StateError, match="cannot be used"):
        Store.open(path)
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (database.SCHEMA - 1,)
        assert db.execute("SELECT data FROM said").fetchall() == [("{}",)]
