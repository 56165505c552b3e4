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


def faults(file: str, tests: str, *each: tuple[str, str, str]) -> tuple[Mutant, ...]:
    """Faults of one file that the same tests must notice: what goes wrong, what stands there, what is put there."""
    return tuple(Mutant(name, file, old, new, tests) for name, old, new in each)


OPTIONS = "tests/apps/test_options_reach.py"
PAIR = "tests/completion/stereo/test_stereo_options.py"
LAYERS = "tests/geometry/test_layer_precedence.py"
MUTANTS: tuple[Mutant, ...] = (
    *faults(
        "apps/options.py",
        OPTIONS,
        ("--pitch is dropped", '"pitch": self.pitch or 0.0', '"pitch": 0.0'),
        ("--dolly is dropped", '"dolly": self.dolly or 0.0', '"dolly": 0.0'),
        ("options of the library are dropped", 'vars(self) | {"model"', '{"model"'),
    ),
    *faults(
        "apps/cli.py",
        OPTIONS,
        ("--mask-right is dropped", "mask_right=masks[1]", "mask_right=None"),
        ("--max-disparity is dropped", '"max_disparity": max_disparity', '"max_disparity": None'),
    ),
    *faults(
        "jobs/inputs.py",
        OPTIONS,
        (
            "--soft-mask and --mask-polarity are dropped",
            "mask = read_mask(path, **options)",
            "mask = read_mask(path)",
        ),
    ),
    *faults(
        "apps/command.py",
        OPTIONS,
        (
            "--depth-scale, --far, --channel are dropped",
            "reading.settings() | estimating.settings()",
            "estimating.settings()",
        ),
    ),
    *faults(
        "apps/verbs/measuring/worlds.py",
        OPTIONS,
        ("--textures is dropped", '"textures": textures}', '"textures": None}'),
        ("--no-shadows is dropped", '"shadows": shadows', '"shadows": True'),
    ),
    *faults(
        "apps/verbs/measuring/evaluate.py",
        OPTIONS,
        ("evaluate --camera is dropped", "camera=self.camera", "camera=None"),
        ("evaluate --seed is dropped", "seed=self.seed) for name", "seed=0) for name"),
    ),
    *faults(
        "apps/verbs/networks/train.py",
        OPTIONS,
        ("train --max-minutes is dropped", "=max_minutes, resume", "=None, resume"),
        ("train --steps is dropped", "steps=steps,", "steps=None,"),
        ("pack --size is dropped", "size=size, seed=seed)", "size=256, seed=seed)"),
    ),
    *faults(
        "geometry/kernels/visibility.py",
        "tests/geometry/test_visibility.py::test_the_tolerance_is_a_millimetre_up_to_one_metre",
        ("the law's 1 mm", "return max(1e-3, 1e-3 * depth)", "return 1e-3 * depth"),
    ),
    *faults(
        "geometry/visibility.py",
        "tests/geometry/test_visibility.py::test_two_laws_send_a_point_to_and_fro_until_both_are_kept",
        ("the law's rounds", "MAX_ROUNDS = 8", "MAX_ROUNDS = 1"),
    ),
    *faults(
        "geometry/visibility.py",
        "tests/geometry/test_visibility.py::test_what_still_breaks_the_law_after_the_last_round_is_far",
        ("the law's last resort", "out[self.violations(camera, out, where)] = np.inf", "pass"),
    ),
    *faults(
        "geometry/fusion.py",
        LAYERS,
        ("far pixels are fused twice", "depth_only & ~layer.valid & ~layer.far", "depth_only & ~layer.valid"),
    ),
    *faults(
        "geometry/drawing/picture_edges.py",
        LAYERS,
        (
            "surfaces are cut at 0.5 % instead of 1 %",
            "6.0 * pixels / camera.fx, 0.01,",
            "6.0 * pixels / camera.fx, 0.005,",
        ),
        (
            "surfaces are cut at 2 % instead of 1 %",
            "6.0 * pixels / camera.fx, 0.01,",
            "6.0 * pixels / camera.fx, 0.02,",
        ),
    ),
    *faults(
        "geometry/rendering.py",
        LAYERS,
        ("layers cover others however close behind", "tolerance=0.005", "tolerance=0.0"),
        ("layers 5 % nearer cover nothing", "tolerance=0.005", "tolerance=0.05"),
        ("filled layers cover measured pixels at home", "over_measured=measured", "over_measured=True"),
        (
            "own sky is covered by nearer layers",
            "if grid.own_camera:\n                draw_far",
            "if False:\n                draw_far",
        ),
    ),
    *faults(
        "geometry/kernels/footprints.py",
        LAYERS,
        ("footprints of any size", "half = min(16.0, ", "half = min(1e9, "),
    ),
    *faults(
        "geometry/kernels/sampling.py",
        LAYERS,
        ("the spline's border is black", "cv2.BORDER_REFLECT_101", "cv2.BORDER_CONSTANT"),
    ),
    *faults(
        "datasets/posed/numbered_frames.py",
        "tests/datasets/test_layout_numbered_frames.py",
        ("7-Scenes' colour camera on the other side", "[1, 0, 0, -0.025]", "[1, 0, 0, 0.025]"),
    ),
    *faults(
        "datasets/posed/view_pairs.py",
        "tests/datasets/test_layout_detection.py",
        ("pairs that hardly overlap", "MIN_OVERLAP = 0.1", "MIN_OVERLAP = 0.0"),
        ("pairs overlap whatever their depth", "LANDS_WITHIN = 0.05", "LANDS_WITHIN = 0.5"),
    ),
    *faults(
        "files/scenes/meshes.py",
        "tests/files/test_clouds.py",
        ("GLB without the sRGB curve", "((level + 0.055) / 1.055) ** 2.4", "level"),
        ("GLB's curve has no straight part", "level <= 0.04045, level / 12.92", "level < 0, level / 12.92"),
    ),
    *faults(
        "files/rgbd.py",
        "tests/files/test_rgbd.py",
        ("resize_depth half a pixel off", "(np.arange(n) + 0.5) * old / n", "np.arange(n) * old / n"),
    ),
    *faults(
        "files/results/completion.py",
        "tests/files/test_results.py",
        (
            "hole.png leaves out what lacked only depth",
            "view.hole_type > 0)",
            "(view.hole_type > 0) & (view.hole_type != 5))",
        ),
    ),
    *faults(
        "models/download.py",
        "tests/models/test_pull.py",
        ("https redirects to http", 'if url.startswith("https:") and', "if not url and"),
    ),
    *faults(
        "models/verify.py",
        "tests/models/test_network_file.py",
        ("the hash is of a file's first part", "while piece := ", "if piece := "),
    ),
    *faults(
        "inpainters/networks/tiling.py",
        "tests/inpainters/networks/test_tiling.py",
        ("crops without context", "CONTEXT = 48", "CONTEXT = 0"),
        ("context does not grow with the hole", "CONTEXT_SHARE = 0.4", "CONTEXT_SHARE = 0.0"),
        ("the padded hole is known", 'np.pad(hole, pad, mode="reflect")', "np.pad(hole, pad)"),
    ),
    *faults(
        "inpainters/networks/contract.py",
        "tests/inpainters/networks/test_contract.py",
        ("tanh networks give 0..1", '"tanh": (-1.0, 1.0)', '"tanh": (0.0, 1.0)'),
        ("out_range None is 0..1", "self.out_range or self.in_range", "self.out_range or (0.0, 1.0)"),
    ),
    *faults(
        "inpainters/layered/depth/out_of_view.py",
        "tests/inpainters/layered/depth/test_out_of_view.py",
        ("planes are never followed", "there = (length[k - 2] > 0) & ~ends", "there = np.zeros_like(ends)"),
        ("a line that looks past a wall costs nothing", "np.log1p(farther), PAST * ends)", "np.log1p(farther), 0)"),
        ("what hangs in the air goes on", "past | (closed & (length > 0))", "past"),
    ),
    *faults(
        "inpainters/layered/kernels/lines.py",
        "tests/inpainters/layered/depth/test_out_of_view.py",
        ("what stands before a plane ends it", "if known > SAME * value:", "if known > 1e9 * value:"),
    ),
    *faults(
        "inpainters/layered/color/low_frequency.py",
        "tests/inpainters/layered/color/test_low_frequency.py",
        ("surfaces are blended with each other", "own = number == surface", "own = number > -9"),
    ),
    *faults(
        "inpainters/layered/depth/surface_labels.py",
        "tests/inpainters/layered/depth/test_surface_labels.py",
        ("the order of surfaces costs nothing", "ORDER_COST = 3.0", "ORDER_COST = 0.0"),
        ("sky seen by the source only is not continued", "(number == 1 and law.has_far)", "False"),
        (
            "the way to the source's sky is not measured",
            "if law.has_far:\n            angle",
            "if False:\n            angle",
        ),
    ),
    *faults(
        "inpainters/layered/filler.py",
        "tests/inpainters/layered/test_layered.py",
        ("the sky's colour is not handed on", "sky=law.sky", "sky=None"),
    ),
    *faults(
        "inpainters/networks/migan.py",
        "tests/inpainters/networks/test_engine.py",
        ("MI-GAN's level 0 is sky indoors", "if not view.far.any():", "if False:"),
    ),
    *faults(
        "evaluation/metrics/lpips.py",
        "tests/evaluation/metrics/test_lpips.py",
        ("LPIPS of a region sees what lies outside", "np.where(inside, mine, truth)", "mine"),
        (
            "LPIPS' map half a cell off",
            "(np.arange(new_size) + 0.5) * (size / new_size) - 0.5",
            "np.arange(new_size) * (size / new_size)",
        ),
    ),
    *faults(
        "evaluation/protocols/methods.py",
        "tests/evaluation/protocols/test_ori.py tests/evaluation/protocols/test_vpi.py",
        ("ORI's ring is 8 px", "ring_px: int = 16", "ring_px: int = 8"),
        ("seen within 20 %", "seen_tolerance: float = 0.02", "seen_tolerance: float = 0.2"),
    ),
    *faults(
        "evaluation/metrics/regions.py",
        "tests/evaluation/metrics/test_regions.py tests/evaluation/protocols/test_ori.py",
        ("ORI counts the ring as outside", '"outside": ~grown', '"outside": ~mask'),
    ),
    *faults(
        "training/loop/checkpointing.py",
        "tests/training/loop/test_resume.py::test_a_checkpoint_that_would_run_code_is_refused",
        ("checkpoints run pickled code", "weights_only=True)\n    except", "weights_only=False)\n    except"),
    ),
    *faults(
        "training/losses/trunks.py",
        "tests/training/losses/test_losses.py",
        ("trunks run pickled code", "weights_only=True", "weights_only=False"),
    ),
    *faults(
        "nets/torch_pickle.py",
        "tests/nets/test_torch_file.py",
        (
            "weight files run pickled code",
            'self.unresolved[called] = type("Inert", (Inert,), {})',
            "self.unresolved[called] = super().find_class(module, name)",
        ),
    ),
    *faults(
        "training/losses/terms.py",
        "tests/training/losses/test_losses.py",
        ("R1 has no weight", "strength * adversarial.gradient_penalty", "adversarial.gradient_penalty"),
    ),
    *faults(
        "training/loop/module.py",
        "tests/training/loop/test_module.py",
        ("R1 every n-th step is not n times as strong", "gradient_penalty * every if", "gradient_penalty if"),
        ("R1 in every step", "if self.step % every == 0 else 0.0", ""),
        ("the guard's state goes on learning", "return copy.deepcopy(dict(state))", "return dict(state)"),
        ("the guard forgets the optimisers", "optimiser.load_state_dict(_copy_state(state))", "pass"),
    ),
    *faults(
        "training/loop/module.py",
        "tests/training/loop/test_loop.py::test_a_bad_batch_does_not_kill_the_run",
        (
            "the guard keeps its first state for ever",
            "elif self.step % self.settings.loop.guard_every == 0:\n            self.guard.keep(self)",
            "elif False:\n            pass",
        ),
    ),
    *faults(
        "training/data/masks.py",
        "tests/training/data/test_random_masks.py",
        ("masks of any area", "SMALLEST, LARGEST = 0.005, 0.7", "SMALLEST, LARGEST = 0.0, 1.0"),
        ("wide masks are narrower", "(0.04, 0.8), (0.02, 0.4), (1, 3)", "(0.04, 0.8), (0.02, 0.3), (1, 3)"),
    ),
    *faults(
        "inpainters/patchmatch/kernels.py",
        "tests/inpainters/patchmatch/test_patchmatch_kernels.py",
        ("distance costs nothing", "weights[0] * down * down", "0.0 * down * down"),
        ("patches are not handed on", "int(now[neighbour, 0]) - down", "int(now[neighbour, 0])"),
        ("trust in a target is dropped", "* np.float64(trust[t])", "* 1.0"),
    ),
    *faults(
        "inpainters/missing_depth/along_colors.py",
        "tests/inpainters/missing_depth",
        ("planes are not continued", "np.where(plausible, on_plane + residual * fading, own)", "own"),
        ("nothing is relaxed from no plane", "for _ in range(SWEEPS)", "for _ in range(0)"),
        ("the sky is relaxed, too", "relax_depth(out, reached & (labels == SMOOTH)", "relax_depth(out, reached"),
    ),
    *faults(
        "geometry/kernels/along_colors.py",
        "tests/inpainters/missing_depth tests/geometry/drawing/test_picture_edges.py",
        ("the known pixel's own colour is not asked", "+ min(own / (step * step), dearest)", ""),
        ("what was measured does not count", "longer += contrary", "longer += 0.0"),
    ),
    *faults(
        "geometry/drawing/picture_edges.py",
        "tests/geometry/drawing/test_picture_edges.py",
        ("no edge is moved beyond the reach", "WIDER = 3", "WIDER = 0"),
    ),
    *faults(
        "inpainters/__init__.py",
        "tests/inpainters/patchmatch/test_patchmatch.py",
        (
            "auto is one filler for all depth",
            "return ESTIMATED if estimated else CAMERA if misplaced or removed else EXACT",
            "return EXACT",
        ),
        (
            "a depth camera's frame is filled as exact depth",
            "else CAMERA if misplaced or removed else EXACT",
            "else EXACT",
        ),
    ),
    *faults(
        "inpainters/patchmatch/kernels.py",
        "tests/inpainters/patchmatch/test_patchmatch.py",
        (
            "patches of another surface cost the same",
            "weights[1] * across * across + weights[2] * again + other",
            "weights[1] * across * across + weights[2] * again",
        ),
    ),
    *faults(
        "inpainters/patchmatch/over_layers.py",
        "tests/inpainters/patchmatch/test_patchmatch.py",
        ("cracks are painted anew", "REPAINTED if law", "tuple(HoleType) if law"),
    ),
    *faults(
        "completion/stereo/pair.py",
        PAIR,
        ("stereo has no far limit", "np.where(depth >= far, np.float32(np.inf), depth)", "depth"),
        ("depth forgets doffs", "baseline_m=rig.baseline_m, doffs=rig.doffs)", "baseline_m=rig.baseline_m)"),
        ("bleeding is measured from disparity 0", "as_near = disparity + doffs >=", "as_near = disparity >="),
        ("the left mask is not carried over", "transfer_mask(mask, left_disparity) if", "mask if"),
        ("the right mask is not used", "if mask_right is None else check_mask", "if True else check_mask"),
    ),
    *faults(
        "completion/stereo/stereo.py",
        PAIR,
        ("the matcher has no range", "max_disparity=max_disparity)", "max_disparity=None)"),
    ),
    *faults(
        "completion/stereo/stereo.py",
        "tests/completion/stereo/test_both_eyes.py",
        (
            "the scene lacks the right picture's own pixels",
            "scene = add_seen_alone(scene, other, law, recipe.mode)",
            "pass",
        ),
    ),
    *faults(
        "files/fields.py",
        "tests/files/test_cameras.py",
        ("a field of a JSON may stand twice", "if len(found) < len(pairs):", "if False:"),
        ("a field of a calib.txt may stand twice", "if len(dict(pairs)) < len(pairs):", "if False:"),
    ),
    *faults(
        "files/cameras.py",
        "tests/files/test_cameras.py",
        ("any baseline is taken", "if not BASELINES_M[0] <= baseline <= BASELINES_M[1]:", "if baseline <= 0:"),
        ("a baseline in metres is taken for millimetres", "baseline < SHORTEST_M:", "baseline < 0:"),
        ("a baseline in millimetres is taken for metres", "baseline > LONGEST_M:", "baseline > 1e9:"),
    ),
    *faults(
        "files/rasters/images.py",
        "tests/files/test_pictures.py tests/files/test_orientation.py",
        ("checksums are not looked at", "                _check_sums(file, data)", "                pass"),
    ),
    *faults(
        "files/rasters/turned_pairs.py",
        "tests/files/test_orientation.py",
        ("a turn of one of two pictures is not seen", "if turned[0] == turned[1]:", "if True:"),
    ),
    *faults(
        "apps/terminal/streams.py",
        "tests/apps/test_bad_input.py",
        ("marks of direction are printed", '("Cc", "Cf", "Zl", "Zp")', '("Cc",)'),
        ("control characters are printed", '("Cc", "Cf", "Zl", "Zp")', '("Cf", "Zl", "Zp")'),
    ),
    *faults(
        "completion/options.py",
        "tests/completion/test_options.py",
        ("only the first wrong option is named", "for error in wrong)))", "for error in wrong[:1])))"),
        ("contradictions are found late", "_ = self.settings", "_ = self.recipe"),
        ("unknown options pass", "if name not in names:", "if not names:"),
    ),
    *faults(
        "jobs/early.py",
        "tests/apps/test_places.py",
        ("options of the library are not checked early", "lambda: options_of(options)", "lambda: None"),
        ("points are not held against the picture early", 'Prompt(hw, on, not_on, given.get("box"))', "pass"),
        ("a mask may be asked for where there is none", "and not removes:", "and False:"),
    ),
    *faults(
        "jobs/on_ray.py",
        "tests/jobs/test_on_ray.py",
        ("a cluster without nodes is waited for", "if time.monotonic() - lost_at >= BACK_SECONDS:", "if False:"),
        ("a node that comes back counts as lost", "                lost_at = None\n", ""),
    ),
    *faults(
        "jobs/manifest.py",
        "tests/jobs/test_batch.py",
        ("rows are ordered by the clock alone", "max(time.time_ns(), last + 1)", "time.time_ns()"),
    ),
    *faults(
        "models/download.py",
        "tests/models/test_pull.py",
        ("what is of no use is left", "if not (kept and _resumable_bytes(url, part)):", "if False:"),
        ("what could be gone on from is removed", "if not (kept and _resumable_bytes(url, part)):", "if True:"),
    ),
    *faults(
        "completion/stereo/disparities.py",
        PAIR,
        ("black pictures are matched", "if contrast(picture) < LEAST_CONTRAST:", "if False:"),
    ),
    *faults(
        "web/handler.py",
        "tests/web/test_server.py",
        ("a full disk breaks the connection", "except (ConnectionError, TimeoutError):", "except OSError:"),
    ),
    *faults(
        "perception/diagnosis/odd_frames.py",
        "tests/perception/diagnosis/test_odd_frames.py",
        ("two frames accuse each other", "if len(frames) < 3:", "if len(frames) < 2:"),
        ("all frames may be odd", "return odd if 2 * len(odd) < len(frames) else []", "return odd"),
        (
            "one neighbour decides",
            "return float(np.sort(values)[(len(values) - 1) // 2])",
            "return float(np.max(values))",
        ),
        (
            "all neighbours must agree",
            "return float(np.sort(values)[(len(values) - 1) // 2])",
            "return float(np.min(values))",
        ),
        ("depth is multiplied the wrong way", "np.median(np.log(z / depth))", "np.median(np.log(depth / z))"),
        (
            "the focal length leaves points where they were",
            "frame.points * (depth / focal, depth / focal, depth)",
            "frame.points * depth",
        ),
        ("too small is called too large", "'small' if factor > 1 else 'large'", "'large' if factor > 1 else 'small'"),
        ("too short is called too long", "'short' if factor > 1 else 'long'", "'long' if factor > 1 else 'short'"),
        ("one neighbour shows a curve", "away = min(max(each", "away = max(max(each"),
        ("exposure counts as a curve", "np.log(each + 2), (85, 15)", "each + 2, (85, 15)"),
        (
            "a curve is undone the wrong way",
            "undo = 2.2 if exponent < 1 else 1 / 2.2",
            "undo = 2.2 if exponent > 1 else 1 / 2.2",
        ),
        ("farthest frames are neighbours", 'np.argsort(row, kind="stable")', 'np.argsort(-row, kind="stable")'),
        ("factors near one are named", "LEAST_CHANGE = 1.1", "LEAST_CHANGE = 1.0"),
        (
            "frames that fit well are tried no more",
            "np.maximum(as_read, 0.01)) < LEAST_LEAD:  #",
            "np.maximum(as_read, 0.01)) < 100:  #",
        ),
    ),
    *faults(
        "perception/diagnosis/landing.py",
        "tests/perception/diagnosis/test_odd_frames.py tests/perception/diagnosis/test_pairs_and_poses.py",
        (
            "far depth counts as known",
            "known = inside & (depth > 0) & np.isfinite(depth)",
            "known = inside & (depth > 0)",
        ),
        (
            "colours do not count",
            "return self.share * max(float(np.corrcoef(self.first, self.second)[0, 1]), 0.0)",
            "return self.share",
        ),
        ("any depth is landed on", "lands = np.abs(depth - z) < LANDS_WITHIN * z", "lands = z > 0"),
        ("the small picture has the whole one's lens", ".resized(w, h)\n", "\n"),
    ),
    *faults(
        "geometry/projection.py",
        "tests/geometry/test_projection.py",
        ("points left of the picture land", "(pixels >= 0).all(1) & (pixels <", "(pixels >= -9).all(1) & (pixels <"),
    ),
    *faults(
        "datasets/dataset_diagnosis.py",
        "tests/perception/diagnosis/test_odd_frames.py tests/perception/diagnosis/test_pairs_and_poses.py",
        ("one cause is told twice", 'if not (odd_scale and each.check == "depth-scale")', ""),
        (
            "notes stand beside the odd frame",
            "find_odd_frames(list(small.values()), list(small)) or found",
            "[*find_odd_frames(list(small.values()), list(small)), *found]",
        ),
        (
            "poses of another convention make frames odd",
            'if all(each.severity != "fault" for each in found):',
            "if True:",
        ),
        ("frames in a row alone are compared", "(*spread_frames(frames), *chosen)", "chosen"),
    ),
    *faults(
        "geometry/trajectories.py",
        "tests/completion/test_whole_picture.py tests/geometry/test_trajectories.py",
        ("a whole turn is nearly none", "math.radians(math.remainder(degrees, 360))", "math.radians(degrees)"),
        ("half a turn is none", "math.remainder(degrees, 360)", "math.remainder(degrees, 180)"),
    ),
    *faults(
        "files/results/completion.py",
        "tests/apps/test_wrong_words.py",
        (
            "one unknown name of several is told",
            "unknown = [repr(name) for name in names if name not in known]",
            "unknown = [repr(name) for name in names if name not in known][:1]",
        ),
    ),
    *faults(
        "completion/options.py",
        "tests/completion/test_options.py",
        ("only the first wrong option is named", "for error in wrong)))", "for error in wrong[:1])))"),
        ("contradictions are found late", "_ = self.settings", "_ = self.recipe"),
        ("unknown options pass", "if name not in names:", "if not names:"),
    ),
    *faults(
        "jobs/early.py",
        "tests/apps/test_wrong_words.py",
        ("the pitch is not looked at", 'for name in ("yaw", "pitch", "dolly")),', 'for name in ("yaw", "dolly")),'),
    ),
    *faults(
        "jobs/batch.py",
        "tests/apps/test_wrong_words.py",
        ("one wrong count of several is told", 'raise InputError("; ".join(wrong))', "raise InputError(wrong[0])"),
    ),
    *faults(
        "models/network_file.py",
        "tests/models/test_network_file.py",
        ("an empty network file is opened", "if stat.st_size == 0:", "if False:"),
    ),
)
"""All of them."""
