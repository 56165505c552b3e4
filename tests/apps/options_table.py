"""The table of test_options_reach.py: for every option of every verb the words, and the keyword and value they must become."""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Reach:
    """Words of the command line, and what must arrive where."""

    words: str
    """As they are typed, separated by blanks."""
    where: str
    """function.keyword; several functions joined by +."""
    value: Any
    """What must arrive; or a function of what arrived."""
    drop: tuple[str, ...] = ()
    """Words of the verb's base that would contradict them."""

    def command(self, base: str) -> list[str]:
        """The command's words with this option."""
        kept = base
        for words in self.drop:
            kept = kept.replace(words, " ")
        return [*kept.split(), *self.words.split()]

    def arrived(self, calls: dict[str, list[dict[str, Any]]]) -> list[Any]:
        """The keyword of every call; a function that was never called gives None."""
        functions, _, keyword = self.where.rpartition(".")
        found: list[Any] = []
        for function in functions.split("+"):
            found += [call[keyword] for call in calls.get(function, [{keyword: None}])]
        return found

    def fits(self, arrived: Any) -> bool:
        """Whether that is the value wanted; a path may come as text."""
        if isinstance(self.value, Path) and isinstance(arrived, str):
            return self.value == Path(arrived)
        return bool(self.value(arrived)) if callable(self.value) else bool(arrived == self.value)


def fields_of(taker: Callable[..., Any]) -> Iterator[tuple[str, Any, Any]]:
    """Name, type hint with its notes, and default of each option of a verb, those of its dataclasses too."""
    hints = typing.get_type_hints(taker, include_extras=True)
    for name, parameter in inspect.signature(taker).parameters.items():
        if dataclasses.is_dataclass(hints[name]):
            yield from fields_of(hints[name])
        elif name != "task":
            yield name, hints[name], parameter.default


def attribute(path: str, value: Any) -> Callable[[Any], bool]:
    """True of an object whose attribute (a.b.c) is `value`."""

    def fits(thing: Any) -> bool:
        for name in path.split("."):
            thing = getattr(thing, name, None)
        return bool(thing == value)

    return fits


def each(path: str, values: Iterable[Any]) -> Callable[[Any], bool]:
    """True of things whose attribute is, one after the other, one of `values`, all of them present."""

    def fits(things: Any) -> bool:
        return things is not None and {getattr(thing, path) for thing in things} == set(values)

    return fits


BASE = {
    "view": "image.png depth.png -o out --fov 60 --yaw 5",
    "remove": "image.png depth.png mask.png -o out --fov 60",
    "mask": "image.png depth.png --click 9,9 -o mask.png --fov 60",
    "stereo": "left.png right.png --calib calib.txt -o out --mask mask.png",
    "depth": "image.png -o out --fov 60",
    "batch": "jobs.csv -o out",
    "demo": "",
    "sequence": "room -o out",
    "video": "scene.npz -o out.gif",
    "photo3d": "image.png depth.png -o out --fov 60",
    "doctor": "image.png depth.png mask.png --fov 60",
    "show": "out",
    "version": "",
    "warm-up": "",
    "serve": "",
    "evaluate": "toy -o out",
    "worlds": "",
    "train": "tiny -o out",
    "models list": "",
    "models info": "mobile-sam-decoder",
    "models pull": "mobile-sam-decoder",
    "models convert": "a.ckpt -o a.onnx",
    "models verify": "",
}
"""The least words that each command runs with."""

REPORT = {
    "quiet": Reach("--quiet", "report_result.report", attribute("quiet", True)),
    "json": Reach("--json", "report_result.report", attribute("json", True)),
}


POINTING = {
    "click": Reach("--click 1,2 3,4.5", "find_mask.clicks", [[1, 2], [3, 4.5]]),
    "not_click": Reach("--not 1,2", "find_mask.not_clicks", [[1, 2]]),
    "box": Reach("--box 1,2,3,4", "find_mask.box", [1, 2, 3, 4]),
    "candidate": Reach("--click 1,2 --candidate part", "find_mask.candidate", "part"),
    "salient": Reach("--salient", "find_mask.masker", "salient"),
    "masker": Reach("--click 1,2 --masker segment-anything", "find_mask.masker", "segment-anything"),
    "mask_model": Reach(
        "--click 1,2 --masker segment-anything --mask-model mobile-sam", "find_mask.mask_model", "mobile-sam"
    ),
    "object_class": Reach("--class barrel", "read_mask.mask_class", "barrel"),
    "with_shadow": Reach("--click 1,2 --with-shadow", "find_mask.with_shadow", True),
}


