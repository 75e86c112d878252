"""The layout of the code in numbers: sizes, names, parameters, comments, imports inside functions, dependencies.

Measured on the text alone, by `ast` and `tokenize`, so any revision can be measured; nothing is imported or run.

    python benchmarks/code_profile.py [--against REVISION] [--json results/profile.json] [--table results/profile.md]

How each number is defined stands beside it in the table that is written. A code line is a line with anything on it
other than a comment or a docstring; `__init__` files are counted as code, but not among files and folders.
"""

import argparse
import ast
import io
import json
import statistics
import subprocess
import tarfile
import tempfile
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

PACKAGE = "bayesgrasp"
ROOT = Path(__file__).parents[1]
Function = ast.FunctionDef | ast.AsyncFunctionDef
LAYOUT_TOKENS = frozenset(
    {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER, tokenize.COMMENT}
)
MOST_PARAMETERS = 8


@dataclass(frozen=True)
class Source:
    """One file of Python.

    Attributes:
        path: Where it is.
        text: What it holds.
    """

    path: Path
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax tree."""
        return ast.parse(self.text)

    @cached_property
    def tokens(self) -> list[tokenize.TokenInfo]:
        """Its tokens, comments included."""
        return list(tokenize.generate_tokens(io.StringIO(self.text).readline))

    @property
    def comments(self) -> int:
        """How many comments it has, those to tools included."""
        return sum(token.type == tokenize.COMMENT for token in self.tokens)

    @cached_property
    def code_lines(self) -> frozenset[int]:
        """Numbers of the lines of code."""
        lines: set[int] = set()
        for token in self.tokens:
            if token.type not in LAYOUT_TOKENS:
                lines |= set(range(token.start[0], token.end[0] + 1))
        for node in ast.walk(self.tree):
            match node:
                case ast.Expr(value=ast.Constant(value=str()), lineno=first, end_lineno=last):
                    lines -= set(range(first, (last or first) + 1))
        return frozenset(lines)

    @cached_property
    def functions(self) -> list[Function]:
        """Functions and methods, nested ones too."""
        return [node for node in ast.walk(self.tree) if isinstance(node, Function)]

    def body_lines(self, function: Function) -> int:
        """Code lines of a function below its signature."""
        first, last = function.body[0].lineno, function.end_lineno or function.lineno
        return sum(first <= line <= last for line in self.code_lines)

    @property
    def public_names(self) -> int:
        """Functions, classes and constants of the module's own, without an underscore."""
        return sum(not name.startswith("_") for node in self.tree.body for name in _names(node))

    @property
    def inner_imports(self) -> int:
        """Statements inside functions that import from the package itself."""
        found = {node for function in self.functions for node in ast.walk(function) if _is_own_import(node)}
        return len(found)

    @property
    def called_classes(self) -> int:
        """Classes, protocols aside, whose instances are called like functions."""
        classes = [node for node in ast.walk(self.tree) if isinstance(node, ast.ClassDef) and not _is_protocol(node)]
        return sum(isinstance(m, Function) and m.name == "__call__" for node in classes for m in node.body)


def _names(node: ast.stmt) -> list[str]:
    match node:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Assign(targets=targets):
            return [target.id for target in targets if isinstance(target, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name)):
            return [name]
    return []


def _is_own_import(node: ast.AST) -> bool:
    if isinstance(node, ast.ImportFrom):
        return bool(node.level) or (node.module or "").split(".")[0] == PACKAGE
    return isinstance(node, ast.Import) and any(alias.name.split(".")[0] == PACKAGE for alias in node.names)


def _is_protocol(node: ast.ClassDef) -> bool:
    return any("Protocol" in ast.unparse(base) for base in node.bases)


