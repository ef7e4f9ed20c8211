"""What is installed and how it runs: locks, wheel, service, image, make, and the check of real tests."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RUNTIME = PROJECT["project"]["dependencies"]
DEV = PROJECT["dependency-groups"]["dev"]
EXPOSURE_MAX = 1.5


def run(*command: object, cwd: Path = ROOT, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=os.environ | env,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def locked(name: str) -> list[Requirement]:
    """The packages of a lock file; fails on any that is not pinned and hashed."""
    text = (ROOT / name).read_text(encoding="utf-8").replace("\\\n", " ")
    packages = []
    for line in text.splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        requirement, *hashes = line.split("--hash=")
        assert hashes, f"without a hash: {line}"
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}\s*", digest) for digest in hashes), line
        packages.append(Requirement(requirement.strip()))
        assert re.fullmatch(r"==[^*,]+", str(packages[-1].specifier)), f"not pinned: {line}"
    return packages


# --------------------------------------------------------------------------- locks


@pytest.mark.parametrize(
    ("name", "wanted"), [("requirements.lock", RUNTIME), ("requirements-dev.lock", RUNTIME + DEV)]
)
def test_lock_satisfies_pyproject(name: str, wanted: list[str]) -> None:
    packages = locked(name)
    for text in wanted:
        want = Requirement(text)
        found = [
            package for package in packages if canonicalize_name(package.name) == canonicalize_name(want.name)
        ]
        assert found, f"{text} is not in {name}: make lock"
        for package in found:
            version = str(package.specifier).removeprefix("==")
            assert want.specifier.contains(version), (
                f"{name} has {want.name} {version}, not {want}: make lock"
            )


def test_what_is_tested_is_what_is_installed() -> None:
    def pins(name: str) -> set[str]:
        return {f"{package.name}{package.specifier}" for package in locked(name)}

    assert pins("requirements.lock") <= pins("requirements-dev.lock")


@pytest.mark.parametrize("name", ["requirements.lock", "requirements-dev.lock"])
def test_lock_names_no_host(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert not re.search(r"://|--(extra-)?index-url|--find-links| @ ", text)


# --------------------------------------------------------------------------- wheel


def test_wheel_carries_presets_licence_and_command(tmp_path: Path) -> None:
    built = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path)
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        commands = next(name for name in names if name.endswith("entry_points.txt"))
        assert "gliderwatch = gliderwatch.__main__:main" in archive.read(commands).decode()
    for path in sorted((ROOT / "src").rglob("*.py")):
        assert path.relative_to(ROOT / "src").as_posix() in names
    assert "gliderwatch/config/presets.yml" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if name.startswith(("tests", "benchmarks"))]


# --------------------------------------------------------------------------- service


@pytest.fixture(params=["gliderwatch.service", "gliderwatch-web.service"])
def unit(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A service with its command and its user replaced by ones that exist on this machine."""
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed")
    text = (ROOT / "systemd" / request.param).read_text(encoding="utf-8")
    path = tmp_path / request.param
    path.write_text(text.replace("/opt/gliderwatch/bin/gliderwatch", "/bin/true"), encoding="utf-8")
    return path


def test_systemd_accepts_the_service_without_a_word(unit: Path) -> None:
    verified = run("systemd-analyze", "verify", unit)
    said = [line for line in verified.stderr.splitlines() if unit.name in line]
    assert (verified.returncode, said) == (0, [])


def test_service_is_sandboxed(unit: Path) -> None:
    shown = run("systemd-analyze", "security", "--offline=true", unit)
    if "unrecognized option" in shown.stderr:
        pytest.skip("this systemd-analyze can not judge a file (systemd before 250)")
    exposure = re.search(r"exposure level for \S+: ([0-9.]+)", shown.stdout)
    assert exposure, shown.stderr
    assert float(exposure[1]) <= EXPOSURE_MAX


@pytest.mark.parametrize(
    "line",
    [
        "Type=notify",
        "ExecStart=/opt/gliderwatch/bin/gliderwatch run -c /etc/gliderwatch/gliderwatch.yml",
        "ExecReload=/bin/kill -HUP $MAINPID",
        "Restart=on-failure",
        "User=gliderwatch",
        "StateDirectory=gliderwatch",
        "ProtectSystem=strict",
    ],
)
def test_service_says(line: str) -> None:
    assert line in (ROOT / "systemd" / "gliderwatch.service").read_text(encoding="utf-8").splitlines()


def test_service_user_is_declared() -> None:
    declared = (ROOT / "systemd" / "sysusers.conf").read_text(encoding="utf-8")
    assert re.search(r"^u gliderwatch - ", declared, re.MULTILINE)


# --------------------------------------------------------------------------- image


def test_image_copies_only_what_its_context_has() -> None:
    kept = {
        line[1:] for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").split() if line[0] == "!"
    }
    dockerfile = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    copied = set(re.findall(r"^COPY (?!--from)(\S+) ", dockerfile, re.MULTILINE)) - {"."}
    assert copied <= kept
    assert {"src", "config", "pyproject.toml", "README.md", "LICENSE"} <= kept
    assert all((ROOT / name).exists() for name in kept)


def test_image_installs_by_hash_and_runs_as_nobody() -> None:
    dockerfile = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    for command in re.findall(r"pip install (.*)", dockerfile):
        assert "--require-hashes" in command or "--no-deps --no-index" in command, command
    final = dockerfile[dockerfile.rindex("\nFROM") :]
    assert re.search(r"^USER [1-9]\d*", final, re.MULTILINE)
    assert "STOPSIGNAL SIGTERM" in final
    assert re.search(r'HEALTHCHECK.*\\\n\s+CMD \["gliderwatch", "status"', final)


