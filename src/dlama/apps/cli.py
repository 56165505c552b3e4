"""The command line: one verb = one public function of the same name. Each reads, calls and writes, no more."""

from __future__ import annotations

import difflib
import inspect
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes

import dlama
from dlama.apps.command import STAGES
from dlama.apps.examples import EXAMPLES
from dlama.apps.options import CompletingOptions, Report, option
from dlama.apps.terminal.flags import check_words, flags_of, with_flags
from dlama.apps.terminal.output import errors_as_lines, report_result, stages_bar
from dlama.apps.verbs.batch import batch
from dlama.apps.verbs.measuring.doctor import doctor
from dlama.apps.verbs.measuring.evaluate import evaluate
from dlama.apps.verbs.measuring.worlds import worlds
from dlama.apps.verbs.networks.model_verbs import models
from dlama.apps.verbs.networks.train import train
from dlama.apps.verbs.photo3d import photo3d
from dlama.apps.verbs.pictures import depth, mask, remove, stereo, view
from dlama.apps.verbs.sequence import sequence
from dlama.apps.verbs.serve import serve
from dlama.apps.verbs.show import show
from dlama.apps.verbs.video import video
from dlama.errors import InputError, OutputError, format_count

DESCRIPTION = (
    "Completes what a camera could not see: the scene from another viewpoint, without an object, or as a stereo pair, "
    "filled in colour and in depth. `dlama demo` shows all of it; `dlama VERB --help` explains each; `dlama --version`."
)
FIRST_WORDS = """\
dlama completes what a camera could not see. The most usual commands:

  from another viewpoint:
    dlama view photo.jpg depth.png --fov 65 --yaw 20 -o moved
  without the object at a pixel:
    dlama remove photo.jpg --fov 65 --click 320,400 -o removed
  the depth of a stereo pair:
    dlama stereo left.png right.png --calib calib.txt -o pair
  all of it by mouse, in the browser:
    dlama serve

`dlama demo` runs them on a scene that comes with dlama. `dlama --help` lists
all verbs, `dlama VERB --help` explains one."""
"""What `dlama` prints without arguments."""
DEMO_FOLDER = Annotated[Path, option("DIR", "dlama-demo", aliases=["-o"])]


def demo(completing: CompletingOptions, report: Report, output: DEMO_FOLDER = Path("dlama-demo")) -> None:
    """All jobs on the street scene that comes with dlama: another view, an object removed, a stereo pair, a photo without depth.

    Args:
        output: Directory for the results: view/, remove/, stereo/, photo/, a joint preview.png, a small video.webp,
            and the pictures used in inputs/.
    """
    from dlama.apps.verbs.demo import demo

    with report_result("demo", report) as result, stages_bar("demo", 4 * STAGES, report):
        demo(output, completing, result)


def version() -> None:
    """The versions of dlama and of what it computes with."""
    from dlama.files.results.meta_json import versions

    print("\n".join(f"{name} {number}" for name, number in versions().items()))


def warm_up(*, report: Report) -> None:
    """Compiles what commands compute with, so that the first of them does not wait: for images of machines, and for CI."""
    from dlama.geometry.kernels.ahead import listed_kernels, start_compiling
    from dlama.models.network_file import processor_count

    with report_result("warm-up", report) as result:
        running = start_compiling("all", processor_count())
        if any([one.wait() for one in running]):  # noqa: C419  (all of them end)
            raise OutputError(
                "kernels could not be compiled, or not be kept: `python -m dlama.geometry.kernels.ahead all 0 1` says why"
            )
        count = len(listed_kernels())
        line = f"{format_count(count, 'kernel')} compiled or found on disk, {result.seconds:.1f} s"
        result.add(line, kernels=count)


OF_PICTURES = (view, remove, mask, stereo, photo3d, sequence, video, depth, batch)
OTHERS = (demo, serve, doctor, show, version, warm_up, models, evaluate, worlds, train)
VERBS: dict[str, Callable[..., Any]] = {verb.__name__.replace("_", "-"): verb for verb in (*OF_PICTURES, *OTHERS)}
CONFIG = (OmitArgPrefixes, FlagCreatePairsOff)


def main(args: Sequence[str] | None = None) -> None:
    """The entry point `dlama`; `args` default to the command line's."""
    words = list(sys.argv[1:] if args is None else args)
    if words and words[0] in VERBS:
        run_verb(words[0], words[1:])
        return
    with errors_as_lines():
        if not words:
            print(FIRST_WORDS)
        elif words[0] == "--version":
            print(f"dlama {dlama.__version__}")
        elif words[0] in ("--help", "-h"):
            print(list_verbs())
            sys.exit(0)
        elif words[0].startswith("-"):
            tyro.extras.subcommand_cli_from_dict(
                VERBS, prog="dlama", description=DESCRIPTION, args=words, config=CONFIG
            )
        else:
            meant = [] if "." in words[0] else difflib.get_close_matches(words[0], VERBS, 1)  # a file is no slip
            hint = f"did you mean {meant[0]}? One" if meant else "one"
            raise InputError(f"{words[0]!r} is no verb of dlama; {hint} of {', '.join(VERBS)} is expected")


def list_verbs() -> str:
    """What `dlama --help` prints. tyro would read the source of its own classes for it, a third of the time of the command."""
    width = width_of_help()
    lines = [f"usage: dlama VERB ...\n\n{textwrap.fill(DESCRIPTION, width)}\n"]
    for name, verb in VERBS.items():
        first = inspect.cleandoc(str(verb.__doc__)).partition("\n")[0]
        lines.append(textwrap.fill(first, width, initial_indent=f"  {name:10}", subsequent_indent=" " * 12))
    return "\n".join(lines)


def width_of_help() -> int:
    """Columns of a line of text."""
    return min(shutil.get_terminal_size().columns, 100)


def run_verb(name: str, words: Sequence[str]) -> None:
    """One verb with its options; the errors of the library name flags."""
    verb = VERBS[name]
    verb.__doc__ = join_lines(str(verb.__doc__))
    examples = "\n".join(f"$ {line}" for line in EXAMPLES[name])
    # Indented: tyro joins lines that begin with a letter.
    summary = textwrap.fill(verb.__doc__.splitlines()[0], width_of_help(), subsequent_indent="  ")
    described = f"{summary}\n\n{examples}"
    with errors_as_lines(lambda message: with_flags(message, flags_of(verb))):
        check_words(verb, words)
        tyro.cli(verb, prog=f"dlama {name}", description=described, args=words, config=CONFIG)


def join_lines(docstring: str) -> str:
    """A docstring with each of its Args in one line: tyro shows line breaks, and those of the source mean nothing."""
    return re.sub(r"\n {8}(?=\S)", " ", inspect.cleandoc(docstring))
