"""A hybrid glider whose files do not name its thruster, through the installed command.

python benchmarks/regime.py [--mission ../shared/data/electa-2022]

The lists of sensors of the mission get another name for each sensor of the thruster, and so another checksum,
which the files then name; nothing else is changed. `gliderwatch run --replay` reads them as it reads any.
Wanted: a notice of the new way of flying, no false alarm.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import zlib
from pathlib import Path

from common import GLIDERWATCH, folder, machine


def unnamed(mission: Path, into: Path) -> int:
    """Write the mission without names of the thruster into a folder; the number of files. Those that hold
    their list themselves, or whose list is missing, are left out."""
    (into / "cache").mkdir(parents=True)
    (into / "from-glider").mkdir()
    renamed = {}
    for path in sorted((mission / "cache").iterdir()):
        text = path.read_bytes().replace(b"thruster", b"thrustor")
        crc = f"{zlib.crc32(text) ^ 0xFFFFFFFF:08x}"
        renamed[path.stem.lower().encode()] = crc.encode()
        (into / "cache" / f"{crc}.cac").write_bytes(text)
    written = 0
    for path in sorted((mission / "from-glider").iterdir()):
        data, tag = path.read_bytes(), b"sensor_list_crc:    "
        for before, after in renamed.items():
            if b"sensor_list_factored:    1" in data and tag + before in data:
                (into / "from-glider" / path.name).write_bytes(data.replace(tag + before, tag + after, 1))
                written += 1
    return written


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--mission", type=Path, default=Path(__file__).parents[2] / "shared/data/electa-2022")
    arguments = parser.parse_args()
    print(machine())
    with folder() as at:
        print(f"{unnamed(arguments.mission, at / 'in')} files without names of the thruster")
        command = ["run", "--replay", str(at / "in"), "--out", str(at / "out")]
        subprocess.run([GLIDERWATCH, *command], capture_output=True, check=True)
        for line in (at / "out" / "alerts.jsonl").read_text(encoding="utf-8").splitlines():
            alert = json.loads(line)
            print(f"\n{alert['kind']}: {alert['title']}")
            if alert["kind"] == "regime":
                print(alert["body"])


if __name__ == "__main__":
    main()
