"""What the pages say can be done: links, commands, settings, queries. And the pictures are true."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
import shlex
import sqlite3
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from html import unescape
from pathlib import Path
from types import ModuleType

import click
import pytest
from ruamel.yaml import YAML

from gliderwatch.cli.main import main
from gliderwatch.config import load
from gliderwatch.model import Kind
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.store.conversion import ROW_CONVERTERS
from gliderwatch.store.database import MIGRATIONS, crc_of_batch, schema
from gliderwatch.store.state_file import Status

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "src" / "gliderwatch"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.glob("*.md")])
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a language, also those indented in a list."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^\1```$", page.read_text(encoding="utf-8"), re.M | re.S)
    return [re.sub(rf"^{indent}", "", block, flags=re.M) for indent, block in found]


def prose(page: Path) -> str:
    return re.sub(r"^ *```.*?^ *```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub makes of the headings."""
    heads = re.findall(r"^#+ (.*)$", prose(page), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def load_script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


# --------------------------------------------------------------------------- text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)\s]+)\)", prose(page))
    for link in links:
        if link.startswith(("https://", "http://", "mailto:")):
            continue
        name, _, anchor = link.partition("#")
        target = page if not name else (page.parent / name).resolve()
        assert target.exists(), f"{page.name}: {link}"
        if anchor:
            assert anchor in anchors(target), f"{page.name}: {link}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_nothing_is_left_open(page: Path) -> None:
    assert not re.search(r"\b(TODO|FIXME|XXX|TBD|lorem ipsum)\b|@@", page.read_text(encoding="utf-8"))


def test_every_page_is_reachable_from_the_readme() -> None:
    for page in DOCS.glob("*.md"):
        assert f"docs/{page.name}" in text("README.md")


# --------------------------------------------------------------------------- commands


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_their_options_exist(page: Path) -> None:
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    for line in lines:
        words = shlex.split(line.split("#")[0].strip()) if line.strip().startswith("gliderwatch ") else []
        if not words:
            continue
        command = main.commands[words[1]]
        if isinstance(command, click.Group):
            command = command.commands[words[2]]
        known = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in words[2:] if word.startswith("-")} <= known, f"{page.name}: {line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_make_targets_and_scripts_exist(page: Path) -> None:
    page_text = page.read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", text("Makefile"), re.M))
    assert set(re.findall(r"(?:^|`)make ([a-z-]+)", page_text, re.M)) <= targets
    for script in re.findall(r"python3? ((?:docs|demo)/\w+\.py)", page_text):
        assert (ROOT / script).is_file(), script


# --------------------------------------------------------------------------- settings and state

PARTS: dict[str, dict[str, object]] = {
    "dockserver": {"roots": ["gliders"]},
    "gliders": {"electa": None},
    "channels": {name: {"url": "json://localhost"} for name in ("mail", "slack", "local")},
}


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "yaml")], ids=lambda page: page.name)
def test_settings_shown_are_good(page: Path, tmp_path: Path) -> None:
    for block in blocks(page, "yaml"):
        shown = YAML(typ="safe", pure=True).load(block)
        path = tmp_path / "gliderwatch.yml"
        whole = PARTS | {key: PARTS.get(key, {}) | section for key, section in shown.items()}
        path.write_text(json.dumps(whole), encoding="utf-8")  # JSON is YAML
        load(path)


def test_queries_fit_the_schema() -> None:
    statements = [
        statement
        for block in blocks(DOCS / "state-file.md", "sql")
        for statement in re.sub(r"--.*", "", block).split(";")
        if statement.strip()
    ]
    assert len(statements) > 5
    db = sqlite3.connect(":memory:")
    for name in ROW_CONVERTERS:
        db.create_function(name, 1, lambda text: text)
    db.create_function("crc_of_batch", 2, crc_of_batch)
    for script in (schema(), *MIGRATIONS.values()):
        db.executescript(script)
    for statement in statements:
        db.execute(statement)


