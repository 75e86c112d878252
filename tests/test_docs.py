"""The pages hold what they promise: links lead somewhere, and Python blocks run."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

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


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_python_blocks_run(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The blocks of a page run one after the other, as a reader would, in an empty directory."""
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "__main__"}
    for token in tokens(page):
        if token.type == "fence" and token.info.strip() == "python":
            line = token.map[0] + 1 if token.map else 0
            exec(compile("\n" * line + token.content, str(page), "exec"), namespace)


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
