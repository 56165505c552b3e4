"""What a user calls a model (a file of anybody's, or a name of the catalogue) in -> the ONNX file that runs out.

Weights are converted once; the ONNX file lies in the cache directory under the sha256 of what it was made from.
"""

from __future__ import annotations

from pathlib import Path

from dlama import __version__
from dlama.apps.terminal.streams import print_line
from dlama.errors import FileError, OutputError, system_errors
from dlama.models.cache import directory, locate, user_path
from dlama.models.records import CATALOGUE
from dlama.models.verify import sha256_of
from dlama.writing.atomic_write import new_file, write_file

UNKNOWN = "unknown"


def model_for(model: Path | str) -> Path:
    """The ONNX file of that model.

    Args:
        model: an .onnx file, taken as it is; a .ckpt, .pt, .pth or .safetensors file, converted on its first use; or
            a name of the catalogue, whose file must have been pulled.
    Raises:
        InputError: no such file or name; no generator in it; the file damaged.
        OutputError: the cache directory cannot be written.
        MissingExtraError: it has to be converted, and onnx is not installed.
    """
    path = source_of(model)
    if path.suffix.lower() == ".onnx":
        return path
    sha256 = sha256_of(path)
    target = directory() / "converted" / f"{path.stem}-{sha256[:16]}-dlama{__version__}.onnx"
    hash_file = target.with_suffix(".sha256")
    if target.is_file():
        if is_whole(target, hash_file):
            return target
        print_line("note", f"{target}: is not as it was written; it is made anew")
    for note in convert(path, target, licence_of(sha256)):
        print_line("note", note)
    write_file(hash_file, f"{sha256_of(target)}\n")
    return target


def is_whole(file: Path, hash_file: Path) -> bool:
    """Whether a file has the sha256 that was written next to it when it was made; False where that is missing or unreadable."""
    try:
        return sha256_of(file) == hash_file.read_text("ascii").strip()
    except (OSError, UnicodeDecodeError, FileError):
        return False


@system_errors(FileError)
def source_of(model: Path | str) -> Path:
    """The file itself; a name of the catalogue stands for the file that was pulled, unless a file is called so."""
    path = user_path(model)
    if path.is_file():
        return path
    if str(model) in CATALOGUE:
        return locate(str(model))
    raise FileError(f"{model}: no such file, and no model of the catalogue is called so ({', '.join(CATALOGUE)})")


def convert(source: Path, target: Path, licence: str) -> list[str]:
    """Write the ONNX file of the LaMa generator in that file; returns what a user should know of it."""
    from dlama.inpainters.networks.contract import generator_metadata
    from dlama.nets.checkpoints import read_generator
    from dlama.nets.export.generator import export_onnx

    weights = read_generator(source)
    with system_errors(OutputError):
        target.parent.mkdir(parents=True, exist_ok=True)
    with new_file(target) as draft:  # of a name of its own: two processes may convert the same file
        export_onnx(weights, draft, generator_metadata(weights.settings, source, licence))
    planes = f"{weights.settings.in_channels} -> {weights.settings.out_channels} planes"
    line = f"{source}: {weights.kind}, {planes}, {weights.settings.blocks} blocks, licence {licence}, converted to {target}"
    return [line, *(f"{source}: {note}" for note in weights.notes)]


def licence_of(sha256: str) -> str:
    """The catalogue's entry for a file with that hash; `unknown` where it has none."""
    return next((record.licence for record in CATALOGUE.values() if record.sha256 == sha256), UNKNOWN)
