"""Random worlds: what they say of themselves holds, whatever the seed."""

from __future__ import annotations

import dataclasses
import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dlama.errors import FileError, InputError, ShapeError
from dlama.files.rasters.pictures import write_color
from dlama.geometry.kernels import jit
from dlama.geometry.motion.trajectories import orbit
from dlama.worlds.dataset import _from_seed, world
from dlama.worlds.world import World
from dlama.worlds.writer import write_worlds
from marks import first_quick

SEEDS = first_quick([("street", 1), ("room", 3), ("street", 24), ("room", 40)], 2)


def digest(made: World, size: int = 48) -> str:
    """All bytes of a frame."""
    seen = made.raycast(made.camera(30, size))
    return hashlib.sha256(seen.color.tobytes() + seen.depth.tobytes() + seen.light.tobytes()).hexdigest()


@pytest.mark.parametrize(("kind", "seed"), SEEDS)
def test_without_the_object_only_its_pixels_change_depth(kind: str, seed: int) -> None:
    """Law: outside the mask nothing of the geometry changes, inside it something farther appears."""
    made = world(seed, kind=kind)  # type: ignore[arg-type]
    for yaw in (0, -40):
        camera = made.camera(yaw, 160)
        there, gone = made.raycast(camera), made.raycast(camera, object=False)
        mask = there.group == made.object_index
        assert mask.any()
        np.testing.assert_array_equal(there.depth[~mask], gone.depth[~mask])
        assert (gone.depth[mask] > there.depth[mask]).all()
        through = made.raycast(camera, through=there.group).depth
        np.testing.assert_array_equal(through[mask], gone.depth[mask])


@pytest.mark.parametrize(("kind", "seed"), SEEDS)
def test_colour_changes_in_the_mask_and_in_the_shadow_alone(kind: str, seed: int) -> None:
    """Law: with hard edges, taking the object out changes no colour elsewhere, and brightens every pixel of its shadow."""
    made = dataclasses.replace(world(seed, kind=kind), antialias=False)  # type: ignore[arg-type]
    camera = made.camera(0, 200)
    seen = made.raycast(camera), made.raycast(camera, object=False)
    mask, shadow = seen[0].group == made.object_index, made.shadow_of(*seen)
    there, gone = (each.color.astype(int) for each in seen)
    assert not (mask & shadow).any()
    np.testing.assert_array_equal(there[~mask & ~shadow], gone[~mask & ~shadow])
    assert (gone[shadow] >= there[shadow]).all()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_on_every_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rebuilt, on one thread and on three, and in another process; another seed gives another world."""
    first = digest(world(11))
    for threads in (1, 3):
        monkeypatch.setattr(jit, "threads", lambda threads=threads: threads)
        _from_seed.cache_clear()
        assert digest(world(11)) == first
    code = (
        "import hashlib; from dlama.worlds.dataset import world; w = world(11); s = w.raycast(w.camera(30, 48));"
        "print(hashlib.sha256(s.color.tobytes() + s.depth.tobytes() + s.light.tobytes()).hexdigest())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=600)
    assert done.stdout.strip() == first
    assert digest(world(12)) != first


def test_cameras_orbit_the_point_ahead_and_the_rig_is_rectified() -> None:
    """Oracle: geometry.motion.trajectories.orbit of the first camera; 0.12 m along its x axis."""
    made = world(2)
    first = made.camera(size=100, fov=70)
    assert first.fov == pytest.approx(70) and first.world_from_cam[1, 3] == -made.eye_m
    for yaw in (10, -60):
        found, expected = made.camera(yaw, 100, 70), orbit(first, yaw)
        np.testing.assert_allclose(found.world_from_cam, expected.world_from_cam, atol=1e-12)
    rig = made.rig()
    assert rig.baseline_m == pytest.approx(0.12) and rig.left.same_view_as(made.camera())


def test_the_object_is_seen_from_everywhere() -> None:
    """The object of interest is in the picture at every yaw, and no camera stands in an object."""
    for seed in range(300, 308):
        made = world(seed)
        for yaw in (0, 60, -60):
            seen = made.raycast(made.camera(yaw, 96))
            assert (seen.group == made.object_index).mean() > 0.0005, (seed, yaw)
            assert seen.depth.min() > 0.25, (seed, yaw)


def test_photos_become_textures(tmp_path: Path) -> None:
    """Pictures as arrays and as files give the same world, another one than without."""
    rng = np.random.default_rng(0)
    photos = [rng.integers(0, 256, (40 + 20 * n, 90, 3)).astype(np.uint8) for n in range(3)]
    files = [tmp_path / f"{n}.png" for n in range(3)]
    for file, photo in zip(files, photos):
        write_color(file, photo)
    given = {digest(world(7, textures=textures)) for textures in (photos, files)}
    assert len(given) == 1 and digest(world(7)) not in given


def test_bad_wishes_are_refused(tmp_path: Path) -> None:
    """Messages name what came and what is expected."""
    with pytest.raises(InputError, match="seed is -1"):
        world(-1)
    with pytest.raises(FileError, match="is no folder"):
        write_worlds(tmp_path / "out", textures=tmp_path / "none")
    with pytest.raises(FileError, match="holds no pictures"):
        write_worlds(tmp_path / "out", textures=tmp_path)
    with pytest.raises(ShapeError, match="a texture is float64"):
        world(1, textures=[np.zeros((8, 8))])
    with pytest.raises(InputError, match=r"world\.shapes is \(3, 3\)"):
        dataclasses.replace(world(1), shapes=np.zeros((3, 3)))
