"""Write the layouts of records and rows as they are today: `python tests/golden/write_layouts.py`.

Then read the diff: of a record only the file of a new layout may come, with its converter
(`gliderwatch.store.conversion`); a row that changed needs a migration.
"""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "unit"), str(Path(__file__).parents[1])]

from test_conversion import LAYOUTS, RECORDS, ROWS, layout  # noqa: E402

from gliderwatch.store.conversion import version  # noqa: E402


def main() -> None:
    """Write a file for each kind; that of an earlier layout stays as it is."""
    LAYOUTS.mkdir(exist_ok=True)
    for kind, name in RECORDS.items():
        (LAYOUTS / f"{name}-{version(kind)}.txt").write_text(layout(kind))
    for kind, name in ROWS.items():
        (LAYOUTS / f"{name}.txt").write_text(layout(kind))


if __name__ == "__main__":
    main()
