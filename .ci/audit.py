"""Are the locked packages what is installed, and is a weakness known of any of them?

python .ci/audit.py requirements.lock

Checks offline that every package is pinned with hashes, and that those of the lock are installed in just that
version. Then asks PyPI's advisories (with pip-audit) where they can be reached. What was and was not
checked is printed and kept in build/audit.json. Ends with 1 where something is wrong.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import urllib.error
import urllib.request
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from packaging.requirements import Requirement

PIP_AUDIT = "pip-audit==2.10.1"
ADVISORIES = "https://pypi.org/pypi/{0}/{1}/json"
ENTRY = re.compile(r"^([\w.-]+==[^\\\n]+?)\s*\\?\n((?:    --hash=\S+\s*\\?\n)*)", re.M)

Package = tuple[str, str, int]
"""Name, version and number of hashes."""


def locked(path: Path) -> list[Package]:
    """The packages of a lock that this Python takes."""
    entries = [(Requirement(text), hashes) for text, hashes in ENTRY.findall(path.read_text())]
    return [
        (entry.name, next(iter(entry.specifier)).version, hashes.count("--hash=sha256:"))
        for entry, hashes in entries
        if entry.marker is None or entry.marker.evaluate()
    ]


def offline(packages: list[Package]) -> list[str]:
    """What is wrong with the lock, or with what is installed."""
    wrong = [f"{name} has no hash in the lock" for name, _, hashes in packages if not hashes]
    for name, wanted, _ in packages:
        try:
            found = version(name)
        except PackageNotFoundError:
            found = "nothing"
        if found != wanted:
            wrong.append(f"{name} is installed as {found}, the lock says {wanted}")
    return wrong


def is_reachable(name: str, version: str) -> bool:
    """Whether PyPI's advisories answer for a package."""
    try:
        with urllib.request.urlopen(ADVISORIES.format(name, version), timeout=10) as answer:
            return "vulnerabilities" in json.load(answer)
    except (OSError, ValueError, urllib.error.URLError):
        return False


def advisories(lock: Path, packages: list[Package]) -> tuple[str, list[str]]:
    """What pip-audit says, in words, and what it found wrong."""
    if not packages or not is_reachable(*packages[0][:2]):
        return "not asked: PyPI's advisories cannot be reached from here", []
    tool = Path("build/audit")
    subprocess.run([sys.executable, "-m", "venv", tool], check=True)
    subprocess.run([tool / "bin/python", "-m", "pip", "install", "--quiet", PIP_AUDIT], check=True)
    command = [tool / "bin/pip-audit", "-r", lock, "--require-hashes", "--disable-pip", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    answers = json.loads(done.stdout)["dependencies"]
    found = [
        f"{each['name']} {each['version']}: {', '.join(v['id'] for v in each['vulns'])}"
        for each in answers
        if each.get("vulns")
    ]
    skipped = sum("skip_reason" in each for each in answers)
    return f"asked for {len(answers) - skipped} of {len(answers)}", found


def main() -> int:
    """The exit status."""
    lock = Path(sys.argv[1])
    packages = locked(lock)
    wrong = offline(packages) if packages else [f"{lock} holds no package"]
    asked, found = advisories(lock, packages)
    record = {"lock": str(lock), "packages": len(packages), "advisories": asked, "wrong": wrong + found}
    Path("build").mkdir(exist_ok=True)
    Path("build/audit.json").write_text(json.dumps(record, indent=1) + "\n")
    print(f"{len(packages)} packages of {lock}: pinned with hashes and installed so; advisories {asked}")
    for each in wrong + found:
        print(f"  {each}")
    return 1 if wrong or found else 0


if __name__ == "__main__":
    sys.exit(main())
