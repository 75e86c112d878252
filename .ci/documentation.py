"""What the site has beside `docs/`: a reference page for each room, and files elsewhere that pages link to.

MkDocs calls these functions (`hooks` in `mkdocs.yml`). Pages link as GitHub wants it, `../results/plan.json`; in the
site such a file lies beside the pages.
"""

import ast
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bayesgrasp"
OUTSIDE = re.compile(r"\]\(\.\./([^)#]+)")
"""A link from a page of `docs/` to a file that is not there."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the reference at the end of the navigation."""
    config.nav = [*(config.nav or []), {"Reference": [{name: _page(name)} for name in _rooms()]}]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the reference, and the files that pages link to."""
    for name, modules in _rooms().items():
        files.append(File.generated(config, _page(name), content=_reference(name, modules)))
    linked = {link for page in (ROOT / "docs").glob("*.md") for link in OUTSIDE.findall(page.read_text("utf-8"))}
    for link in sorted(linked):
        if link.endswith(".md"):
            text = (ROOT / link).read_text("utf-8").replace("](docs/", "](")
            files.append(File.generated(config, link, content=text))
        else:
            files.append(File.generated(config, link, abs_src_path=str(ROOT / link)))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Point links at where the files lie in the site."""
    return OUTSIDE.sub(r"](\1", markdown)


def _page(room: str) -> str:
    return f"reference/{room}.md"


def _rooms() -> dict[str, list[str]]:
    """Dotted names of modules by room; what is in no room first."""
    rooms: dict[str, list[str]] = {"bayesgrasp": ["bayesgrasp"]}
    for path in sorted(PACKAGE.rglob("*.py")):
        inner = path.relative_to(PACKAGE).with_suffix("").parts
        if inner[-1] not in {"__init__", "__main__"}:
            rooms.setdefault(inner[0] if len(inner) > 1 else "bayesgrasp", []).append(".".join(("bayesgrasp", *inner)))
    return rooms


def _reference(room: str, modules: list[str]) -> str:
    title = "bayesgrasp" if room == "bayesgrasp" else f"bayesgrasp.{room}"
    init = PACKAGE / "__init__.py" if room == "bayesgrasp" else PACKAGE / room / "__init__.py"
    about = ast.get_docstring(ast.parse(init.read_text("utf-8"))) or ""
    return "\n\n".join((f"# {title}", about, *(f"::: {module}" for module in modules))) + "\n"
