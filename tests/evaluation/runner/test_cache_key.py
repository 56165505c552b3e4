"""What makes a stored result stale (oracle: hashes compared with each other)."""

from __future__ import annotations

import dataclasses
import functools
import os
from importlib import metadata
from pathlib import Path

import made_up
import numpy as np
import pytest
from made_up import made_up_dataset

from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.evaluation.runner import cache_key as room
from dlama.evaluation.runner.cache_key import (
    cache_key,
    case_hash,
    code_hash,
    method_hash,
    short_hash,
)


def test_another_version_of_the_code_has_another_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a small tree of files: the hash changes with a file that decides, and not with one that shows."""
    (tmp_path / "geometry").mkdir()
    (tmp_path / "evaluation" / "report").mkdir(parents=True)
    deciding, showing = tmp_path / "geometry" / "a.py", tmp_path / "evaluation" / "report" / "b.py"
    monkeypatch.setattr(room, "SOURCE", tmp_path)
    hashes = []
    for one, other in (("1", "1"), ("1", "2"), ("2", "2")):
        deciding.write_text(one)
        showing.write_text(other)
        code_hash.cache_clear()
        hashes.append(code_hash())
    code_hash.cache_clear()
    assert hashes[0] == hashes[1] != hashes[2]


def test_hashes_see_what_matters(tmp_path: Path) -> None:
    """A changed file, another argument, other network bytes: each gives another hash; the same gives the same."""
    case = made_up_dataset(1).cases[0]
    picture, network = tmp_path / "a.png", tmp_path / "net.onnx"
    picture.write_bytes(b"1")
    network.write_bytes(b"1")
    with_file = dataclasses.replace(case, load=functools.partial(made_up.truth, picture))
    first = case_hash(with_file)
    assert first == case_hash(dataclasses.replace(case, load=functools.partial(made_up.truth, picture)))
    os.utime(picture, (1, 1))
    other = Method("dlama", "lama", network)
    hashes = [case_hash(case), first, case_hash(with_file)]
    hashes += [method_hash(other), method_hash(dataclasses.replace(other, seed=3))]
    hashes += [short_hash(one) for one in (np.zeros(3), np.zeros(3, np.float32), np.ones(3), {1: 2})]
    assert len(set(hashes)) == len(hashes)


def test_a_key_holds_all_of_it() -> None:
    """Each part changed by itself gives another key."""
    settings = ProtocolSettings()
    keys = [
        cache_key("case", "method", settings, made_up.protocol),
        cache_key("another", "method", settings, made_up.protocol),
        cache_key("case", "another", settings, made_up.protocol),
        cache_key("case", "method", ProtocolSettings(ring_px=3), made_up.protocol),
        cache_key("case", "method", settings, made_up.truth),
    ]
    assert len(set(keys)) == len(keys) and keys[0] == cache_key("case", "method", settings, made_up.protocol)


@pytest.mark.parametrize("package", ["opencv-python-headless", "numba", "onnxruntime"])
def test_another_version_of_what_computes_makes_results_stale(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    """Each by itself; a package that only draws does not count."""
    version = metadata.version
    key = functools.partial(cache_key, "case", "method", ProtocolSettings(), made_up.protocol)
    before = key()
    for changed, stale in (("jinja2", False), (package, True)):
        monkeypatch.setattr(metadata, "version", lambda name, new=changed: "99.9" if name == new else version(name))
        room.versions.cache_clear()
        assert (key() != before) == stale
    room.versions.cache_clear()


def test_another_provider_and_other_weights_make_results_stale(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who runs the networks, and the weights of the confidence network."""
    key = functools.partial(cache_key, "case", "method", ProtocolSettings(), made_up.protocol)
    monkeypatch.delenv("DLAMA_PROVIDER", raising=False)
    keys = {key()}
    monkeypatch.setattr(room, "default_provider", lambda: "another")
    keys.add(key())
    (tmp_path / "weights.npz").write_bytes(b"other")
    monkeypatch.setattr(room, "WEIGHTS", (str(tmp_path / "weights.npz"),))
    keys.add(key())
    assert len(keys) == 3
