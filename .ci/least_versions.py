"""pyproject.toml in; pip constraints out that pin each dependency, of the core and of two extras, to the least version stated."""

import sys
from pathlib import Path

from packaging.requirements import Requirement

try:
    import tomllib
except ImportError:  # Python 3.10
    import tomli as tomllib

EXTRAS = ("onnx", "evaluate")


def main(pyproject: str) -> None:
    """Print a line for each dependency: numpy>=1.26 becomes numpy==1.26.*"""
    project = tomllib.loads(Path(pyproject).read_text("utf-8"))["project"]
    stated = [*project["dependencies"], *(line for name in EXTRAS for line in project["optional-dependencies"][name])]
    for line in stated:
        wanted = Requirement(line)
        least = [each.version for each in wanted.specifier if each.operator == ">="]
        if len(least) != 1:
            raise SystemExit(f"{line}: one least version (>=) is wanted")
        print(f"{wanted.name}=={least[0]}.*")


main(sys.argv[1])
