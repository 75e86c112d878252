"""The pages hold what they promise: links lead somewhere, Python blocks run, camera files describe a camera."""

import json
import re
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import fake_world
import pytest
from box_scene import Box, box_depth_image
from markdown_it import MarkdownIt
from markdown_it.token import Token

from bayesgrasp import __version__
from bayesgrasp.cli.main import COMMANDS, main
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store
from bayesgrasp.geometry.camera import Camera, canonical_camera

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("results/**/*.md")])


def tokens(page: Path) -> Iterator[Token]:
    for token in MarkdownIt().enable("table").parse(page.read_text()):
        yield token
        yield from token.children or ()


def anchor(heading: str) -> str:
    """A heading's anchor as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def anchors(page: Path) -> set[str]:
    lines = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL).splitlines()
    return {anchor(line.lstrip("#").strip()) for line in lines if line.startswith("#")}


def broken(page: Path, link: str) -> bool:
    """Whether a relative link leads to no file, or to no heading of it."""
    if re.match(r"[a-z]+:", link):
        return False
    path, _, fragment = link.partition("#")
    target = (page.parent / path).resolve() if path else page
    if not target.is_relative_to(ROOT) or not target.exists():
        return True
    return bool(fragment) and fragment not in anchors(target)


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    links = [str(t.attrGet("href") or t.attrGet("src")) for t in tokens(page) if t.type in {"link_open", "image"}]
    assert [link for link in links if broken(page, link)] == []


Namespace = dict[str, Any]


def small_data_set(namespace: Namespace) -> None:
    """The directory `data` that a page reads, and the number of an epoch."""
    config = GenerateConfig(proposal="prior", attempts_per_draw=16, scenes_per_draw=2, draws_per_chunk=10)
    Run(open_store(Path("data"), fake_world.manifest(), False), fake_world.recipe(config), 160).execute(InProcess())
    namespace["epoch"] = 0


def depth_image(namespace: Namespace) -> None:
    """A depth image of a box, and the camera that took it."""
    camera = canonical_camera()
    namespace |= {"depth": box_depth_image(camera, (Box(),)), "intrinsics": camera.matrix}
    namespace["camera_to_world"] = camera.camera_to_world


SET_UP: dict[str, Callable[[Namespace], None]] = {"docs/data.md": small_data_set, "docs/planning.md": depth_image}
"""What the reader of a page has at hand."""


def run_block(token: Token, page: Path, namespace: Namespace) -> None:
    """Do with a fenced block what its language asks for; a language of which nothing is known is an error."""
    match token.info.strip():
        case "python" | "py":
            line = token.map[0] + 1 if token.map else 0
            exec(compile("\n" * line + token.content, str(page), "exec"), namespace)
        case "json":
            if "intrinsics" in json.loads(token.content):
                Path("camera.json").write_text(token.content)
                Camera.load("camera.json")
        case "sh" | "":
            pass
        case language:
            raise ValueError(f"nobody checks blocks of {language!r}")


def run_page(page: Path, namespace: Namespace) -> None:
    """Run the blocks of a page one after the other, as a reader would."""
    for token in tokens(page):
        if token.type == "fence":
            run_block(token, page, namespace)
        elif token.type == "code_block" and re.match(r"import |from |>>> ", token.content):
            raise ValueError("Python stands in fences that name it")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_blocks_run(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In an empty directory, but for what a reader of the page has at hand."""
    monkeypatch.chdir(tmp_path)
    namespace: Namespace = {"__name__": "__main__"}
    SET_UP.get(name(page), lambda _: None)(namespace)
    run_page(page, namespace)


@pytest.mark.parametrize(
    "block",
    [
        "```python\nassert False\n```",
        "```py\nassert False\n```",
        "```pycon\n>>> 1\n```",
        "```json\n{,}\n```",
        "    import os",
        '```json\n{"intrinsics": {"width": 640}}\n```',
    ],
)
def test_a_planted_block_is_caught(block: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "page.md").write_text(f"# A page\n\n{block}\n")
    with pytest.raises((AssertionError, ValueError)):
        run_page(tmp_path / "page.md", {})


@cache
def options(command: str) -> frozenset[str]:
    """The options of one of our commands, as its help names them."""
    with redirect_stdout(StringIO()) as help_text, pytest.raises(SystemExit):
        main([*command.split(), "--help"])
    return frozenset(re.findall(r"--[\w-]+", help_text.getvalue()))


def unknown_words(text: str) -> list[str]:
    """Commands and options of ours, targets of make and scripts that a piece of code names and that are not there."""
    wrong = []
    for line in re.findall(r"(?<![\w.-])(?<!import )bayesgrasp ([a-z][^;#|\n]*)", text.replace("\\\n", " ")):
        first, second, *_ = [*line.split(), ""]
        command = first if first in COMMANDS else f"{first} {second}"
        given = re.findall(r"--[\w-]+", line)
        wrong += [word for word in given if word not in options(command)] if command in COMMANDS else [command]
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    wrong += [target for target in re.findall(r"^make ([a-z]+)", text, re.MULTILINE) if target not in targets]
    scripts = re.findall(r"python ([a-z]+/\w+\.py)", text)
    return wrong + [script for script in scripts if not (ROOT / script).exists()]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_are_there(page: Path) -> None:
    code = [token.content for token in tokens(page) if token.type in {"fence", "code_block", "code_inline"}]
    assert [wrong for text in code for wrong in unknown_words(text)] == []


def test_a_command_that_is_not_there_is_caught() -> None:
    there = ".venv/bin/bayesgrasp data inspect out --no-verify\nmake test\nhead$ bayesgrasp plan \\\n --depth d.png #"
    assert unknown_words(there) == []
    gone = "bayesgrasp dance\nbayesgrasp plan --deep d.png\nmake tea\npython examples/nowhere.py"
    assert unknown_words(gone) == ["dance ", "--deep", "tea", "examples/nowhere.py"]


def test_set_up_is_for_pages_that_are_there() -> None:
    assert set(map(name, PAGES)) >= SET_UP.keys()


def test_the_changelog_and_the_citation_name_this_version() -> None:
    changes, citation = ((ROOT / file).read_text() for file in ("CHANGELOG.md", "CITATION.cff"))
    first = re.search(r"^## \[(?P<version>[\d.]+)\] - (?P<date>[\d-]+)$", changes, re.MULTILINE)
    assert first is not None
    assert first["version"] == __version__
    assert f"version: {__version__}\ndate-released: {first['date']}\n" in citation


def test_dead_links_are_caught(tmp_path: Path) -> None:
    page = ROOT / "README.md"
    assert broken(page, "docs/nowhere.md")
    assert broken(page, "docs/index.md#nowhere")
    assert broken(page, "../shared")
    assert not broken(page, "docs/conventions.md#frames")
    assert not broken(page, "https://example.org/anything")


def test_every_page_can_be_reached_from_the_readme() -> None:
    seen: set[Path] = set()
    queue = [ROOT / "README.md"]
    while queue:
        page = queue.pop()
        if page in seen or page.suffix != ".md":
            continue
        seen.add(page)
        links = [str(t.attrGet("href")) for t in tokens(page) if t.type == "link_open"]
        paths = [link.partition("#")[0] for link in links if not re.match(r"[a-z]+:", link)]
        queue += [(page.parent / path).resolve() for path in paths if path]
    assert seen >= {page for page in PAGES if page.is_relative_to(ROOT / "docs")}