def pointed(instead_of: str) -> dict[str, Reach]:
    """The same options in place of a mask file, or of another way to point."""
    return {name: dataclasses.replace(reach, drop=(instead_of,)) for name, reach in POINTING.items()}


def move(verb: str) -> dict[str, Reach]:
    """Where the new camera stands."""
    return {
        "yaw": Reach("--yaw 7", f"{verb}.yaw", 7.0, ("--yaw 5",)),
        "pitch": Reach("--pitch 7", f"{verb}.pitch", 7.0),
        "pivot": Reach("--pivot 3", f"{verb}.pivot", 3.0),
        "dolly": Reach("--dolly -0.5", f"{verb}.dolly", -0.5),
        "to": Reach("--to target.json", f"{verb}.camera", "target", ("--yaw 5",)),
    }


LENS = {
    "camera": Reach("--camera cam.json", "camera_for.camera", Path("cam.json"), ("--fov 60",)),
    "fx": Reach("--fx 50", "camera_for.fx", 50.0, ("--fov 60",)),
    "fy": Reach("--fy 50", "camera_for.fy", 50.0),
    "cx": Reach("--cx 30", "camera_for.cx", 30.0),
    "cy": Reach("--cy 20", "camera_for.cy", 20.0),
    "fov": Reach("--fov 70", "camera_for.fov", 70.0, ("--fov 60",)),
    "pixel_center": Reach("--pixel-center 0.0", "camera_for.pixel_center", 0.0),
}
READING = {
    "depth_scale": Reach("--depth-scale 5000", "read_rgbd.depth_scale", 5000.0),
    "depth_range": Reach("--depth-range 10", "read_rgbd.depth_range", 10.0),
    "channel": Reach("--channel Z", "read_rgbd.channel", "Z"),
    "far": Reach("--far 30", "read_rgbd.far", 30.0),
    "resize_depth": Reach("--resize-depth nearest", "read_rgbd.resize_depth", "nearest"),
}
ESTIMATING = {
    "depth_model": Reach("--depth-model midas", "read_rgbd.depth_model", "midas"),
    "metres_at": Reach("--metres-at 3,4=2 5,6=7", "read_rgbd.metres_at", ((3.0, 4.0, 2.0), (5.0, 6.0, 7.0))),
    "camera_height": Reach("--camera-height 1.6", "read_rgbd.camera_height", 1.6),
    "sharpen": Reach("--no-sharpen", "read_rgbd.sharpen", False),
}
MASKING = {
    "mask_polarity": Reach("--mask-polarity known", "read_mask.mask_polarity", "known"),
    "soft_mask": Reach("--soft-mask", "read_mask.soft_mask", True),
    "mask_class": Reach("--mask-class barrel", "read_mask.mask_class", "barrel"),
}


def method(verbs: str) -> dict[str, Reach]:
    """How the scene is completed."""
    return {
        "filler": Reach("--filler telea", f"{verbs}.filler", "telea"),
        "model": Reach("--model m.onnx", f"{verbs}.model", Path("cache/m.onnx")),
        "recipe": Reach("--recipe paper", f"{verbs}.recipe", "paper"),
        "mode": Reach("--mode points", f"{verbs}.mode", "points"),
        "dilate": Reach("--dilate 5", f"{verbs}.dilate", 5),
        "dilate_holes": Reach("--dilate-holes 2", f"{verbs}.dilate_holes", 2),
        "clip": Reach("--clip 8", f"{verbs}.clip", 8.0),
        "depth_by": Reach("--depth-by filler", f"{verbs}.depth_by", "filler"),
        "seed": Reach("--seed 9", f"{verbs}.seed", 9),
        "min_confidence": Reach("--min-confidence 0.5", f"{verbs}.min_confidence", 0.5),
    }


