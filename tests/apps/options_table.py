"""The table of test_options_reach.py: for every option of every verb the words, and the keyword and value they must become.

Options of a group (Lens, Method ...) reach the keyword of their own name in the function that the group is for. A verb's own
options are written out.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dlama.apps import options as groups
from dlama.apps.cli import VERBS
from dlama.apps.terminal.flags import flags_of
from dlama.apps.verbs.batch import Running
from dlama.apps.verbs.measuring.options import Cases
from dlama.apps.verbs.networks import model_verbs
from dlama.apps.verbs.sequence import Source
from dlama.apps.verbs.video import Moving
from verb_options import fields_of, groups_in


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
        """Whether that is the value expected; a path may come as text."""
        if isinstance(self.value, Path) and isinstance(arrived, str):
            return self.value == Path(arrived)
        return bool(self.value(arrived)) if callable(self.value) else bool(arrived == self.value)


def attribute(path: str, value: Any) -> Callable[[Any], bool]:
    """True of an object whose attribute (a.b.c) is `value`."""

    def fits(item: Any) -> bool:
        for name in path.split("."):
            item = getattr(item, name, None)
        return bool(item == value)

    return fits


def each(path: str, values: Iterable[Any]) -> Callable[[Any], bool]:
    """True of objects whose attribute is, one after the other, one of `values`, all of them present."""

    def fits(things: Any) -> bool:
        return things is not None and {getattr(item, path) for item in things} == set(values)

    return fits


BASE = {
    "view": "image.png depth.png -o out --fov 60 --yaw 5",
    "remove": "image.png depth.png mask.png -o out --fov 60",
    "mask": "image.png depth.png --click 9,9 -o mask.png --fov 60",
    "stereo": "left.png right.png --calib calib.txt -o out --mask mask.png --yaw 5",
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
OF_KIND: dict[Any, tuple[str, Any]] = {
    float: ("7", 7.0), int: ("5", 5), str: ("other", "other"), Path: ("other.json", Path("other.json"))
}  # fmt: skip
"""What is typed for an option of a kind, and what that becomes."""
OF_OPTION: dict[str, tuple[str, Any]] = {
    "model": ("m.onnx", Path("cache/m.onnx")),
    "filler": ("telea", "telea"),
    "recipe": ("paper", "paper"),
    "min_confidence": ("0.5", 0.5),
    "pixel_center": ("0.0", 0.0),
    "to": ("target.json", "target"),
    "metres_at": ("3,4=2 5,6=7", ((3.0, 4.0, 2.0), (5.0, 6.0, 7.0))),
    "click": ("1,2 3,4.5", [[1, 2], [3, 4.5]]),
    "not_click": ("1,2", [[1, 2]]),
    "box": ("1,2,3,4", [1, 2, 3, 4]),
    "salient": ("", "salient"),
    "masker": ("segment-anything", "segment-anything"),
    "candidate": ("part", "part"),
    "only": ("image,depth", ("image", "depth")),
    "also": ("scene,points", ("scene", "points")),
}
"""The same of options with a form or with checks of their own."""
AS_TYPED = {
    "to": "target.json",
    "metres_at": ("3,4=2", "5,6=7"),
    "click": ("1,2", "3,4.5"),
    "not_click": ("1,2",),
    "box": "1,2,3,4",
    "salient": True,
    "only": "image,depth",
    "also": "scene,points",
}
"""What goes to the jobs of a list as it is typed."""
KEYWORDS = {"to": "camera", "click": "clicks", "not_click": "not_clicks", "salient": "masker"}
"""Options that reach a keyword of another name."""
TOGETHER = {
    "candidate": "--click 1,2",
    "masker": "--click 1,2",
    "mask_model": "--click 1,2 --masker segment-anything",
    "with_shadow": "--click 1,2",
}
"""Words without which an option has no meaning."""
LEFT_OUT = {"camera": "--fov 60", "fx": "--fov 60", "fov": "--fov 60", "yaw": "--yaw 5", "to": "--yaw 5"}
"""Words of the base that an option takes the place of."""
POINTED = {"remove": "mask.png", "stereo": "--mask mask.png", "mask": "--click 9,9"}
"""Words of the base that all options which point at an object take the place of."""
TAKERS = {
    groups.Lens: "camera_for",
    groups.Reading: "read_rgbd",
    groups.Estimating: "read_rgbd",
    groups.Masking: "read_mask",
    groups.Pointing: "find_mask",
    groups.Results: "write",
    Source: "read_scene_of",
    Cases: "open_dataset_or_worlds",
    Moving: "path_for",
}
"""Group -> the function that it is for; of the others it is the verb's own."""
OTHER_TAKERS = {
    ("doctor", groups.Lens): "diagnose",
    ("doctor", groups.Reading): "diagnose",
    ("doctor", groups.Masking): "diagnose",
    ("depth", groups.Lens): "read_rgbd",
    ("demo", groups.Method): "view+remove+stereo",
    ("stereo", groups.Move): "view",
    ("sequence", Source): "sequence",
    ("video", groups.Filler): "render_path",
}
"""The same of a group in one verb."""