def test_tables_are_all_described() -> None:
    tables = re.findall(r"CREATE TABLE (\w+)", "\n".join([schema(), *MIGRATIONS.values()]))
    described = re.findall(r"^\| `(\w+)` \|", text("docs/state-file.md"), re.M)
    made = {re.sub(r"_\d+$", "", table) for table in tables}  # a table that changes is made anew, and renamed
    assert sorted(made) == sorted(described)


def test_python_shown_reads_a_state_file(tmp_path: Path) -> None:
    write_mission(tmp_path / "gliders", tmp_path / "cache", simulate(Scenario(days=0.3)))
    command = [Path(sys.executable).with_name("gliderwatch"), "run", "--replay", "gliders", "--out", "."]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    code = "\n".join(blocks(DOCS / "state-file.md", "python"))
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    learnt, known = done.stdout.splitlines()
    assert re.match(r"sim sim-2024-121-0-\d+ W 0\.\d+ m/s", learnt)
    assert known.startswith("Fix(t=17145")


# --------------------------------------------------------------------------- words of the code


def test_statuses_and_kinds_are_described() -> None:
    operations, deciding = text("docs/operations.md"), text("docs/how-it-decides.md")
    assert [s for s in Status if f"| `{s}` |" not in operations] == []
    assert [k for k in Kind if f"| `{k}` |" not in deciding] == []


LEVELS = {"debug", "info", "warning", "error", "exception", "critical"}


def log_events() -> set[str]:
    """The first argument of every call of a log; `file ...` stands for those that end with a status."""
    events = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args):
                continue
            if ast.unparse(node.func.value) != "log" or node.func.attr not in LEVELS:
                continue
            first = node.args[0]
            if isinstance(first, ast.Constant):
                events.add(str(first.value))
            else:
                assert ast.unparse(first) == "f'file {file.status}'", ast.unparse(first)
                events |= {f"file {status}" for status in Status}
    return events


def test_benchmarks_are_run_as_their_page_says() -> None:
    told = re.findall(r"`(?:benchmarks/)?(\w+\.py)((?: [^`]*)?)`", text("benchmarks/README.md"))
    assert len(told) > 10
    for script, arguments in told:
        code = text(f"benchmarks/{script}")
        assert all(f'"{flag}"' in code for flag in re.findall(r"--[a-z-]+", arguments)), (script, arguments)


