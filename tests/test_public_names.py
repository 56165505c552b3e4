"""The shop window: what `import dlama` offers (oracles: the syntax tree of `__init__`, the signatures)."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import typing
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlama
from dlama.completion.options import option_types

NAMES = set(dlama.__all__)
"""The documentation lists the same (`test_docs`)."""
OWN = {"example"}
"""Defined in `__init__` itself."""


def test_public_names() -> None:
    """Each once, and `dir` shows exactly these."""
    assert set(dir(dlama)) == NAMES | {"__version__"}
    assert len(dlama.__all__) == len(NAMES)


@pytest.mark.parametrize("name", sorted(NAMES))
def test_each_resolves_and_explains_itself(name: str) -> None:
    """It is what its module defines under that name, with a docstring; and it is no submodule."""
    found = getattr(dlama, name)
    assert not inspect.ismodule(found)
    assert name == "Inpainter" or (found.__doc__ or "").strip()
    if name not in OWN:
        assert found is getattr(importlib.import_module(f"dlama.{dlama.MODULES[name]}"), name)
        if typing.get_origin(found) is None:
            assert found.__module__ == f"dlama.{dlama.MODULES[name]}"


def test_no_module_bears_a_public_name() -> None:
    """Importing dlama/view.py would put the module in place of the function."""
    folder = Path(dlama.__file__).parent
    assert {path.stem for path in folder.iterdir() if path.suffix in ("", ".py")} & NAMES == set()


def test_an_unknown_name_is_an_attribute_error() -> None:
    """With the words that Python itself uses."""
    with pytest.raises(AttributeError, match="module 'dlama' has no attribute 'nonsense'"):
        _ = dlama.nonsense


def test_type_checkers_see_what_python_sees() -> None:
    """The imports under TYPE_CHECKING are the table, each as itself so that type checkers see it as public."""
    tree = ast.parse(Path(dlama.__file__).read_text("utf-8"))
    (guarded,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {}
    for node in guarded.body:
        assert isinstance(node, ast.ImportFrom)
        for alias in node.names:
            assert alias.name == alias.asname
            seen[alias.name] = str(node.module).removeprefix("dlama.")
    assert seen == dlama.MODULES
    assert set(seen) | OWN == NAMES


def types_in(hint: Any) -> Iterable[type]:
    """The classes of dlama that a type hint names, at any depth."""
    if typing.get_origin(hint) is None and inspect.isclass(hint) and hint.__module__.startswith("dlama."):
        yield hint
    inner = [one for arg in typing.get_args(hint) for one in (arg if isinstance(arg, list) else [arg])]
    for one in inner:
        yield from types_in(one)


def hints_of(item: Any) -> dict[str, Any]:
    """Type hints of a function's parameters and result, or of a class's fields, public properties and methods."""
    if item is dlama.Options:
        return option_types()
    if inspect.isfunction(item):
        hints = typing.get_type_hints(item)
        return hints | (option_types() if hints.pop("options", None) else {})
    if typing.get_origin(item) is not None or not inspect.isclass(item):  # Python 3.10 calls list[int] a class
        return {"alias": item}
    found: dict[str, Any] = dict(typing.get_type_hints(item)) if dataclasses.is_dataclass(item) else {}
    for name, member in vars(item).items():
        function = next(
            (getattr(member, door) for door in ("fget", "__func__", "func") if hasattr(member, door)), member
        )
        if not name.startswith("_") and inspect.isfunction(function):
            found |= {f"{name}.{key}": hint for key, hint in typing.get_type_hints(function).items()}
    return found


def hidden_types(public: Mapping[str, Any]) -> list[str]:
    """`where: Type` for each class that a public name takes or gives and that has no public name itself."""
    known = {id(item) for item in public.values()}
    return sorted(
        {
            f"{name}.{where}: {kind.__module__}.{kind.__name__}"
            for name, item in public.items()
            if not (inspect.isclass(item) and issubclass(item, (Exception, Enum)))
            for where, hint in hints_of(item).items()
            for kind in types_in(hint)
            if id(kind) not in known
        }
    )


def test_types_that_public_names_take_or_give_are_public() -> None:
    """Arguments, results, fields, properties and methods (oracle: the signatures)."""
    assert hidden_types({name: getattr(dlama, name) for name in NAMES}) == []


def test_this_guard_can_fail() -> None:
    """Without its export, a type is found wherever it is used: argument, result, field, property, alias."""
    public = {name: getattr(dlama, name) for name in NAMES}
    used = {
        "RGBD": "view.rgbd", "Completion": "remove.return", "Scene": "Completion.scene", "Mesh": "Completion.mesh.return",
        "Fill": "Inpainter.alias", "StereoRig": "stereo.rig", "Recipe": "complete.recipe",
    }  # fmt: skip
    for name, where in used.items():
        without = {key: value for key, value in public.items() if key != name}
        assert where in [line.split(":")[0] for line in hidden_types(without)], name


def holds_arrays(hint: Any) -> bool:
    """Whether a type is of arrays, or of containers of them."""
    return typing.get_origin(hint) is np.ndarray or any(map(holds_arrays, typing.get_args(hint)))


@pytest.mark.parametrize("name", sorted(name for name in NAMES if dataclasses.is_dataclass(getattr(dlama, name))))
def test_no_array_is_printed(name: str) -> None:
    """A noun in a console is a line (oracle: its fields); what it shows of arrays it says in its own words."""
    noun = getattr(dlama, name)
    if hasattr(noun.__repr__, "__wrapped__"):  # dataclasses made it
        hints = hints_of(noun)
        assert [one.name for one in dataclasses.fields(noun) if one.repr and holds_arrays(hints[one.name])] == []
