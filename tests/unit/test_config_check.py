"""What `check` finds in folders, caches, state and channels, each with its line."""

from __future__ import annotations

import os
from collections import namedtuple
from collections.abc import Callable
from pathlib import Path

import pytest

from gliderwatch.config import Problem, load
from gliderwatch.run.doctor import examine
from gliderwatch.run.preconditions import check

TEXT = """\
dockserver:
  roots:
  - gliders
  cache:
  - cache
state: {path: state/s.sqlite}
gliders:
  electa:
  sam:
    paths:
    - elsewhere/sam
channels:
  hook:
    url: json://localhost/x
recipients:
  pilot: {channels: [hook]}
"""
Check = Callable[..., list[str]]
Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A dockserver on which nothing is wrong."""
    for folder in (
        "gliders/Electa/from-glider",
        "gliders/unknown/from-glider",
        "elsewhere/sam",
        "cache",
        "state",
    ):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "cache" / "0A1B2C3D.CAC").touch()
    return tmp_path


@pytest.fixture
def found(tree: Path) -> Check:
    def _found(text: str = TEXT) -> list[str]:
        path = tree / "c.yml"
        path.write_text(text, encoding="utf-8")
        before = sorted(tree.rglob("*"))
        problems = check(load(path), path)
        assert sorted(tree.rglob("*")) == before, "a check writes nothing"
        return [f"{problem.severity} {problem}".replace(f"{tree}/", "") for problem in problems]

    return _found


def is_one(problems: list[str], start: str, part: str = "") -> bool:
    return len(problems) == 1 and problems[0].startswith(start) and part in problems[0]


def test_nothing_wrong(found: Check) -> None:
    assert found() == []


def test_problem_reads_as_file_line_text_and_cure() -> None:
    assert str(Problem("error", "c.yml:3", "what", "cure")) == "c.yml:3: what (cure)"
    assert str(Problem("warning", "c.yml:3", "what")) == "c.yml:3: what"


def test_roots_that_are_missing_no_folders_or_a_glider(found: Check, tree: Path) -> None:
    (tree / "file").touch()
    extra = TEXT.replace("  - gliders\n", "  - gliders\n  - no/*/such\n  - file\n  - gliders/Electa\n")
    missing, no_folder, glider = found(extra)
    assert missing.startswith("error c.yml:4: dockserver.roots.1: no/*/such is not there (correct the path")
    assert no_folder.startswith("error c.yml:5: dockserver.roots.2: file is not a folder")
    assert glider.startswith("error c.yml:6: dockserver.roots.3: gliders/Electa is the folder of one glider")
    assert glider.endswith("(give gliders)")


def test_patterns_find_gliders_in_every_root(found: Check, tree: Path) -> None:
    (tree / "gliders.txt").touch()
    (tree / "gliders2").mkdir()
    (tree / "gliders" / "Electa").rename(tree / "gliders2" / "Electa")
    assert found(TEXT.replace("- gliders\n", "- 'glider*'\n")) == []


def test_a_folder_named_like_a_pattern(found: Check, tree: Path) -> None:
    (tree / "gliders").rename(tree / "gl[old]")
    assert found(TEXT.replace("- gliders\n", "- gl[old]\n")) == []


def test_folders_that_cannot_be_read(found: Check, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.access

    def access(path: Path, mode: int) -> bool:
        return Path(path).name not in {"from-glider", "cache"} and real(path, mode)

    monkeypatch.setattr(os, "access", access)
    glider, cache = found()
    assert glider.startswith(
        "error c.yml:8: gliders.electa: gliders/Electa/from-glider cannot be read (let this"
    )
    assert cache.startswith("error c.yml:5: dockserver.cache.0: cache cannot be read (let this")


@pytest.mark.parametrize("link", ["gliders/george", "gliders/george/from-glider", "gliders/group/George"])
def test_a_glider_whose_folder_is_a_link_is_named_with_the_cure(found: Check, tree: Path, link: str) -> None:
    target = tree / "disk2" / "george" / "from-glider"
    target.mkdir(parents=True)
    (tree / link).parent.mkdir(exist_ok=True)
    (tree / link).symlink_to(target if link.endswith("from-glider") else target.parent)
    text = TEXT.replace("  electa:\n", "  electa:\n  george:\n")
    assert found(text) == [
        f"error c.yml:9: gliders.george: {link} is a symbolic link, and links are not followed: its files "
        "are not seen (write `paths: [disk2/george/from-glider]` below the glider)"
    ]
    path = tree / "c.yml"
    path.write_text(text, encoding="utf-8")
    folders = [f for f in examine(path) if f.topic == "folders"]
    assert [f.level.name for f in folders] == ["ERROR"]
    assert folders[0].cure == f"write `paths: [{target}]` below the glider"
    cured = text.replace("  george:\n", f"  george: {{paths: ['{target}']}}\n")
    assert found(cured) == []


def test_a_link_that_leads_nowhere_or_is_not_in_the_way_is_nothing(found: Check, tree: Path) -> None:
    (tree / "gliders" / "sam").symlink_to(tree / "nowhere")
    (tree / "gliders" / "alias").symlink_to(tree / "gliders" / "Electa")
    assert found() == []


def test_configured_glider_without_folder_is_a_warning(found: Check) -> None:
    text = TEXT.replace("  electa:\n", "  electa:\n  george:\n")
    assert is_one(found(text), "warning c.yml:9: gliders.george: no folder george/from-glider")


def test_explicit_folder_that_is_missing(found: Check) -> None:
    text = TEXT.replace("elsewhere/sam", "elsewhere/tam")
    assert is_one(found(text), "error c.yml:11: gliders.sam.paths.0: elsewhere/tam is not there")


def test_folders_of_gliders_that_are_not_configured_are_listed(found: Check, tree: Path) -> None:
    for name in ("Maria", "george"):
        (tree / "gliders" / name / "from-glider").mkdir(parents=True)
    (tree / "gliders" / "notes").mkdir()
    assert is_one(found(), "warning c.yml:7: gliders: not configured, so not watched: george, maria (add")


def test_no_gliders_at_all(found: Check) -> None:
    start, end = TEXT.index("gliders:\n  electa"), TEXT.index("channels")
    nothing, stranger = found(TEXT[:start] + TEXT[end:])
    assert nothing.startswith("warning c.yml:1: gliders: no glider is configured")
    assert stranger.startswith("warning c.yml:1: gliders: not configured, so not watched: electa")


def test_caches(found: Check, tree: Path) -> None:
    assert is_one(
        found(TEXT.replace("- cache", "- caches")), "error c.yml:5: dockserver.cache.0: caches is not there"
    )
    assert is_one(
        found(TEXT.replace("  - cache\n", "")), "warning c.yml:4: dockserver.cache: no cache folder"
    )
    (tree / "cache" / "0A1B2C3D.CAC").rename(tree / "cache" / "0a1b2c3d.ccc")
    assert found() == []
    (tree / "cache" / "0a1b2c3d.ccc").rename(tree / "cache" / "cac")
    assert is_one(found(), "warning c.yml:5: dockserver.cache.0: cache holds no .cac or .ccc")


def test_state(found: Check, tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    where = "error c.yml:6: state.path: "
    assert found(TEXT.replace("state/s.sqlite", "new/folder/s.sqlite")) == found()  # the daemon makes it
    assert is_one(found(TEXT.replace("state/s.sqlite", "state")), where + "state is a folder")
    assert is_one(found(TEXT.replace("state/s.sqlite", "gliders/s")), where + "lies below the root gliders")

    with monkeypatch.context() as full:
        full.setattr("shutil.disk_usage", lambda _: Usage(1e9, 0.9e9, 0.1e9))
        assert is_one(found(), "warning c.yml:6: state.path: less than 200 MB are free in")

    real = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK and real(path, mode))
    assert is_one(found(), where + "state/s.sqlite cannot be written by this user")


SECRET = "s3cr3tw0rd"


@pytest.mark.parametrize(
    ("url", "severity", "part"),
    [
        (f"nonsense://{SECRET}", "error", "not an Apprise URL"),
        (f"mailtos://user:{SECRET}@", "error", "not an Apprise URL"),
        ("mailtos://user:${UNSET_HERE}@h.org", "error", "environment variable UNSET_HERE is not set"),
        ("{file: none}", "error", "file none cannot be read: No such file"),
        ("json://${credential:x}", "warning", "credential x is not there"),
    ],
)
def test_channels(
    found: Check,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    url: str,
    severity: str,
    part: str,
) -> None:
    monkeypatch.delenv("CREDENTIALS_DIRECTORY", raising=False)
    problems = found(TEXT.replace("json://localhost/x", url))
    assert is_one(problems, f"{severity} c.yml:14: channels.hook.url: ", part)
    assert SECRET not in problems[0]
    assert capfd.readouterr() == ("", "")


def test_a_credential_missing_inside_of_the_service_is_an_error(
    found: Check, monkeypatch: pytest.MonkeyPatch, tree: Path
) -> None:
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tree))
    text = TEXT.replace("json://localhost/x", "json://localhost/${credential:x}")
    assert is_one(found(text), "error c.yml:14: channels.hook.url: credential x cannot be read")
    (tree / "x").write_text(SECRET)
    assert found(text) == []


def test_nobody_hears(found: Check) -> None:
    start = TEXT.index("recipients")
    assert is_one(found(TEXT[:start]), "warning c.yml:1: recipients: there are none")
    text = (
        TEXT[:start]
        + "  spare: {url: 'json://localhost/y'}\nrecipients:\n  p: {channels: [hook], gliders: [sam]}\n"
    )
    spare, electa = found(text)
    assert spare.startswith("warning c.yml:15: channels.spare: no recipient uses it")
    assert electa.startswith("warning c.yml:8: gliders.electa: no recipient gets its alerts")


def test_nobody_hears_at_once(found: Check) -> None:
    second = TEXT + "  chief: {channels: [hook], unacknowledged_minutes: 30}\n"
    assert found(second) == []
    alone = found(second.replace("  pilot: {channels: [hook]}\n", ""))
    assert is_one(alone, "warning c.yml:15: recipients: nobody gets the alerts of these at once: electa, sam")