def test_benchmarks_import_what_there_is() -> None:
    """They are run by hand and seldom."""
    gone = []
    for path in sorted((ROOT / "benchmarks").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gliderwatch"):
                module = importlib.import_module(str(node.module))
                gone += [
                    f"{path.name}: {node.module}.{each.name}"
                    for each in node.names
                    if not hasattr(module, each.name)
                    and importlib.util.find_spec(f"{node.module}.{each.name}") is None
                ]
    assert gone == []


def test_events_of_the_log_are_described() -> None:
    rows = re.findall(
        r"^\| ((?:`[^`]+`(?:, )?)+) \| (?:info|warning|error) \|", text("docs/operations.md"), re.M
    )
    assert {event for row in rows for event in re.findall(r"`([^`]+)`", row)} == log_events()


def reasons_described() -> list[str]:
    section = text("docs/how-it-decides.md").partition("## 6.")[2].partition("## 8.")[0]
    return re.findall(r"^\| `([^`]+)` \|", section, re.M)


def words_in(path: Path) -> set[str]:
    """Texts of several words in a module that are not docstrings: those parts that do not vary."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return {
        node.value.strip()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone
        if " " in node.value.strip()
    }


def test_reasons_described_are_those_of_the_code() -> None:
    reasons = reasons_described()
    assert len(reasons) > 20
    code = "".join(
        path.read_text(encoding="utf-8")
        for folder in ("navigation", "estimation")
        for path in (SOURCE / folder).glob("*.py")
    )
    for reason in reasons:
        for part in reason.split("..."):
            assert part.strip() in code, reason


def test_reasons_of_the_code_are_described() -> None:
    described = "\n".join(reasons_described())
    found = words_in(SOURCE / "estimation" / "verdict.py")
    assert len(found) > 12
    assert [words for words in sorted(found) if words not in described] == []


def test_layers_are_those_of_the_contract() -> None:
    contract = text(".importlinter").partition("\nlayers =\n")[2].partition("\n\n")[0]
    layers = [line.strip().replace("gliderwatch.", "") for line in contract.splitlines()]
    shown = re.search(r"```\n(  cli\n.*?)```", text("docs/architecture.md"), re.S)
    assert shown is not None
    assert [line.strip() for line in shown[1].splitlines() if line.strip()] == layers


def test_every_package_has_its_reason() -> None:
    project = tomllib.loads(text("pyproject.toml"))["project"]
    wanted = [
        *project["dependencies"],
        *(p for extra in project["optional-dependencies"].values() for p in extra),
    ]
    names = [re.split(r"[<>=\[]", package)[0] for package in wanted]
    rows = re.findall(r"^\| (\w[\w.-]*) \|", text("docs/libraries.md"), re.M)
    assert sorted(names) == sorted(rows[1:-1] if rows[-1] == "what" else rows[1:])


def test_parts_named_in_libraries_exist() -> None:
    for name in re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", text("docs/libraries.md")):
        assert (SOURCE / name).exists(), name


# --------------------------------------------------------------------------- pictures


def words_of(svg: str) -> tuple[list[str], list[float]]:
    """The text of a picture: words without numbers, and the numbers."""
    shown = " ".join(unescape(t) for t in re.findall(r"<text[^>]*>([^<]*)</text>", svg)).replace("\xa0", " ")
    return NUMBER.sub("#", shown).split(), [float(n) for n in NUMBER.findall(shown)]


def test_pictures_show_what_the_command_prints() -> None:
    for path, made in load_script("picture").documents().items():
        words, numbers = words_of(path.read_text(encoding="utf-8"))
        made_words, made_numbers = words_of(made)
        assert words == made_words, "run: python docs/picture.py"
        assert numbers == pytest.approx(made_numbers, abs=0.011, rel=1e-4), "run: python docs/picture.py"


def counted() -> dict[tuple[str, str], tuple[str, str]]:
    """Missions with an anomaly and with a false alarm in the table of limits, by fault and way."""
    page = text("docs/how-it-decides.md").partition("### Counted on simulated")[2].partition("### ")[0]
    rows = re.findall(r"^\| (.*?) \| .*? \| (.*?) \| (\d+ of \d+) \| (\d+ of \d+) \|$", page, re.M)
    return {(fault, way): (anomaly, false_alarm) for fault, way, anomaly, false_alarm in rows}


def test_readme_has_the_counts_of_the_table() -> None:
    default = {fault.partition(":")[0]: n for (fault, way), n in counted().items() if "learnt" in way}
    double = counted()["remora: drag times 2", "`joint`, learnt"]
    sentence = (
        f"found {double[0]} remoras that double the drag, {default['wing lost'][0]} lost wings that roll, "
        f"and called {default['none'][0]} healthy gliders faulty"
    )
    assert sentence in " ".join(text("README.md").split())


@pytest.mark.slow
def test_limits_are_counted_by_the_script() -> None:
    limits, page = load_script("limits"), text("docs/how-it-decides.md")
    assert {n.split()[2] for pair in counted().values() for n in pair} == {str(limits.SEEDS)}
    assert set(counted()) == {(words, way) for _, _, words in limits.FAULTS for way in limits.WAYS}
    limits.FAULTS = limits.FAULTS[1:2]
    limits.ProcessPoolExecutor = ThreadPoolExecutor  # a process would not know the shorter list
    head, rule, *rows = limits.table(seeds=1, days=0.2).splitlines()
    assert f"{head}\n{rule}\n" in page
    assert [row.split(" | ")[3:] for row in rows] == [["0 of 1", "0 of 1 |"]] * len(limits.WAYS)