def sample(name: str, hint: Any, default: Any) -> tuple[str, Any]:
    """What is typed for an option, and what that becomes: another value than its default."""
    if name in OF_OPTION:
        return OF_OPTION[name]
    if isinstance(default, bool):
        return "", not default
    kinds = [kind for part in typing.get_args(hint)[:1] for kind in typing.get_args(part) or (part,)]
    words = [word for kind in kinds for word in typing.get_args(kind) or (kind,) if isinstance(word, str)]
    if words and float not in kinds:
        return words[-1], words[-1]
    return next(OF_KIND[kind] for kind in kinds if kind in OF_KIND)


def rows_of_group(verb: str, group: Any) -> dict[str, Reach]:
    """Each option of a group of a verb: it reaches its keyword of the group's function; of a list of jobs, the defaults."""
    if group is groups.Report:
        return REPORT
    taker = OTHER_TAKERS.get((verb, group)) or TAKERS.get(group, verb)
    found, flags = {}, flags_of(group)
    for name, hint, default in fields_of(group):
        typed, value = sample(name, hint, default)
        words = f"{TOGETHER.get(name, '')} {flags[name]} {typed}"
        if verb == "batch" and group is not Running:
            found[name] = Reach(words, "batch.defaults", entry(name, AS_TYPED.get(name, value)))
            continue
        instead_of = POINTED.get(verb, "") if group is groups.Pointing else LEFT_OUT.get(name, "")
        where = "read_mask.mask_class" if name == "object_class" else f"{taker}.{KEYWORDS.get(name, name)}"
        found[name] = Reach(words, where, value, (instead_of,) if instead_of else ())
    return found


def entry(name: str, value: Any) -> Callable[[Any], bool]:
    """True of a dictionary with this entry."""
    return lambda given: given is not None and given.get(name) == value


def instead(words: str, where: str, value: Any, old: str) -> Reach:
    """A positional argument: another word in the place of `old`."""
    return Reach(words, where, value, (old,))


