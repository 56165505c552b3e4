"""How large the code is and where it is knotted: lines, files, constants, complexity, parameters, late imports, words of docs.

    python benchmarks/house.py [--against COMMIT]

Reads the working tree, or with --against also a commit of this repository, out of `git archive`, and prints a row per figure.
"""

from __future__ import annotations

import argparse
import ast
import collections
from collections.abc import Iterator
from pathlib import Path

from speed import ROOT, unpacked

FOLDERS = ("src", "tests", "benchmarks", "examples", "docs")
COMPLEX, MANY_PARAMETERS = 10, 7
"""More than so many branches, more than so many parameters, are counted."""
BRANCHES = (
    ast.If,
    ast.IfExp,
    ast.For,
    ast.AsyncFor,
    ast.While,
    ast.ExceptHandler,
    ast.Assert,
    ast.comprehension,
    ast.match_case,
)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
Function = ast.FunctionDef | ast.AsyncFunctionDef


def files_of_tree(root: Path) -> dict[str, str]:
    """Path in a tree of this repository -> text, of its Python files and Markdown pages."""
    paths = [path for folder in FOLDERS for path in (root / folder).rglob("*") if path.suffix in (".py", ".md")]
    return {str(path.relative_to(root)): path.read_text() for path in (*paths, *root.glob("*.md"))}


def room(path: str) -> str:
    """The folder of src/dlama that a file lies in; `-` for the package's own files."""
    parts = path.split("/")
    return parts[2] if len(parts) > 3 else "-"


def constants(tree: ast.Module) -> int:
    """Names in capitals that a module assigns."""
    targets: list[ast.expr] = []
    for node in tree.body:
        if isinstance(node, ast.Assign):
            targets += node.targets
        elif isinstance(node, ast.AnnAssign):
            targets.append(node.target)
    names = [leaf for target in targets for leaf in ast.walk(target) if isinstance(leaf, ast.Name)]
    return sum(name.id.isupper() for name in names)


def complexity(function: Function) -> int:
    """Ways through a function: 1, and 1 for each branch, loop, handler, `and` and `or`; functions inside count as part of it."""
    nodes = list(ast.walk(function))
    logic = sum(len(node.values) - 1 for node in nodes if isinstance(node, ast.BoolOp))
    return 1 + logic + sum(isinstance(node, BRANCHES) for node in nodes)


def parameters(function: Function) -> int:
    """Of a function, `self` and `cls` left out."""
    given = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    return sum(one.arg not in ("self", "cls") for one in given)


def outermost(tree: ast.AST) -> Iterator[Function]:
    """Functions and methods, without those inside other functions."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, FUNCTIONS):
            yield node
        elif isinstance(node, ast.ClassDef):
            yield from outermost(node)


def late_imports(function: Function) -> int:
    """Import statements inside a function."""
    return sum(isinstance(node, (ast.Import, ast.ImportFrom)) for node in ast.walk(function))


def words(files: dict[str, str], folder: str) -> int:
    """Of the Markdown pages below a folder."""
    return sum(len(text.split()) for path, text in files.items() if path.startswith(folder) and path.endswith(".md"))


def measure(files: dict[str, str]) -> dict[str, int]:
    """Each figure by its name."""
    source = {path: text for path, text in files.items() if path.startswith("src/") and path.endswith(".py")}
    tests = {path: text for path, text in files.items() if path.startswith("tests/") and path.endswith(".py")}
    trees = {path: ast.parse(text) for path, text in source.items()}
    functions = [function for tree in trees.values() for function in outermost(tree)]
    lines, names = collections.Counter[str](), collections.Counter[str]()
    for path, text in source.items():
        lines[room(path)] += text.count("\n")
        names[room(path)] += constants(trees[path])
    figures = {
        "lines of source": sum(lines.values()),
        "lines of tests": sum(text.count("\n") for text in tests.values()),
        "files of source": len(source),
        "files of tests": len(tests),
        f"functions of complexity > {COMPLEX}": sum(complexity(function) > COMPLEX for function in functions),
        f"functions with > {MANY_PARAMETERS} parameters": sum(parameters(one) > MANY_PARAMETERS for one in functions),
        "imports inside functions": sum(late_imports(function) for function in functions),
        "words of Markdown": words(files, ""),
        "words of the site, by hand": words(files, "docs/"),
        "constants": sum(names.values()),
    }
    by_room = {f"constants of {one}": names[one] for one in sorted(names) if names[one]}
    return figures | by_room | {f"lines of {one}": lines[one] for one in sorted(lines)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="COMMIT", help="print the figures of this commit, too, and the difference")
    args = parser.parse_args()
    now, before = measure(files_of_tree(ROOT)), None
    if args.against:
        with unpacked(args.against) as old:
            before = measure(files_of_tree(old))
    for name in now if before is None else before | now:
        figure = now.get(name, 0)
        if before is None:
            print(f"{name:36}{figure:9}")
        else:
            print(f"{name:36}{before.get(name, 0):9}{figure:9}{figure - before.get(name, 0):+9}")


if __name__ == "__main__":
    main()