# --------------------------------------------------------------------------- make


def test_make_lists_every_target() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)", makefile, re.MULTILINE)
    assert phony
    listed = run("make", "--no-print-directory").stdout
    assert re.findall(r"^  make (\S+)", listed, re.MULTILINE) == phony[1].split()


def test_make_installs_once(tmp_path: Path) -> None:
    """With both stamps newer than what they are made from, nothing is left to install."""
    for name in ("Makefile", "pyproject.toml", "requirements-dev.lock"):
        shutil.copy(ROOT / name, tmp_path)
    fresh = run("make", "-n", "install", cwd=tmp_path).stdout
    assert "--require-hashes --only-binary :all: -r requirements-dev.lock" in fresh
    assert "--no-deps --no-build-isolation" in fresh
    (tmp_path / ".venv").mkdir()
    for stamp in ("locked", "installed"):
        (tmp_path / ".venv" / stamp).touch()
    assert "pip" not in run("make", "-n", "install", cwd=tmp_path).stdout


# --------------------------------------------------------------------------- were real missions read?

REAL = """
import pytest
@pytest.mark.real
@pytest.mark.parametrize("path", ["a/b.sbd", "[x]"])
def test_real(path):
    {real}
def test_other():
    pytest.skip("no tool")
"""


def ci_says(folder: Path, text: str, *options: str) -> tuple[int, str]:
    """Run tests as `.ci/run` does, then its check of the report."""
    (folder / "test_it.py").write_text(text, encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = real: x\n", encoding="utf-8")
    run(
        *(sys.executable, "-m", "pytest", "--junit-xml=report.xml", *options),
        cwd=folder,
        PYTHONPATH=str(ROOT / ".ci"),
        PYTEST_PLUGINS="real_tests",
        PYTEST_DISABLE_PLUGIN_AUTOLOAD="1",  # a second less for each
    )
    checked = run(sys.executable, ROOT / ".ci" / "real_tests.py", "report.xml", cwd=folder)
    return checked.returncode, checked.stdout


@pytest.mark.parametrize(
    ("real", "options", "ok", "said"),
    [
        ("pass", "", True, "none was skipped"),
        ("assert False", "", True, "none was skipped"),  # pytest itself reports that one
        ("pytest.skip('no data')", "", False, "real test skipped: test_it::test_real[[x]]: no data"),
        ("pytest.skip('no data')", "-pxdist -n2", False, "skipped: test_it::test_real[[x]]: no data"),
        ("pytest.xfail('known')", "", False, "no real test ran"),
    ],
)
def test_ci_sees_skipped_real_tests(tmp_path: Path, real: str, options: str, ok: bool, said: str) -> None:
    status, output = ci_says(tmp_path, REAL.format(real=real), *options.split())
    assert (status == 0) == ok, output
    assert said in output


def test_ci_sees_real_tests_that_are_gone(tmp_path: Path) -> None:
    status, output = ci_says(tmp_path, "def test_other(): pass")
    assert status == 1
    assert "no real test ran" in output


def test_ci_sees_a_module_skipped_whole(tmp_path: Path) -> None:
    status, output = ci_says(tmp_path, "import pytest\npytest.importorskip('no_such_module')\n" + REAL)
    assert status == 1
    assert "skipped as a whole" in output


def test_the_wheelhouse_holds_all_pages_and_no_link_of_theirs_leads_out_of_it(tmp_path: Path) -> None:
    recipe = run("make", "-n", "wheelhouse", "VENV=" + str(tmp_path / "venv")).stdout
    copies = [line for line in recipe.splitlines() if re.search(r"\bcp .*dist/wheelhouse", line)]
    house = tmp_path / "house"
    house.mkdir()
    (tmp_path / "dist").mkdir()
    (tmp_path / "dist" / "gliderwatch.cdx.json").touch()
    for name in (
        "requirements.lock",
        "config",
        "systemd",
        "docs",
        "benchmarks",
        *(p.name for p in ROOT.glob("*[DEG].md")),
        "LICENSE",
    ):
        (tmp_path / name).symlink_to(ROOT / name)
    for line in copies:
        done = run(
            "sh", "-c", line.replace("dist/wheelhouse", str(house)).replace("cp -r", "cp -rL"), cwd=tmp_path
        )
        assert done.returncode == 0, (line, done.stderr)
    pages = {page.name for page in (ROOT / "docs").iterdir() if page.is_file()}
    assert pages <= {page.name for page in (house / "docs").iterdir()}
    for page in house.rglob("*.md"):
        for link in re.findall(r"\]\(([^)\s#]+)", page.read_text(encoding="utf-8")):
            if "://" not in link and not link.startswith("mailto:") and page.parent != house / "benchmarks":
                assert (page.parent / link).exists(), f"{page.relative_to(house)}: {link}"


def test_nothing_is_advised_to_be_installed_by_a_name_that_may_be_anothers() -> None:
    """An index may have another gliderwatch: it is installed from its own archive or checkout alone."""
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "src").rglob("*.py")]
    for page in pages:
        for line in page.read_text(encoding="utf-8").splitlines():
            if re.search(r"pip install.*\bgliderwatch(?![/\w-])", line.replace("/opt/gliderwatch", "")):
                assert "--no-index" in line, f"{page.name}: {line}"
