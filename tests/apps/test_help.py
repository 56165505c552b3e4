"""What --help says of every option of every verb (oracles: the signatures, the library's closed lists)."""

from __future__ import annotations

import ast
import contextlib
import functools
import inspect
import io
import re
import textwrap
from typing import Any, TypeGuard, get_args

import pytest
from tyro.conf import Positional

import dlama
from dlama.apps import options
from dlama.apps.cli import EXAMPLES, VERBS, join_lines, main
from dlama.apps.terminal.flags import flags_of, with_flags
from dlama.apps.verbs.measuring import options as evaluate_options
from dlama.completion.options import options_in
from dlama.inpainters import FILLERS
from dlama.jobs.options import Results
from test_docs import WORDS
from verb_options import fields_of, groups_in

COMMANDS = [[verb] for verb in VERBS if verb != "models"] + [
    ["models", word] for word in ("list", "info", "pull", "convert", "verify")
]


@functools.cache
def page_of(*words: str) -> str:
    """What a command's --help prints."""
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), pytest.raises(SystemExit) as stop:
        main([*words, "--help"])
    assert stop.value.code == 0
    return shown.getvalue()


def rows(shown: str) -> list[str]:
    """Each option's row of a help page, its lines joined; descriptions of groups are no rows."""
    found: list[str] = []
    for box in re.findall(r"╭.*?╰", shown, re.DOTALL):
        lines = [line.strip("│").rstrip() for line in box.splitlines()[1:-1]]
        lines = lines[max([0, *(n + 1 for n, line in enumerate(lines) if set(line.strip()) == {"─"})]) :]
        for line in lines:
            if re.match(r" \S", line):
                found.append(line.strip())
            else:
                found[-1] += f" {line.strip()}"
    return found


@pytest.mark.parametrize("words", [*COMMANDS, []], ids=" ".join)
def test_help_has_plain_words(words: list[str]) -> None:
    """Oracle: the table of words that the site is held to."""
    text = " ".join(re.sub("[│╭╮╰╯─]", " ", page_of(*words)).split())
    assert re.findall(rf"\b(?:{'|'.join(WORDS)})\b", text, re.IGNORECASE) == []


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_option_shows_its_default_or_is_required(words: list[str]) -> None:
    """Oracle: the rows themselves; `--help` alone has no default."""
    found = [row for row in rows(page_of(*words)) if not row.startswith("-h, --help")]
    assert [row for row in found if not re.search(r"\((default: \S[^()]*|required)\)$", row)] == []


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb != "models"])
def test_examples_are_shown(verb: str) -> None:
    """Oracle: the table of examples."""
    assert all(f"$ {line}"[:60] in page_of(verb) for line in EXAMPLES[verb])


