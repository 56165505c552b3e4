"""Jobs of a data set (oracles: its own frames and cases, the verbs called on them)."""

from __future__ import annotations

import pickle
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import dlama
from dlama.datasets.layouts import open_dataset
from dlama.errors import InputError
from dlama.jobs.lists.data_sets import DatasetJobs
from dlama.jobs.perform import Task, work
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.storage import Output
from dlama.worlds.writer import write_worlds
from posed_folders import write_tum

FAST = {"filler": "telea", "only": "image,depth"}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small generated scene in EasySynth's layout."""
    folder = tmp_path_factory.mktemp("worlds")
    write_worlds(folder, count=1, size=48, seed=3)
    return folder


def test_each_frame_is_a_job(root: Path, tmp_path: Path) -> None:
    """As many as frames, ids apart, and the first one's result is that of `view` on the frame."""
    jobs = list(DatasetJobs(root, "view", None, {"yaw": 10, **FAST}))
    frames = open_dataset(root).frames
    assert len(jobs) == len(frames) == len({job.id for job in jobs})
    output = Output(str(tmp_path / "out"))
    row = work(pickle.loads(pickle.dumps(Task(jobs[0], output))))
    assert row.status == "done", row.error
    done = dlama.view(frames[0].load(), yaw=10, filler="telea")
    np.testing.assert_array_equal(dlama.read_color(tmp_path / "out" / jobs[0].id / "image.png"), done.view.color)
    with Manifest(output) as manifest:
        manifest.add(row)
        assert manifest.find_done(jobs[0]) is not None and manifest.find_done(jobs[1]) is None
        other = next(iter(DatasetJobs(root, "view", None, {"yaw": 11, **FAST})))
        assert other.id == jobs[0].id and manifest.find_done(other) is None


@pytest.mark.parametrize(("verb", "protocol"), [("remove", "ori"), ("stereo", "sii")])
def test_removals_and_pairs_are_jobs(root: Path, tmp_path: Path, verb: str, protocol: str) -> None:
    """As many as cases; the first is done."""
    jobs = list(DatasetJobs(root, verb, None, FAST))
    assert len(jobs) == len(open_dataset(root).of(protocol)) > 0  # type: ignore[arg-type]
    row = work(Task(jobs[0], Output(str(tmp_path / "out"))))
    assert row.status == "done", row.error
    assert (tmp_path / "out" / jobs[0].id / "image.png").is_file()


def test_a_layout_without_a_camera_takes_one(tmp_path: Path) -> None:
    """Oracle: the same folder with the camera in it. The message asked for --camera, which was refused."""
    folder = write_tum(tmp_path / "tum")
    inside = [job.load().camera for job in DatasetJobs(folder, "depth")]  # type: ignore[misc]
    (folder / "camera.json").rename(tmp_path / "camera.json")
    given = list(DatasetJobs(folder, "depth", None, {"camera": tmp_path / "camera.json"}))
    assert all(job.load().camera.same_view_as(one) for job, one in zip(given, inside, strict=True))  # type: ignore[misc]
    with pytest.raises(InputError, match="depth_range does not apply to a data set of layout tum"):
        list(DatasetJobs(folder, "depth", None, {"camera": tmp_path / "camera.json", "depth_range": 10.0}))


def test_what_a_data_set_has_itself_is_refused(root: Path) -> None:
    """Messages by hand."""
    for verb, options, message in (
        ("view", {"yaw": 1, "fov": 60}, "fov does not apply to a data set"),
        ("view", {}, "no camera move is given"),
        (None, {}, "verb is ''; one of view"),
    ):
        with pytest.raises(InputError, match=message):
            list(islice(DatasetJobs(root, verb, None, options), 1))