PICTURE = {
    "image": instead("a.png depth.png", "read_rgbd.image", Path("a.png"), "image.png depth.png"),
    "depth": instead("image.png b.png", "read_rgbd.depth", Path("b.png"), "image.png depth.png"),
}
THREE = "image.png depth.png mask.png"
REMOVED = {
    "mask": Reach("--mask m.png", "read_mask.path", Path("m.png"), ("mask.png",)),
    "image": instead("a.png depth.png mask.png", "read_rgbd.image", Path("a.png"), THREE),
    "depth_and_mask": instead("image.png b.png mask.png", "read_rgbd.depth", Path("b.png"), THREE),
}
PAIR = {
    "left": instead("a.png right.png", "stereo.left", attribute("name", "a.png"), "left.png right.png"),
    "right": instead("left.png b.png", "stereo.right", attribute("name", "b.png"), "left.png right.png"),
    "calib": Reach("--calib c.json", "read_stereo_calib.path", Path("c.json"), ("--calib calib.txt",)),
    "mask": Reach("--mask m.png", "stereo.mask", "m.png", ("--mask mask.png",)),
    "mask_right": Reach("--mask-right r.png", "stereo.mask_right", "r.png"),
    "far": Reach("--far 30", "stereo.far", 30.0),
    "disparity": Reach("--disparity d.pfm", "stereo.disparity", "d.pfm"),
    "disparity_scale": Reach("--disparity d.png --disparity-scale 4", "read_disparity.scale", 4.0),
}
EVALUATE = {
    "dataset": instead("other", "open_dataset_or_worlds.path", "other", "toy"),
    "output": Reach("-o elsewhere", "run.folder", Path("elsewhere"), ("-o out",)),
    "protocol": Reach("--protocol ori", "run.cases", each("protocol", ["ori"])),
    "scenes": Reach("--scenes room", "open_dataset_or_worlds.scenes", ("room",)),
    "yaws": Reach("--yaws 20", "run.cases", each("yaw", [20.0, None])),
    "limit": Reach("--limit 1", "run.cases", each("yaw", [10.0, None])),
    "recipes": Reach("--recipes paper", "run.methods", each("recipe", ["paper"])),
    "fillers": Reach("--fillers telea", "run.methods", each("filler", ["telea"])),
    "model": Reach("--model migan=m.onnx --fillers migan", "run.methods", each("model", [Path("cache/m.onnx")])),
    "seed": Reach("--seed 9", "run.methods", each("seed", [9])),
    "variants": Reach("--no-variants", "run.settings", attribute("matched_stereo", False)),
    "jobs": Reach("--jobs 2", "run.jobs", 2),
    "pictures": Reach("--pictures", "run.pictures", True),
}
SEQUENCE = {
    "dataset": instead("other", "sequence.dataset", Path("other"), "room"),
    "output": Reach("-o elsewhere", "write.output", Path("elsewhere"), ("-o out",)),
    "only": Reach("--only scene,points", "write.only", ("scene", "points")),
    "also": Reach("--also scene", "write.also", ("scene",)),
    "mask": Reach("--mask 3=a.png", "mask_files.named", ("3=a.png",)),
    "masks": Reach("--masks folder", "mask_files.folder", Path("folder")),
    "with_shadow": Reach("--mask 0=a.png --with-shadow", "sequence.with_shadow", True),
}
VIDEO = {
    "frames": Reach("--frames 0:9:3", "read_scene_of.frames", "0:9:3"),
    "source": instead("other", "read_scene_of.dataset", Path("other"), "scene.npz"),
    "output": Reach("-o b.gif", "write_video.path", Path("b.gif"), ("-o out.gif",)),
    "fps": Reach("--fps 10", "write_video.fps", 10.0),
}
TRAIN = {
    "settings": instead("small-rgbd", "train.settings", attribute("name", "small-rgbd"), "tiny"),
    "output": Reach("-o elsewhere", "train.run", Path("elsewhere"), ("-o out",)),
    "data": Reach("--data a b", "train.data", (Path("a"), Path("b"))),
    "max_minutes": Reach("--max-minutes 2", "train.max_minutes", 2.0),
    "resume": Reach("--resume", "train.resume", True),
    "start": Reach("--start a.ckpt", "train.settings", attribute("network.start", "a.ckpt")),
    "mixture": Reach(
        "--mixture world=1 removal=2", "train.settings", attribute("data.mixture", {"world": 1.0, "removal": 2.0})
    ),
    "steps": Reach("--steps 3", "train.settings", attribute("loop.steps", 3)),
    "batch": Reach("--batch 7", "train.settings", attribute("loop.batch", 7)),
    "precision": Reach("--precision bf16", "train.settings", attribute("loop.precision", "bf16")),
    "devices": Reach("--devices 2", "train.settings", attribute("loop.devices", 2)),
}
WORLDS = {
    "output": Reach("-o elsewhere", "write_worlds.folder", Path("elsewhere")),
    "count": Reach("--count 2", "write_worlds.count", 2),
    "seed": Reach("--seed 9", "write_worlds.seed", 9),
    "size": Reach("--size 64", "write_worlds.size", 64),
    "kind": Reach("--kind room", "write_worlds.kind", "room"),
    "textures": Reach("--textures photos", "write_worlds.textures", Path("photos")),
}
SHOW = {
    "what": instead("scene.npz", "points_in.path", Path("scene.npz"), "out"),
    "output": Reach("-o page.html", "show_page.output", Path("page.html")),
    "max_points": Reach("--max-points 7", "point_viewer.most", 7),
    "open_browser": Reach("--no-open-browser", "show_page.open_browser", False),
}
DOCTOR = {
    "first": instead("a.png depth.png mask.png", "diagnose.first", Path("a.png"), THREE),
    "second": instead("image.png b.png mask.png", "diagnose.second", Path("b.png"), THREE),
    "mask": instead("image.png depth.png c.png", "diagnose.mask", Path("c.png"), THREE),
    "calib": Reach("--calib c.json", "diagnose.calib", Path("c.json")),
    "layout": Reach("--layout tum", "diagnose.layout", "tum"),
}
BATCH = {
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
    "data": Reach("--data room", "batch.jobs", attribute("root", Path("room")), ("jobs.csv",)),
    "layout": Reach("--data room --layout tum", "batch.jobs", attribute("layout", "tum"), ("jobs.csv",)),
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
OUTPUT = {"output": Reach("-o elsewhere", "write.directory", Path("elsewhere"), ("-o out",))}
OWN: dict[str, dict[str, Reach]] = {
    "view": {**PICTURE, **OUTPUT},
    "remove": {**REMOVED, **OUTPUT},
    "mask": {
        **PICTURE,
        "output": Reach("-o found.png", "write_mask.output", Path("found.png"), ("-o mask.png",)),
    },
    "stereo": {**PAIR, **OUTPUT},
    "depth": {
        "image": instead("a.png", "read_rgbd.image", Path("a.png"), "image.png"),
        "far": Reach("--far 30", "read_rgbd.far", 30.0),
        "output": Reach("-o elsewhere", "write_depth.directory", Path("elsewhere"), ("-o out",)),
    },
    "demo": {"output": Reach("-o elsewhere", "new_directory.path", Path("elsewhere"))},
    "photo3d": {
        **PICTURE,
        "output": Reach("-o elsewhere", "write_photo3d.directory", Path("elsewhere"), ("-o out",)),
        "only": Reach("--only mesh,splats", "write_photo3d.only", ("mesh", "splats")),
        "also": Reach("--also stereo", "write_photo3d.also", ("stereo",)),
    },
    "sequence": SEQUENCE,
    "batch": BATCH,
    "video": VIDEO,
    "doctor": DOCTOR,
    "show": SHOW,
    "serve": SERVE,
    "evaluate": EVALUATE,
    "worlds": WORLDS,
    "train": TRAIN,
    "models list": REPORT,
    "models info": {"name": NAME, **REPORT},
    "models pull": {"name": NAME, **REPORT},
    "models convert": {**CONVERT, **REPORT},
    "models verify": {"name": Reach("mobile-sam-decoder", "record.name", "mobile-sam-decoder"), **REPORT},
}
"""Verb -> option -> what it reaches, of the options that are in no group, and of those in a group that are no rule."""


def commands() -> dict[str, Callable[..., Any]]:
    """Every verb; of `models`, each of its tasks."""
    found = {name: verb for name, verb in VERBS.items() if name != "models"}
    tasks = typing.get_args(typing.get_type_hints(model_verbs.models, include_extras=True)["task"])
    for task in tasks:
        kind, note = typing.get_args(task)[:2]
        found[f"models {note.name}"] = kind
    return found


def rows_of(verb: str, taker: Callable[..., Any]) -> dict[str, Reach]:
    """All options of a verb."""
    of_groups = [rows_of_group(verb, group) for group in groups_in(taker)]
    return {name: row for rows in (*of_groups, OWN.get(verb, {})) for name, row in rows.items()}


TABLE = {verb: rows_of(verb, taker) for verb, taker in commands().items()}
"""Verb -> option -> what it reaches."""
