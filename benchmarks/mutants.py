"""The faults of mutations.py, room by room: where, what stands there, what is put there instead, which tests must notice."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One fault."""

    name: str
    """What goes wrong, in words."""
    file: str
    """In src/dlama."""
    old: str
    """Stands there exactly once."""
    new: str
    tests: str
    """Files or single tests, separated by blanks."""

    @property
    def room(self) -> str:
        """geometry, files, ..."""
        return self.file.partition("/")[0]


OPTIONS = "tests/apps/test_options_reach.py"
# fmt: off
MUTANTS = (
    Mutant("--pitch is dropped", "apps/options.py", '"pitch": self.pitch or 0.0', '"pitch": 0.0', OPTIONS),
    Mutant("--dolly is dropped", "apps/options.py", '"dolly": self.dolly or 0.0', '"dolly": 0.0', OPTIONS),
    Mutant("--depth-by is dropped", "apps/options.py", '"depth_by": self.depth_by', '"depth_by": None', OPTIONS),
    Mutant("--mask-right is dropped", "apps/cli.py", "mask_right=masks[1]", "mask_right=None", OPTIONS),
    Mutant("--max-disparity is dropped", "apps/cli.py", '"max_disparity": max_disparity', '"max_disparity": None', OPTIONS),
    Mutant("--soft-mask and --mask-polarity are dropped", "apps/jobs.py",
           "return read_mask(path, **masking.settings())", "return read_mask(path)", OPTIONS),
    Mutant("--depth-scale, --far, --channel are dropped", "apps/jobs.py", "camera=camera, **reading.settings())",
           "camera=camera)", OPTIONS),
    Mutant("--textures is dropped", "apps/worlds.py", '"textures": textures}', '"textures": None}', OPTIONS),
    Mutant("--no-shadows is dropped", "apps/worlds.py", '"shadows": shadows', '"shadows": True', OPTIONS),
    Mutant("evaluate --camera is dropped", "apps/evaluate.py", "camera=self.camera", "camera=None", OPTIONS),
    Mutant("evaluate --seed is dropped", "apps/evaluate.py", "seed=self.seed) for name", "seed=0) for name", OPTIONS),
    Mutant("train --max-minutes is dropped", "apps/train.py", "=max_minutes, resume", "=None, resume", OPTIONS),
    Mutant("train --steps is dropped", "apps/train.py", "trunk, steps=steps", "trunk, steps=None", OPTIONS),
    Mutant("pack --size is dropped", "apps/train.py", "size=size, seed=seed)", "size=256, seed=seed)", OPTIONS),
)
# fmt: on
"""All of them."""
