"""Packs the coast that the maps show: `src/gliderwatch/figures/land-10m.xz`.

    npm pack world-atlas@2.0.2 && tar xzf world-atlas-2.0.2.tgz
    python docs/land.py package/land-10m.json

Natural Earth's land at 1 : 10 million (public domain, naturalearthdata.com) as TopoJSON, from the npm package
world-atlas (ISC; its notice is in `land-10m.txt` beside the packed file). What comes out holds the same
points, longitudes counted on across the date line: `gliderwatch.figures.coast` describes the format.
"""

from __future__ import annotations

import json
import lzma
import sys
from pathlib import Path

import numpy as np

TURN = 99_999
"""Steps of the quantised longitude around the earth."""
OUT = Path(__file__).parents[1] / "src" / "gliderwatch" / "figures" / "land-10m.xz"


def pack(topology: dict[str, object]) -> bytes:
    """The packed land of a TopoJSON of quantised arcs."""
    arcs = [np.cumsum(np.array(arc), axis=0) for arc in topology["arcs"]]
    (land,) = topology["objects"]["land"]["geometries"]
    rings = [_unwrapped(_ring(arcs, numbers)) for polygon in land["arcs"] for numbers in polygon]
    transform = topology["transform"]
    head = np.array([*transform["scale"], *transform["translate"]], dtype="<f8")
    steps = np.concatenate([np.diff(ring, axis=0) for ring in rings])
    parts = (
        head.tobytes(),
        np.array([len(rings)], dtype="<u4").tobytes(),
        np.array([len(ring) for ring in rings], dtype="<u4").tobytes(),
        np.array([ring[0] for ring in rings], dtype="<i4").tobytes(),
        np.ascontiguousarray(steps.T, dtype="<i4").tobytes(),
    )
    return lzma.compress(b"".join(parts), preset=9 | lzma.PRESET_EXTREME)


def _ring(arcs: list[np.ndarray], numbers: list[int]) -> np.ndarray:
    """The points of a ring; ~i is arc i backwards, and the first point of an arc ends the one before."""
    parts = [arcs[i] if i >= 0 else arcs[~i][::-1] for i in numbers]
    return np.concatenate([part if k == 0 else part[1:] for k, part in enumerate(parts)])


def _unwrapped(ring: np.ndarray) -> np.ndarray:
    """A ring whose longitude does not jump at the date line; one around the pole is closed by way of it."""
    turns = np.cumsum(-np.round(np.diff(ring[:, 0]) / TURN))
    x = ring[:, 0] + TURN * np.concatenate([[0], turns])
    out = np.stack([x, ring[:, 1]], axis=1).astype(int)
    if out[0, 0] != out[-1, 0]:
        out = np.concatenate([out, [[out[-1, 0], 0], [out[0, 0], 0], out[0]]])
    return out


if __name__ == "__main__":
    OUT.write_bytes(pack(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))))
    print(f"{OUT}: {OUT.stat().st_size} bytes")
