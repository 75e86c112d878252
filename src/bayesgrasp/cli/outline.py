"""What ``bayesgrasp COMMAND --help`` needs of the package, without the seconds that it takes to import it.

A command's file imports at its top what the command works with, and with it torch, numba and a physics engine. Help
only describes a signature, whose types are plain: numbers, paths, and choices that a room names by an assignment,
``Role = Literal["image", "success"]``. While modules are `outlined`, the command line's own files are executed as ever;
a module of another room is read instead: its choices and its plain constants are taken from the source text, and
every other name in it stands for an empty class. Nothing of this outlasts the block, and no command runs in it.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import spec_from_loader
from types import ModuleType
from typing import Any, Literal

PACKAGE = "bayesgrasp"
EXECUTED = f"{PACKAGE}.cli"
SLOW = frozenset({"matplotlib", "torch"})
"""Packages that commands' files import by themselves, and that no option is made of."""


class _Outline(ModuleType):
    """A module whose names stand for empty classes where nothing is known of them."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


class _Outlines(MetaPathFinder, Loader):
    """Finds and makes outlines; leaves folders, the command line and everything else to others."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """An outline's specification where the module shall be one."""
        if fullname.partition(".")[0] in SLOW:
            return spec_from_loader(fullname, self, is_package=True)
        if not fullname.startswith(f"{PACKAGE}.") or f"{fullname}.".startswith(f"{EXECUTED}."):
            return None
        found = PathFinder.find_spec(fullname, path)
        if found is None or found.submodule_search_locations is not None:
            return None
        return spec_from_loader(fullname, self, origin=found.origin)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """An empty one."""
        return _Outline(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Fill in what its source says plainly."""
        origin = module.__spec__.origin if module.__spec__ is not None else None
        if origin is not None:
            with open(origin, encoding="utf-8") as source:
                module.__dict__.update(plain_names(source.read()))


def plain_names(source: str) -> dict[str, Any]:
    """The choices and plain constants that a source text assigns to names at its top level."""
    names = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            try:
                names[node.targets[0].id] = _value(node.value)
            except ValueError:  # it must be computed
                continue
    return names


def _value(node: ast.expr) -> Any:
    if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "Literal":
        return Literal[ast.literal_eval(node.slice)]
    return ast.literal_eval(node)


@contextmanager
def outlined() -> Iterator[None]:
    """Import what is not imported yet as outlines, and forget it at the end."""
    finder, before = _Outlines(), set(sys.modules)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        for name in set(sys.modules) - before:
            if name.partition(".")[0] in {PACKAGE, *SLOW}:
                _forget(name)


def _forget(name: str) -> None:
    del sys.modules[name]
    folder, _, last = name.rpartition(".")
    if folder in sys.modules:
        vars(sys.modules[folder]).pop(last, None)