OUTPUT = Reach("-o elsewhere", "write.directory", Path("elsewhere"), ("-o out",))
FILES_WRITTEN = {
    "only": Reach("--only image,depth", "write.only", ("image", "depth")),
    "also": Reach("--also scene,points", "write.also", ("scene", "points")),
}


def instead(words: str, where: str, value: Any, old: str) -> Reach:
    """A positional argument: another word in the place of `old`."""
    return Reach(words, where, value, (old,))


PICTURE = {
    "image": instead("a.png depth.png", "read_rgbd.image", Path("a.png"), "image.png depth.png"),
    "depth": instead("image.png b.png", "read_rgbd.depth", Path("b.png"), "image.png depth.png"),
}
THREE = "image.png depth.png mask.png"
REMOVED = {
    "image": instead("a.png depth.png mask.png", "read_rgbd.image", Path("a.png"), THREE),
    "depth_and_mask": instead("image.png b.png mask.png", "read_rgbd.depth", Path("b.png"), THREE),
}
PAIR = {
    "left": instead("a.png right.png", "stereo.left", attribute("name", "a.png"), "left.png right.png"),
    "right": instead("left.png b.png", "stereo.right", attribute("name", "b.png"), "left.png right.png"),
    "calib": Reach("--calib c.json", "read_stereo_calib.path", Path("c.json"), ("--calib calib.txt",)),
    "mask": Reach("--mask m.png", "stereo.mask", "m.png", ("--mask mask.png",)),
    "mask_right": Reach("--mask-right r.png", "stereo.mask_right", "r.png"),
    "max_disparity": Reach("--max-disparity 40", "stereo.max_disparity", 40.0),
    "far": Reach("--far 30", "stereo.far", 30.0),
    "disparity": Reach("--disparity d.pfm", "stereo.disparity", "d.pfm"),
    "disparity_scale": Reach("--disparity d.png --disparity-scale 4", "read_disparity.scale", 4.0),
    "matcher": Reach("--matcher net.onnx", "stereo.matcher", Path("net.onnx")),
    "right_view": Reach("--right-view given", "stereo.right_view", "given"),
}
EVALUATE = {
    "dataset": instead("other", "open_dataset_or_worlds.path", "other", "toy"),
    "output": Reach("-o elsewhere", "run.folder", Path("elsewhere"), ("-o out",)),
    "protocol": Reach("--protocol ori", "run.cases", each("protocol", ["ori"])),
    "scenes": Reach("--scenes room", "open_dataset_or_worlds.scenes", ("room",)),
    "yaws": Reach("--yaws 20", "run.cases", each("yaw", [20.0, None])),
    "limit": Reach("--limit 1", "run.cases", each("yaw", [10.0, None])),
    "layout": Reach("--layout tum", "open_dataset_or_worlds.layout", "tum"),
    "depth_range": Reach("--depth-range 10", "open_dataset_or_worlds.depth_range", 10.0),
    "gamma": Reach("--gamma linear", "open_dataset_or_worlds.gamma", "linear"),
    "removal_object": Reach("--removal-object barrel", "open_dataset_or_worlds.removal_object", "barrel"),
    "camera": Reach("--camera cam.json", "open_dataset_or_worlds.camera", Path("cam.json")),
    "recipes": Reach("--recipes paper", "run.methods", each("recipe", ["paper"])),
    "fillers": Reach("--fillers telea", "run.methods", each("filler", ["telea"])),
    "model": Reach("--model migan=m.onnx --fillers migan", "run.methods", each("model", [Path("cache/m.onnx")])),
    "seed": Reach("--seed 9", "run.methods", each("seed", [9])),
    "variants": Reach("--no-variants", "run.settings", attribute("matched_stereo", False)),
    "jobs": Reach("--jobs 2", "run.jobs", 2),
}
SEQUENCE = {
    "dataset": instead("other", "sequence.dataset", Path("other"), "room"),
    "output": Reach("-o elsewhere", "sequence.output", Path("elsewhere"), ("-o out",)),
    "mask": Reach("--mask 3=a.png", "mask_files.named", ("3=a.png",)),
    "masks": Reach("--masks folder", "mask_files.folder", Path("folder")),
    "views": Reach("--views orbit", "sequence.views", "orbit"),
    "only": Reach("--only scene,video", "sequence.only", ("scene", "video")),
    "also": Reach("--also scene", "sequence.also", ("scene",)),
    "align": Reach("--align", "sequence.align", True),
    "frames": Reach("--frames 0:9:3", "sequence.frames", "0:9:3"),
    "layout": Reach("--layout tum", "sequence.layout", "tum"),
    "scene": Reach("--scene kitchen", "sequence.scene", "kitchen"),
    "camera": Reach("--camera cam.json", "sequence.camera", Path("cam.json")),
    "depth_range": Reach("--depth-range 10", "sequence.depth_range", 10.0),
    "filler": Reach("--filler telea", "sequence.filler", "telea"),
    "model": Reach("--model m.onnx", "sequence.model", Path("cache/m.onnx")),
    "recipe": Reach("--recipe paper", "sequence.recipe", "paper"),
    "dilate": Reach("--dilate 5", "sequence.dilate", 5),
    "seed": Reach("--seed 9", "sequence.seed", 9),
    "min_confidence": Reach("--min-confidence 0.5", "sequence.min_confidence", 0.5),
}
VIDEO = {
    "source": instead("other", "read_scene_of.dataset", Path("other"), "scene.npz"),
    "output": Reach("-o b.gif", "write_video.path", Path("b.gif"), ("-o out.gif",)),
    "path": Reach("--path orbit", "path_for.path", "orbit"),
    "seconds": Reach("--seconds 2", "path_for.seconds", 2.0),
    "fps": Reach("--fps 10", "write_video.fps", 10.0),
    "width": Reach("--width 320", "path_for.width", 320),
    "frames": Reach("--frames 0:9:3", "read_scene_of.which", "0:9:3"),
    "layout": Reach("--layout tum", "read_scene_of.layout", "tum"),
    "scene": Reach("--scene kitchen", "read_scene_of.scene", "kitchen"),
    "camera": Reach("--camera cam.json", "read_scene_of.camera", Path("cam.json")),
    "align": Reach("--align", "read_scene_of.align", True),
    "depth_range": Reach("--depth-range 10", "read_scene_of.depth_range", 10.0),
    "filler": Reach("--filler telea", "render_path.filler", "telea"),
    "model": Reach("--model m.onnx", "render_path.model", Path("cache/m.onnx")),
    "seed": Reach("--seed 9", "render_path.seed", 9),
}
WORLDS = {
    "output": Reach("-o elsewhere", "write_worlds.folder", Path("elsewhere")),
    "count": Reach("--count 2", "write_worlds.count", 2),
    "seed": Reach("--seed 9", "write_worlds.seed", 9),
    "size": Reach("--size 64", "write_worlds.size", 64),
    "kind": Reach("--kind room", "write_worlds.kind", "room"),
    "textures": Reach("--textures photos", "write_worlds.textures", Path("photos")),
}
TRAIN = {
    "settings": instead("small-rgbd", "train.settings", attribute("name", "small-rgbd"), "tiny"),
    "output": Reach("-o elsewhere", "train.run", Path("elsewhere"), ("-o out",)),
    "data": Reach("--data a b", "train.data", (Path("a"), Path("b"))),
    "max_minutes": Reach("--max-minutes 2", "train.max_minutes", 2.0),
    "resume": Reach("--resume", "train.resume", True),
    "start": Reach("--start a.ckpt", "train.settings", attribute("network.start", "a.ckpt")),
    "trunk": Reach("--trunk t.pth", "train.settings", attribute("loss.trunk_weights", "t.pth")),
    "steps": Reach("--steps 3", "train.settings", attribute("loop.steps", 3)),
    "batch": Reach("--batch 7", "train.settings", attribute("loop.batch", 7)),
    "precision": Reach("--precision bf16", "train.settings", attribute("loop.precision", "bf16")),
    "devices": Reach("--devices 2", "train.settings", attribute("loop.devices", 2)),
}
SHOW = {
    "what": instead("scene.npz", "points_in.path", Path("scene.npz"), "out"),
    "output": Reach("-o page.html", "show_page.output", Path("page.html")),
    "max_points": Reach("--max-points 7", "point_viewer.most", 7),
    "open_browser": Reach("--no-open-browser", "show_page.open_browser", False),
}
DOCTOR = {
    **{
        name: dataclasses.replace(reach, where=f"diagnose.{name}")
        for name, reach in {**LENS, **READING, **MASKING}.items()
    },
    "first": instead("a.png depth.png mask.png", "diagnose.first", Path("a.png"), THREE),
    "second": instead("image.png b.png mask.png", "diagnose.second", Path("b.png"), THREE),
    "mask": instead("image.png depth.png c.png", "diagnose.mask", Path("c.png"), THREE),
    "calib": Reach("--calib c.json", "diagnose.calib", Path("c.json")),
    "layout": Reach("--layout tum", "diagnose.layout", "tum"),
}
OF_JOBS = {**move("batch"), **LENS, **READING, **ESTIMATING, **MASKING, **POINTING, **method("batch")}
"""Options that hold for every job of a list."""
AS_TYPED = {
    "to": Path("target.json"),
    "metres_at": ("3,4=2", "5,6=7"),
    "click": ("1,2", "3,4.5"),
    "not_click": ("1,2",),
    "box": "1,2,3,4",
    "salient": True,
}
"""Those that go to the jobs as they are typed."""


