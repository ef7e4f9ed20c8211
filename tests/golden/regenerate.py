"""Write the golden numbers anew: `python tests/golden/regenerate.py`. Then read the diff."""

import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TESTS))

from ruamel.yaml import YAML  # noqa: E402

from conftest import SHARED_DATA  # noqa: E402
from golden_statistics import golden_file, statistics  # noqa: E402
from missions import REAL  # noqa: E402


def main() -> None:
    """One file a mission."""
    yaml = YAML()
    yaml.default_flow_style = None
    for name in REAL:
        with golden_file(name).open("w", encoding="utf-8") as out:
            out.write(
                "# Made by tests/golden/regenerate.py. Quantiles: least, quartiles, greatest; m/s, m.\n"
            )
            yaml.dump(statistics(SHARED_DATA, name), out)


if __name__ == "__main__":
    main()
