"""What import contracts can not show: the core calls no clock, no file, no chance and has no globals."""

import ast
import configparser
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# What a call looks like up to its opening bracket.
IMPURE_CALL = re.compile(
    r"(open|print|input|eval|exec|breakpoint|globals|__import__)"
    r"|.*\.(now|utcnow|today|fromfile|genfromtxt|loadtxt|memmap|savetxt|tofile)"
    r"|(np|numpy)\.(load|save|savez)"
    r"|(.*\.)?random\..*"
)
# Conversions of time that use the machine's own zone unless told one, and the arguments it takes to tell.
LOCAL_TIME = {"astimezone": 1, "fromtimestamp": 2}


def pure_files() -> list[Path]:
    """The files of the modules that the import contracts call pure."""
    contracts = configparser.ConfigParser()
    contracts.read(ROOT / ".importlinter")
    files: list[Path] = []
    for module in contracts["importlinter:contract:pure"]["source_modules"].split():
        path = ROOT / "src" / Path(*module.split("."))
        files += sorted(path.rglob("*.py")) or [path.with_suffix(".py")]
    return files


def impurities(source: str) -> list[str]:
    """What in a module's text is not a function of its arguments, each with its line."""
    nodes = list(ast.walk(ast.parse(source)))
    found = [(node.lineno, ast.unparse(node)) for node in nodes if isinstance(node, ast.Global)]
    found += [
        (node.lineno, ast.unparse(node)) for node in nodes if isinstance(node, ast.Call) and _impure(node)
    ]
    return [f"line {line}: {text}" for line, text in sorted(found)]


def _impure(call: ast.Call) -> bool:
    text = ast.unparse(call.func)
    needed = LOCAL_TIME.get(text.rpartition(".")[2], 0)
    return bool(IMPURE_CALL.fullmatch(text)) or len(call.args) + len(call.keywords) < needed


@pytest.mark.parametrize("path", pure_files(), ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_core_is_a_function_of_its_arguments(path: Path) -> None:
    assert impurities(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "source",
    [
        "datetime.now(UTC)",
        "datetime.date.today()",
        "datetime.fromtimestamp(t)",
        "t.astimezone()",
        "open('x')",
        "print(1)",
        "np.random.default_rng(0)",
        "random.random()",
        "np.load('x')",
        "a.tofile('x')",
        "def f():\n    global x",
    ],
)
def test_impurity_is_seen(source: str) -> None:
    assert len(impurities(source)) == 1


@pytest.mark.parametrize(
    "source",
    [
        "datetime.fromtimestamp(t, UTC)",
        "datetime.fromtimestamp(t, tz=UTC)",
        "t.astimezone(UTC)",
        "incident.open(now)",
    ],
)
def test_pure_text_is_left_alone(source: str) -> None:
    assert impurities(source) == []


# ----------------------------------------------------------------------- SQL

SQL = re.compile(
    r"\s*(SELECT|INSERT (OR \w+ )?INTO|UPDATE \w+ SET|DELETE FROM|PRAGMA|CREATE|ALTER TABLE|BEGIN|COMMIT)\b"
)


def statements(source: str) -> list[str]:
    """The SQL in a module's text: strings that begin as a statement does."""
    nodes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant)]
    return [f"line {n.lineno}: {n.value}" for n in nodes if isinstance(n.value, str) and SQL.match(n.value)]


def test_sql_is_in_the_store_alone() -> None:
    root = ROOT / "src" / "gliderwatch"
    found = {
        str(path.relative_to(root)): lines
        for path in sorted(root.rglob("*.py"))
        if "store" not in path.relative_to(root).parts and (lines := statements(path.read_text("utf-8")))
    }
    assert found == {}


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("db.execute('SELECT 1')", 1),
        ("f'SELECT {x} FROM y'", 1),
        ("'INSERT OR IGNORE INTO a VALUES (1)'", 1),
        ("'PRAGMA user_version'", 1),
        ("'Select a file'", 0),
        ("'updated'", 0),
    ],
)
def test_sql_is_seen(source: str, count: int) -> None:
    assert len(statements(source)) == count


@pytest.mark.parametrize(
    "page", sorted((ROOT / "src" / "gliderwatch").glob("*/constants.py")), ids=lambda page: page.parent.name
)
def test_each_heuristic_has_one_value(page: Path) -> None:
    """A name that stands twice on its page silently has the later one."""
    names = re.findall(r"^([A-Z][A-Z0-9_]*)(?:: .*)? = ", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(names) > 3
    assert sorted(names) == sorted(set(names))