@pytest.mark.parametrize("verb", VERBS)
def test_text_fits_the_terminal(verb: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: its 80 columns, but for the examples, which are copied, and the synopsis."""
    monkeypatch.setenv("COLUMNS", "80")
    shown = page_of.__wrapped__(verb).splitlines()
    assert [line for line in shown if len(line) > 80 and not line.startswith(("$ ", "usage: "))] == []


@pytest.mark.parametrize("verb", VERBS)
def test_shown_defaults_are_the_defaults(verb: str) -> None:
    """Numbers, names and paths are shown as they are (oracle: the signature)."""
    for name, hint, default in fields_of(VERBS[verb]):
        (shown,) = (note.help_behavior_hint for note in hint.__metadata__ if hasattr(note, "help_behavior_hint"))
        if default is inspect.Parameter.empty:
            assert shown == "(required)", name
        elif default is not None and not isinstance(default, bool):
            values = default if isinstance(default, tuple) else (default,)
            words = " ".join(f"{value:g}" if isinstance(value, float) else f"{value}" for value in values)
            assert not words or shown == f"(default: {words})", name


@pytest.mark.parametrize("verb", VERBS)
def test_line_breaks_of_the_source_are_not_shown(verb: str) -> None:
    """Where the source breaks a description help would break it too, in the middle of a sentence (oracle: the source)."""
    assert not re.search(r"\n {5,}\S", join_lines(str(VERBS[verb].__doc__)))
    for group in groups_in(VERBS[verb]):
        try:
            (parsed,) = ast.parse(textwrap.dedent(inspect.getsource(group))).body
        except OSError:  # made by `as_flags`
            continue
        assert isinstance(parsed, ast.ClassDef)
        texts = [one.value.value for one in parsed.body[1:] if isinstance(one, ast.Expr) and is_text(one.value)]
        assert [text for text in texts if "\n" in text] == []


def is_text(node: ast.expr) -> TypeGuard[Any]:
    """Whether it is a string, as a docstring is."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def test_names_in_help_are_those_of_the_library() -> None:
    """Help knows recipes, protocols and the pivot without loading them (oracle: the library)."""
    from dlama.datasets.frames import Protocol
    from dlama.evaluation.protocols.methods import NO_FILL
    from dlama.files.results.completion import BY_DEFAULT, RESULTS

    only = options_in(Results)["only"]
    assert f"of {', '.join(RESULTS)} (" in only.text and only.default == ",".join(BY_DEFAULT)
    assert evaluate_options.NO_FILL == NO_FILL
    assert get_args(evaluate_options.Protocol) == get_args(Protocol)
    assert inspect.signature(dlama.view).parameters["pivot"].default == options.Move().pivot


def test_help_names_every_filler() -> None:
    """Oracle: the library's list, in the help of the verbs that fill, and of the one that measures."""
    for verb in ("view", "sequence", "evaluate"):
        missing = [name for name in FILLERS if not re.search(rf"\b{name}\b", re.sub(r"-\s+", "-", page_of(verb)))]
        assert not missing, (verb, missing)


OPTIONS = sorted({(verb, name, flag) for verb in VERBS for name, flag in flags_of(VERBS[verb]).items()})


@pytest.mark.parametrize(("verb", "name", "flag"), OPTIONS, ids=lambda value: str(value))
def test_each_parameter_becomes_its_flag(verb: str, name: str, flag: str) -> None:
    """Wherever a message names it in backticks; the flag is one that the verb's help shows (oracle: help)."""
    flags = flags_of(VERBS[verb])
    if verb != "models":
        assert re.search(rf"{flag}\b(?!-)", page_of(verb))
    assert with_flags(f"`{name}` is 3; more is expected", flags) == f"{flag} is 3; more is expected"
    assert (
        with_flags(f"a.png: give `{name}=3` or `{name}`, no {name}", flags)
        == f"a.png: give {flag} 3 or {flag}, no {name}"
    )


def test_what_is_positional_has_no_flag() -> None:
    """`image` stays `image` (oracle: the signatures)."""
    assert {"image", "depth", "depth_and_mask"}.isdisjoint(flags_of(VERBS["remove"]))
    assert "mask" in flags_of(VERBS["stereo"])
    assert Positional not in flags_of(VERBS["view"])


@pytest.mark.parametrize(
    ("verb", "line", "shown"),
    [
        ("stereo", "left/mask.png: no such file", "left/mask.png: no such file"),
        ("stereo", "camera.json: max_disparity and mask are given", "camera.json: max_disparity and mask are given"),
        (
            "stereo",
            "`dlama stereo` runs it; `read_camera()` reads one",
            "`dlama stereo` runs it; `read_camera()` reads one",
        ),
        ("stereo", "--max-disparity is 3 px", "--max-disparity is 3 px"),
        ("stereo", "`image` is missing", "image is missing"),
        ("remove", "`clicks` holds 3,4, which lies on the sky", "--click holds 3,4, which lies on the sky"),
        ("remove", "`clicks` and `not_clicks` both hold pixel 3,4", "--click and --not both hold pixel 3,4"),
        ("train", "`loop.devices` is 9999; 2 are here", "--devices is 9999; 2 are here"),
        ("train", "`network.start` is 'b.ckpt', not 'a.ckpt'", "--start is 'b.ckpt', not 'a.ckpt'"),
        ("train", "`data.size` 64 and `loop.batch` 9 take 1 GB", "data.size 64 and --batch 9 take 1 GB"),
    ],
)
def test_messages_name_options_and_leave_other_words(verb: str, line: str, shown: str) -> None:
    """By hand: sentences, files and flags that stand already are left alone; lists of the library are options that are given
    again, settings of the training loop options of `dlama train`."""
    assert with_flags(line, flags_of(VERBS[verb])) == shown
