"""Virtual AIS from the service: whose number is known, when it is due, to a file and a port."""

from __future__ import annotations

import socket
from pathlib import Path

from pyais import decode
from structlog.testing import capture_logs

from gliderwatch.config import load
from gliderwatch.export.ais import VirtualAis
from gliderwatch.store.state_file import Store
from integration.test_web import keep
from unit.test_pages import NOW, dive


def test_lines_are_given_out_when_they_are_due(tmp_path: Path) -> None:
    state, path, file = tmp_path / "state.sqlite", tmp_path / "gliderwatch.yml", tmp_path / "out" / "ais.txt"
    for name in ("electa", "bruce", "cora"):
        keep(state, name, (dive(glider=name),), ())
    port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    port.bind(("127.0.0.1", 0))
    port.settimeout(20.0)
    path.write_text(
        f"dockserver: {{roots: [{tmp_path}]}}\nstate: {{path: {state}}}\n"
        f"ais: {{file: {file}, udp_port: {port.getsockname()[1]}, seconds: 60}}\n"
        "gliders: {electa: {mmsi: 992441234}, bruce: , cora: {mmsi: 992441235, recovered: true}}\n"
    )
    store = Store.open(state)
    try:
        given = VirtualAis(store)
        given.turn(NOW, 0.0)  # not configured yet
        given.use(load(path))
        given.turn(NOW, 0.0)
        (line,) = file.read_text().splitlines()
        assert decode(line).asdict()["mmsi"] == 992441234
        assert port.recv(1000).decode().strip() == line
        file.unlink()
        given.turn(NOW, 59.0)
        assert not file.exists()
        given.turn(NOW, 60.0)
        assert file.exists()
        file.unlink()
        file.parent.rmdir()
        file.parent.write_text("in the way")
        with capture_logs() as logs:
            given.turn(NOW, 120.0)
            given.turn(NOW, 180.0)
        assert [each["event"] for each in logs] == ["virtual AIS not given out"]
    finally:
        port.close()
        store.close()
