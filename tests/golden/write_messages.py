"""Make the golden messages anew: tests/golden/messages/NAME.txt (40 columns, as on a phone) and NAME.html.

    python tests/golden/write_messages.py

Look at the difference before you commit it: it is what pilots will read.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from message_kinds import kinds
from phone import narrow

FOLDER = Path(__file__).resolve().parent / "messages"


def main() -> None:
    """Write all, and remove what is not made any more."""
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.iterdir():
        old.unlink()
    for name, alert in kinds().items():
        (FOLDER / f"{name}.txt").write_text(narrow(alert), "utf-8")
        (FOLDER / f"{name}.html").write_text(alert.html, "utf-8")


if __name__ == "__main__":
    main()
