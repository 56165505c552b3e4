"""`dlama serve` from the command line (oracles: what it prints, the page at that address, what lies on disk)."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import pytest

from dlama.apps.terminal.streams import signals_raise
from dlama.apps.verbs.serve import address_of, serve_until_interrupted
from dlama.web.answers import Limits
from dlama.web.server import open_server


@pytest.mark.slow
def test_it_serves_until_it_is_ended(tmp_path: Path) -> None:
    """The printed address answers; a signal ends it with code 0, and its folder of uploads is gone."""
    words = [sys.executable, "-m", "dlama", "serve", "--port", "0", "--token", "a b&c", "--json"]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment) as running:
        assert running.stdout is not None
        reported = json.loads(running.stdout.readline())
        assert reported["verb"] == "serve" and "token=a%20b%26c" in reported["address"]
        try:
            assert len(list(tmp_path.iterdir())) == 1
            opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            with opener.open(reported["address"], timeout=600) as answer:
                assert b"<title>dlama</title>" in answer.read()
        finally:  # whatever failed, it must not continue for ever
            running.send_signal(signal.SIGTERM)
            try:
                _, errors = running.communicate(timeout=120)
            except subprocess.TimeoutExpired:
                running.kill()
                raise
        assert (running.returncode, errors) == (0, "")
    assert list(tmp_path.iterdir()) == []


def test_a_signal_in_the_midst_of_a_connection_ends_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: a signal that comes while a connection is being handed to its thread ends the server, as any other does."""
    with open_server("127.0.0.1", 0, None, Limits(64, 16.0, 8)) as server:
        hand_on, taken = server.process_request, []

        def interrupted(request: socket.socket, address: object) -> None:
            hand_on(request, address)
            taken.append(threading.current_thread())
            signal.raise_signal(signal.SIGTERM)
            time.sleep(0.1)  # where the interpreter would run the handler, were this the main thread

        monkeypatch.setattr(server, "process_request", interrupted)
        call = threading.Timer(
            0.1, lambda: urllib.request.urlopen(f"http://127.0.0.1:{server.port}/", timeout=60).read()
        )
        call.start()
        with signals_raise():
            serve_until_interrupted(server)
        call.join(60)
        assert len(taken) == 1 and taken[0] is not threading.main_thread()


def test_addresses() -> None:
    """By hand."""
    assert address_of("127.0.0.1", 7860, None) == "http://127.0.0.1:7860/"
    assert address_of("::1", 80, None) == "http://[::1]:80/"
    assert "0.0.0.0" not in address_of("0.0.0.0", 80, "x")
