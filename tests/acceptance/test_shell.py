"""Man pages and completion are made of the commands, and work in real shells."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from acceptance.support import GLIDERWATCH
from gliderwatch.cli.main import main

SCRIPT = Path(__file__).parents[2] / "docs" / "shell.py"


@pytest.fixture(scope="module")
def share(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("share")
    subprocess.run([sys.executable, SCRIPT, folder], check=True, timeout=120)
    return folder


def in_shell(*words: str) -> str:
    path = f"{Path(GLIDERWATCH).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        words, check=False, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_each_command_has_a_man_page_that_reads_well(share: Path) -> None:
    pages = {path.name: path for path in (share / "man/man1").iterdir()}
    assert {f"gliderwatch-{name}.1" for name in main.commands} < set(pages)
    assert "EXAMPLES\n" in pages["gliderwatch-export.1"].read_text()
    assert not any("\b" in path.read_text() for path in pages.values())
    if shutil.which("man") is None or shutil.which("groff") is None:
        pytest.skip("no man here")
    words = ["groff", "-man", "-Tutf8", "-ww", *map(str, pages.values())]
    made = subprocess.run(words, check=False, capture_output=True, text=True, timeout=60)
    assert made.stderr == ""
    assert "gliderwatch export --format kml" in made.stdout


@pytest.mark.parametrize(
    ("shell", "words"),
    [
        (
            "bash",
            "source {share}/bash-completion/completions/gliderwatch; COMP_WORDS=(gliderwatch expo); "
            'COMP_CWORD=1; _gliderwatch_completion gliderwatch; echo "${{COMPREPLY[@]}}"',
        ),
        (
            "fish",
            "source {share}/fish/vendor_completions.d/gliderwatch.fish; complete -C 'gliderwatch expo'",
        ),
        ("zsh", "autoload -U compinit; compinit -D; source {share}/zsh/site-functions/_gliderwatch; "
                'words=(gliderwatch expo); CURRENT=2; compadd() {{ print -r -- "${{(P)@[-1]}}" }}; '
                '_describe() {{ print -r -- "${{(P)3}}" }}; _gliderwatch_completion'),
    ],
)  # fmt: skip
def test_a_shell_completes(shell: str, words: str, share: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} here")
    assert "export" in in_shell(shell, "-c", words.format(share=share))
