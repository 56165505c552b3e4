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
LAW = "tests/geometry/test_visibility.py"
DRAWN = "tests/geometry"
GLB = "tests/files/test_clouds.py tests/files/test_results.py"
TILES = "tests/inpainters/networks/test_tiling.py"
CONTRACT = "tests/inpainters/networks/test_contract.py tests/inpainters/networks/test_engine.py"
LAYERED = "tests/inpainters/layered"
LPIPS = "tests/evaluation/metrics/test_lpips.py"
LOSSES = "tests/training/losses"
LOOP = "tests/training/loop/test_loop.py"
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
    Mutant("the law's 1 mm", "geometry/kernels/visibility.py", "return max(1e-3, 1e-3 * depth)", "return 1e-3 * depth", LAW),
    Mutant("the law's rounds", "geometry/visibility.py", "MAX_ROUNDS = 8", "MAX_ROUNDS = 1", LAW),
    Mutant("the law's last resort", "geometry/visibility.py", "out[self.violations(camera, out, where)] = np.inf", "pass", LAW),
    Mutant("far pixels are fused twice", "geometry/fusion.py", "depth_only & ~layer.valid & ~layer.far",
           "depth_only & ~layer.valid", "tests/geometry/test_fusion.py"),
    Mutant("surfaces are cut at 0.5 % instead of 1 %", "geometry/drawing.py", "6.0 / camera.fx, 0.01,", "6.0 / camera.fx, 0.005,", DRAWN),
    Mutant("surfaces are cut at 2 % instead of 1 %", "geometry/drawing.py", "6.0 / camera.fx, 0.01,", "6.0 / camera.fx, 0.02,", DRAWN),
    Mutant("layers cover others however close behind", "geometry/rendering.py", "tolerance=0.005", "tolerance=0.0", DRAWN),
    Mutant("layers 5 % nearer cover nothing", "geometry/rendering.py", "tolerance=0.005", "tolerance=0.05", DRAWN),
    Mutant("filled layers cover measured pixels at home", "geometry/rendering.py", "over_measured=measured", "over_measured=True", DRAWN),
    Mutant("own sky is covered by nearer layers", "geometry/rendering.py",
           "if grid.own_camera:\n                draw_far", "if False:\n                draw_far", DRAWN),
    Mutant("footprints of any size", "geometry/kernels/footprints.py", "half = min(16.0, ", "half = min(1e9, ", DRAWN),
    Mutant("the spline's border is black", "geometry/kernels/sampling.py", "cv2.BORDER_REFLECT_101", "cv2.BORDER_CONSTANT", DRAWN),
    Mutant("7-Scenes' colour camera on the other side", "datasets/numbered_frames.py", "[1, 0, 0, -0.025]", "[1, 0, 0, 0.025]",
           "tests/datasets/test_layout_numbered_frames.py"),
    Mutant("pairs that hardly overlap", "datasets/view_pairs.py", "MIN_OVERLAP = 0.1", "MIN_OVERLAP = 0.0", "tests/datasets"),
    Mutant("pairs overlap whatever their depth", "datasets/view_pairs.py", "LANDS_WITHIN = 0.05", "LANDS_WITHIN = 0.5", "tests/datasets"),
    Mutant("GLB without the sRGB curve", "files/meshes.py", "((level + 0.055) / 1.055) ** 2.4", "level", GLB),
    Mutant("GLB's curve has no straight part", "files/meshes.py", "level <= 0.04045, level / 12.92", "level < 0, level / 12.92", GLB),
    Mutant("resize_depth half a pixel off", "files/rgbd.py", "(np.arange(n) + 0.5) * old / n", "np.arange(n) * old / n", "tests/files/test_rgbd.py"),
    Mutant("hole.png leaves out what lacked only depth", "files/results.py", "view.hole_type > 0)",
           "(view.hole_type > 0) & (view.hole_type != 5))", "tests/files/test_results.py"),
    Mutant("https redirects to http", "models/download.py", 'if url.startswith("https:") and', "if not url and", "tests/models/test_pull.py"),
    Mutant("the hash is of a file's first part", "models/verify.py", "while piece := ", "if piece := ", "tests/models"),
    Mutant("crops without context", "inpainters/networks/tiling.py", "CONTEXT = 48", "CONTEXT = 0", TILES),
    Mutant("context does not grow with the hole", "inpainters/networks/tiling.py", "CONTEXT_SHARE = 0.4", "CONTEXT_SHARE = 0.0", TILES),
    Mutant("the padded hole is known", "inpainters/networks/tiling.py", 'np.pad(hole, pad, mode="reflect")', "np.pad(hole, pad)", TILES),
    Mutant("tanh networks give 0..1", "inpainters/networks/contract.py", '"tanh": (-1.0, 1.0)', '"tanh": (0.0, 1.0)', CONTRACT),
    Mutant("out_range None is 0..1", "inpainters/networks/contract.py", "self.out_range or self.in_range", "self.out_range or (0.0, 1.0)", CONTRACT),
    Mutant("extrapolation costs nothing", "inpainters/layered/surface_labels.py", "EXTRAPOLATION_COST = 6.0", "EXTRAPOLATION_COST = 0.0", LAYERED),
    Mutant("the order of surfaces costs nothing", "inpainters/layered/surface_labels.py", "ORDER_COST = 3.0", "ORDER_COST = 0.0", LAYERED),
    Mutant("sky seen by the source only is not continued", "inpainters/layered/surface_labels.py",
           "(number == 1 and law.has_far)", "False", LAYERED),
    Mutant("the way to the source's sky is not measured", "inpainters/layered/surface_labels.py",
           "if law.has_far:\n            angle", "if False:\n            angle", LAYERED),
    Mutant("the sky's colour is not handed on", "inpainters/layered/filler.py", "sky=law.far_color", "sky=None", LAYERED),
    Mutant("MI-GAN's level 0 is sky indoors", "inpainters/networks/migan.py", "if not view.far.any():", "if False:",
           "tests/inpainters/networks tests/inpainters/test_filling.py"),
    Mutant("LPIPS of a region sees what lies outside", "evaluation/metrics/lpips.py", "np.where(inside, mine, truth)", "mine", LPIPS),
    Mutant("LPIPS' map half a cell off", "evaluation/metrics/lpips.py", "(np.arange(wanted) + 0.5) * (size / wanted) - 0.5",
           "np.arange(wanted) * (size / wanted)", LPIPS),
    Mutant("ORI's ring is 8 px", "evaluation/protocols/methods.py", "ring_px: int = 16", "ring_px: int = 8", "tests/evaluation/protocols"),
    Mutant("ORI counts the ring as outside", "evaluation/metrics/regions.py", '"outside": ~grown', '"outside": ~mask', "tests/evaluation/metrics/test_regions.py tests/evaluation/protocols/test_ori.py"),
    Mutant("seen within 20 %", "evaluation/protocols/methods.py", "seen_tolerance: float = 0.02", "seen_tolerance: float = 0.2",
           "tests/evaluation/protocols tests/evaluation/metrics/test_regions.py"),
    Mutant("checkpoints run pickled code", "training/loop/checkpointing.py", "weights_only=True)\n    except", "weights_only=False)\n    except", "tests/training/loop/test_resume.py"),
    Mutant("trunks run pickled code", "training/losses/trunks.py", "weights_only=True", "weights_only=False", "tests/training/losses"),
    Mutant("weight files run pickled code", "nets/torch_file.py", 'return type("Inert", (Inert,), {})', "return super().find_class(module, name)", "tests/nets/test_torch_file.py"),
    Mutant("R1 has no weight", "training/losses/terms.py", "strength * adversarial.gradient_penalty", "adversarial.gradient_penalty", LOSSES),
    Mutant("R1 every n-th step is not n times as strong", "training/loop/module.py", "gradient_penalty * every if", "gradient_penalty if", LOOP),
    Mutant("R1 in every step", "training/loop/module.py", "if self.step % every == 0 else 0.0", "", LOOP),
    Mutant("the guard's state goes on learning", "training/loop/module.py", "return copy.deepcopy(dict(state))", "return dict(state)", LOOP),
    Mutant("the guard keeps its first state for ever", "training/loop/module.py",
           "elif self.step % self.settings.loop.guard_every == 0:\n            self.guard.keep(self)", "elif False:\n            pass", LOOP),
    Mutant("the guard forgets the optimisers", "training/loop/module.py", "optimiser.load_state_dict(_copied(state))", "pass", LOOP),
    Mutant("masks of any area", "training/data/masks.py", "SMALLEST, LARGEST = 0.005, 0.7", "SMALLEST, LARGEST = 0.0, 1.0", "tests/training/data/test_masks.py"),
    Mutant("wide masks are narrower", "training/data/masks.py", '(0.04, 0.8), (0.02, 0.4), (1, 3)', '(0.04, 0.8), (0.02, 0.3), (1, 3)', "tests/training/data/test_masks.py"),
)
# fmt: on
"""All of them."""