def default(words: str, name: str, value: Any) -> Reach:
    """An option that arrives among the defaults of the jobs."""
    return Reach(words, "batch.defaults", lambda given: given is not None and given.get(name) == value)


BATCH = {
    **{name: default(reach.words, name, AS_TYPED.get(name, reach.value)) for name, reach in OF_JOBS.items()},
    "only": default("--only image,depth", "only", "image,depth"),
    "also": default("--also scene", "also", "scene"),
    "calib": default("--calib c.json", "calib", Path("c.json")),
    "right_view": default("--right-view given", "right_view", "given"),
    "disparity_scale": default("--disparity-scale 4", "disparity_scale", 4.0),
    "matcher": default("--matcher net.onnx", "matcher", Path("net.onnx")),
    "max_disparity": default("--max-disparity 40", "max_disparity", 40.0),
    "words": instead("other.csv", "batch.jobs", "other.csv", "jobs.csv"),
    "output": Reach("-o elsewhere", "batch.out", Path("elsewhere"), ("-o out",)),
    "images": Reach("--images x/*.png --verb depth", "batch.jobs", attribute("images", "x/*.png"), ("jobs.csv",)),
    "depths": Reach(
        "--images x --depths y/{stem}.png --verb view", "batch.jobs", attribute("depths", "y/{stem}.png"), ("jobs.csv",)
    ),
    "masks": Reach(
        "--images x --masks z/{stem}.png --verb remove", "batch.jobs", attribute("masks", "z/{stem}.png"), ("jobs.csv",)
    ),
    "verb": Reach("--verb view", "batch.verb", "view"),
    "workers": Reach("--workers 2", "batch.workers", 2),
    "threads": Reach("--threads 2", "batch.threads", 2),
    "resume": Reach("--no-resume", "batch.resume", False),
    "stop_after_failures": Reach("--stop-after-failures 3", "batch.stop_after_failures", 3),
    "pack": Reach("--pack 100", "batch.pack", 100),
    "data": Reach("--data room", "batch.jobs", attribute("root", Path("room")), ("jobs.csv",)),
    "layout": Reach("--data room --layout tum", "batch.jobs", attribute("layout", "tum"), ("jobs.csv",)),
    "ray": Reach("--ray auto", "batch.ray", "auto"),
    "gpus_per_worker": Reach("--gpus-per-worker 0.25", "batch.gpus_per_worker", 0.25),
    "dry_run": Reach("--dry-run --verb view", "plan_lines.verb", "view"),
}
SERVE = {
    "host": Reach("--host 127.0.0.2", "open_server.host", "127.0.0.2"),
    "port": Reach("--port 8000", "open_server.port", 8000),
    "token": Reach("--token secret", "open_server.token", "secret"),
    "max_megabytes": Reach("--max-megabytes 3", "open_server.limits", attribute("megabytes", 3)),
    "max_megapixels": Reach("--max-megapixels 2.5", "open_server.limits", attribute("megapixels", 2.5)),
    "max_pages": Reach("--max-pages 2", "open_server.limits", attribute("visits", 2)),
}
NAME = instead("big-lama", "record.name", "big-lama", "mobile-sam-decoder")
CONVERT = {
    "weights": instead("b.ckpt -o a.onnx", "convert.source", Path("b.ckpt"), "a.ckpt -o a.onnx"),
    "output": Reach("-o b.onnx", "convert.target", Path("b.onnx"), ("-o a.onnx",)),
    "licence": Reach("--licence MIT", "convert.licence", "MIT"),
}
TABLE: dict[str, dict[str, Reach]] = {
    "view": {
        **PICTURE, **move("view"), **LENS, **READING, **ESTIMATING, **method("view"), **REPORT, "output": OUTPUT, **FILES_WRITTEN,
    },
    "remove": {
        "mask": Reach("--mask m.png", "read_mask.path", Path("m.png"), ("mask.png",)),
        **REMOVED, **move("remove"), **LENS, **READING, **ESTIMATING, **MASKING, **pointed("mask.png"),
        **method("remove"), **REPORT, "output": OUTPUT, **FILES_WRITTEN,
    },
    "depth": {
        "image": instead("a.png", "read_rgbd.image", Path("a.png"), "image.png"), "far": READING["far"], **ESTIMATING, **REPORT,
        **{name: dataclasses.replace(row, where=row.where.replace("camera_for", "read_rgbd")) for name, row in LENS.items()},
        "output": Reach("-o elsewhere", "write_depth.directory", Path("elsewhere"), ("-o out",)),
    },
    "mask": {
        **PICTURE, **LENS, **READING, **ESTIMATING, **pointed("--click 9,9"), **REPORT,
        "output": Reach("-o found.png", "write_mask.output", Path("found.png"), ("-o mask.png",)),
    },
    "stereo": {**PAIR, **MASKING, **pointed("--mask mask.png"), **method("stereo"), **REPORT, "output": OUTPUT, **FILES_WRITTEN},
    "demo": {
        **method("view+remove+stereo"), **REPORT, **FILES_WRITTEN,
        "output": Reach("-o elsewhere", "write_contact_sheet.path", lambda path: "elsewhere" in Path(path).parent.name),
    },
    "sequence": {
        **SEQUENCE, **MASKING, **REPORT,
    },
    "batch": {**BATCH, **REPORT},
    "video": {**VIDEO, **REPORT},
    "photo3d": {
        **PICTURE, **LENS, **READING, **ESTIMATING, **REPORT,
        **{name: dataclasses.replace(row, where=row.where.replace("render_path", "photo3d")) for name, row in VIDEO.items()
           if name in ("filler", "model", "seed")},
        "angle": Reach("--angle 3", "photo3d.angle", 3.0),
        "distance": Reach("--distance 0.1", "photo3d.distance", 0.1),
        "output": Reach("-o elsewhere", "write_photo3d.directory", Path("elsewhere"), ("-o out",)),
        "only": Reach("--only mesh,splats", "write_photo3d.only", ("mesh", "splats")),
        "also": Reach("--also stereo", "write_photo3d.also", ("stereo",)),
    },
    "doctor": {**DOCTOR, **REPORT},
    "show": {**SHOW, **REPORT},
    "serve": {**SERVE, **REPORT},
    "version": {},
    "warm-up": REPORT,
    "evaluate": {**EVALUATE, **REPORT},
    "worlds": {**WORLDS, **REPORT},
    "train": {**TRAIN, **REPORT},
    "models list": REPORT,
    "models info": {"name": NAME, **REPORT},
    "models pull": {"name": NAME, **REPORT},
    "models convert": {**CONVERT, **REPORT},
    "models verify": {"name": Reach("mobile-sam-decoder", "record.name", "mobile-sam-decoder"), **REPORT},
}  # fmt: skip
"""Verb -> option -> what it reaches."""