def parameters(function: Function) -> int:
    """How many parameters a function takes, `self`, `*args` and `**options` aside."""
    names = [a.arg for a in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
    return len([name for name in names if name not in {"self", "cls"}])


@dataclass(frozen=True)
class Profile:
    """A tree in numbers, in the order of the table; how each is defined is in `MEANINGS`."""

    files: int
    file_median: float
    file_max: int
    body_median: float
    body_90: int
    body_max: int
    names_median: float
    names_max: int
    parameters_mean: float
    parameters_max: int
    many_parameters: int
    comments: float
    tests: float
    largest_folder: int
    inner_imports: int
    called_classes: int
    dependencies: int


MEANINGS = {
    "files": "files of the package",
    "file_median": "lines of a file, median",
    "file_max": "lines of a file, most",
    "body_median": "code lines of a function's body, median",
    "body_90": "code lines of a function's body, 90 %",
    "body_max": "code lines of a function's body, most",
    "names_median": "public names (functions, classes, constants) of a module, median",
    "names_max": "public names of a module, most",
    "parameters_mean": "parameters of a function, mean",
    "parameters_max": "parameters of a function, most",
    "many_parameters": f"functions of more than {MOST_PARAMETERS} parameters",
    "comments": "comments for 100 code lines",
    "tests": "code lines of tests for one of code",
    "largest_folder": "files of the largest folder",
    "inner_imports": "statements inside functions that import from the package",
    "called_classes": "classes, protocols aside, with `__call__`",
    "dependencies": "dependencies that are always installed",
}


def measure(root: Path) -> Profile:
    """The profile of a tree: `src`, `tests` and `pyproject.toml` below a directory."""
    sources = list(_sources(root / "src"))
    modules = [source for source in sources if source.path.name != "__init__.py"]
    lengths = [len(source.text.splitlines()) for source in modules]
    names = [source.public_names for source in modules]
    bodies = sorted(source.body_lines(function) for source in sources for function in source.functions)
    counts = [parameters(function) for source in sources for function in source.functions]
    code = sum(len(source.code_lines) for source in sources)
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return Profile(
        files=len(modules),
        file_median=statistics.median(lengths),
        file_max=max(lengths),
        body_median=statistics.median(bodies),
        body_90=bodies[int(0.9 * len(bodies))],
        body_max=bodies[-1],
        names_median=statistics.median(names),
        names_max=max(names),
        parameters_mean=round(statistics.mean(counts), 2),
        parameters_max=max(counts),
        many_parameters=sum(count > MOST_PARAMETERS for count in counts),
        comments=round(100 * sum(source.comments for source in sources) / code, 2),
        tests=round(sum(len(source.code_lines) for source in _sources(root / "tests")) / code, 2),
        largest_folder=max(Counter(source.path.parent for source in modules).values()),
        inner_imports=sum(source.inner_imports for source in sources),
        called_classes=sum(source.called_classes for source in sources),
        dependencies=len(project["dependencies"]),
    )


def _sources(folder: Path) -> Iterator[Source]:
    return (Source(path, path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.py")))


def measure_revision(revision: str, repository: Path = ROOT) -> Profile:
    """The profile of a revision of the repository, from a copy that `git archive` makes."""
    command = ["git", "-C", str(repository), "archive", "--format=tar", revision, "src", "tests", "pyproject.toml"]
    packed = subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
        return measure(Path(folder))


def table(profiles: dict[str, Profile]) -> str:
    """Profiles side by side, as Markdown."""
    lines = [f"| | {' | '.join(profiles)} |", f"|---|{'---:|' * len(profiles)}"]
    for field in fields(Profile):
        values = (f"{getattr(profile, field.name):g}" for profile in profiles.values())
        lines.append(f"| {MEANINGS[field.name]} | {' | '.join(values)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree to measure")
    parser.add_argument("--against", help="a revision of this repository to measure beside it")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    profiles = {f"before ({options.against})": measure_revision(options.against)} if options.against else {}
    profiles["now"] = measure(options.root)
    text = table(profiles)
    print(text, end="")
    if options.table is not None:
        options.table.write_text("# Profile of the code\n\n" + text, encoding="utf-8")
    if options.json is not None:
        content = {name: vars(profile) for name, profile in profiles.items()}
        options.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
