"""`dlama models ...`: which networks there are, their files pulled, checked and converted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, subcommand

from dlama.apps.model_files import UNKNOWN, convert, licence_of, source_of
from dlama.apps.options import Report, option
from dlama.apps.places import check_file_apart
from dlama.apps.terminal.output import counting_bar, report_result
from dlama.errors import FileError, OutputError
from dlama.models.cache import directory, known_size_and_sha256, target_path
from dlama.models.records import CATALOGUE, Record, record
from dlama.models.verify import sha256_of, verify

Name = Positional[Annotated[str, option("NAME", None)]]


@dataclass(frozen=True, kw_only=True)
class ListModels(Report):
    """The models that can be named, and which of them are here."""

    def run(self) -> None:
        """Print a table as wide as the terminal."""
        from rich.console import Console
        from rich.table import Table

        table, console = Table("name", "here", "MB", "licence", "what", box=None, header_style="bold"), Console()
        entries = []
        for one in CATALOGUE.values():
            size = "?" if one.bytes is None else f"{one.bytes / 1e6:{'.1g' if one.bytes < 1e6 else '.0f'}}"
            table.add_row(one.name, _here(one), size, one.licence, one.what)
            about = {name: getattr(one, name) for name in ("name", "bytes", "licence", "what")}
            entries.append({**about, "here": target_path(one).is_file()})
        with console.capture() as drawn:
            console.print(table)
        with report_result("models list", self) as result:
            result.add(drawn.get().rstrip("\n"), directory=str(directory()), models=entries)
            result.add(f"files lie in {directory()} (DLAMA_MODELS names another directory)")


@dataclass(frozen=True, kw_only=True)
class Info(Report):
    """All that is known of one model."""

    name: Name
    """Which model of `dlama models list`."""

    def run(self) -> None:
        """Print it, a line each."""
        with report_result("models info", self) as result:
            entry = record(self.name)
            known: dict[str, str | None] = {
                "name": entry.name,
                "what": entry.what,
                "from": "\n          ".join(entry.urls),
                "sha256": entry.sha256 or "unknown, pinned on first use",
                "pinned": known_size_and_sha256(entry)[1] if entry.sha256 is None else None,
                "bytes": "unknown" if entry.bytes is None else str(entry.bytes),
                "licence": entry.licence,
                "contract": entry.contract,
                "note": entry.note,
                "caution": "dlama's authors never had this file in hand; size and sha256 are as projects that load it "
                "publish them",
                "file": f"{target_path(entry)} ({_here(entry)})",
            }
            shown = "\n".join(f"{key:9} {value}" for key, value in known.items() if value)
            result.add(shown, **known, urls=list(entry.urls), here=target_path(entry).is_file())


@dataclass(frozen=True, kw_only=True)
class Pull(Report):
    """Download one model into the cache directory; continues an earlier pull that broke off, and checks the file."""

    name: Name
    """Which model of `dlama models list`."""

    def run(self) -> None:
        """Pull it under a bar, and print where it lies."""
        from dlama.models.pull import pull

        entry = record(self.name)
        with report_result("models pull", self) as result, counting_bar(entry.name, self, of_bytes=True) as progress:
            path = pull(entry, progress)
            detail = verify(entry).detail
            line = f"{path}: {detail}, licence {entry.licence}"
            result.add(line, model=entry.name, file=str(path), detail=detail, licence=entry.licence)


@dataclass(frozen=True, kw_only=True)
class Convert(Report):
    """Weights of a LaMa (official checkpoint, TorchScript, safetensors) to an ONNX file."""

    weights: Positional[Annotated[Path, option("CKPT", None)]]
    """A .ckpt, .pt, .pth or .safetensors file, or a name of the catalogue."""
    output: Annotated[Path, option("FILE.onnx", None, aliases=["-o"])]
    """The file that is written."""
    licence: Annotated[str | None, option("SPDX", "the catalogue's, else unknown")] = None
    """Of the weights; written into the file."""

    def run(self) -> None:
        """Convert, and print what a user should know."""
        if self.output.suffix.lower() != ".onnx":
            raise OutputError(f"`output` is {self.output}; a name that ends in .onnx is expected")
        check_file_apart(self.output, {"weights": self.weights}, makes_folder=True)
        source = source_of(self.weights)
        licence = self.licence or licence_of(sha256_of(source))
        with report_result("models convert", self) as result:
            notes = convert(source, self.output, licence)
            if licence == UNKNOWN:
                notes += ["note: the licence of these weights is not known; --licence SPDX writes it into the file"]
            result.add("\n".join(notes), output=str(self.output), licence=licence, notes=notes)


@dataclass(frozen=True, kw_only=True)
class Verify(Report):
    """Compare files with their published hashes, or with what they were when they were first used."""

    name: Positional[Annotated[str | None, option("[NAME]", "every file that is here")]] = None
    """Which model."""

    def run(self) -> None:
        """Print a line each; what is wrong ends with an error."""
        with report_result("models verify", self) as result:
            here = [name for name, one in CATALOGUE.items() if target_path(one).is_file()]
            verdicts = {name: verify(record(name)) for name in ([self.name] if self.name else here)}
            files, bad = result.values.setdefault("files", []), list[str]()
            for name, one in verdicts.items():
                files.append({"model": name, "file": str(one.path), "state": one.state, "detail": one.detail})
                if one.state in ("wrong", "missing"):
                    bad.append(f"{one.path}: {one.detail}")
                else:
                    result.add(f"{one.path}: {one.state}, {one.detail}")
            if not verdicts:
                result.add(f"no model is in {directory()}")
        if bad:
            raise FileError("; ".join(bad))


def models(
    task: Annotated[ListModels, subcommand("list", prefix_name=False)]
    | Annotated[Info, subcommand("info", prefix_name=False)]
    | Annotated[Pull, subcommand("pull", prefix_name=False)]
    | Annotated[Convert, subcommand("convert", prefix_name=False)]
    | Annotated[Verify, subcommand("verify", prefix_name=False)],
) -> None:
    """The networks: list, info, pull, convert, verify.

    Args:
        task: What to do with them.
    """
    task.run()


def _here(entry: Record) -> str:
    return "yes" if target_path(entry).is_file() else "no"
