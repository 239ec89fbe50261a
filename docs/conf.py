"""Settings of Sphinx for the site: `make site` builds it into `build/site`.

Sphinx reads the Markdown pages where they lie: those at the root of the project and those in
`docs/`. The tables of `docs/README.md` are the navigation: a page that is in none of them is an
error. Pages need no network when they are read.
"""

import re
import sys
from contextlib import redirect_stdout
from importlib import import_module
from importlib.metadata import version as version_of
from io import StringIO
from pathlib import Path
from posixpath import dirname, join, normpath

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.util.osutil import relative_uri

from innerattn.cli.main import main
from innerattn.zoo import zoo_names

DOCS = Path(__file__).parent
ROOT = DOCS.parent
WORKED = [file.stem for file in sorted((ROOT / "examples" / "scenarios").glob("*.toml"))]
sys.path.insert(0, str(DOCS))

project = "innerattn"
author = "the innerattn developers"
project_copyright = "the innerattn developers, MIT licence"
version = release = version_of("innerattn")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "reference_directives",
]
root_doc = "README"
include_patterns = ["*.md", "docs/*.md", "docs/**/*.md"]
exclude_patterns = [".venv", "target", "build", "runs", "studies", "**/__pycache__"]
show_warning_types = True

myst_heading_anchors = 4
highlight_language = "none"

default_role = "literal"
smartquotes = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"innerattn {version}"
html_show_search_summary = False  # it fetches pages, which browsers refuse for files
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True, "source_view_link": ""}
html_static_path = ["site.css"]
html_css_files = ["site.css"]


def navigation(text: str) -> str:
    """Hidden lists of pages, one for each headed table of `docs/README.md`."""
    lists = ["```{toctree}\n:hidden:\n\n/docs/README\n```"]
    for heading, part in re.findall(r"(?ms)^\*\*(.+?)\*\*(.*?)(?=^\*\*|\Z)", text):
        pages = [
            (DOCS / link).resolve().relative_to(ROOT).with_suffix("").as_posix()
            for link in re.findall(r"(?m)\]\(([^)#]+\.md)\)", part)
        ]
        lines = [":hidden:", f":caption: {heading}", "", *(f"/{page}" for page in pages)]
        lists.append("\n".join(["```{toctree}", *lines, "```"]))
    return "\n\n".join(lists)


def add_navigation(app: Sphinx, name: str, source: list[str]) -> None:
    """Put the navigation at the end of the first page."""
    if name.startswith("docs/tables/"):  # parts of pages that link to them
        source[0] = "---\norphan: true\n---\n" + source[0]
    if name == root_doc:
        source[0] += "\n\n" + navigation((DOCS / "README.md").read_text("utf-8"))
        app.env.note_dependency(str(DOCS / "README.md"))


def link_teams(_: Sphinx, name: str, source: list[str]) -> None:
    """Say where the site has a team to play with: Markdown that is read elsewhere has none."""
    if name == root_doc:
        text = '<a href="play/mixed.html">Play with a trained team in this browser</a>: move, push'
        text += " and break its robots.\n\n"
        source[0] = source[0].replace("## Two commands", f"{text}## Two commands", 1)
    elif name == "docs/zoo":
        for team in zoo_names():
            to = f'<a href="../play/{team}.html">play in this browser</a>'
            source[0] = source[0].replace(f"| `zoo:{team}` |", f"| `zoo:{team}`, {to} |", 1)
    elif name == "docs/scenario":
        teams = [team for team in WORKED if team in zoo_names()]
        links = ", ".join(f'<a href="../play/{team}.html">{team}</a>' for team in teams)
        sentence = "`innerattn play zoo:NAME` plays each"
        here = f"Play with them in this browser: {links}. {sentence}"
        source[0] = source[0].replace(sentence, here, 1)


def write_teams(app: Sphinx, failure: Exception | None) -> None:
    """A page for each team of the package, to play with, in the folder `play`."""
    if failure is None and app.builder.format == "html":
        folder = Path(app.outdir) / "play"
        folder.mkdir(exist_ok=True)
        for team in zoo_names():
            with redirect_stdout(StringIO()):
                main(["page", f"zoo:{team}", "-o", str(folder / f"{team}.html")])


def pages_of_the_program(*_: object) -> list[str]:
    """Pages that change with the program, which are made anew each time."""
    return ["docs/reference/commands", "docs/reference/keys"]


def write_start(app: Sphinx, failure: Exception | None) -> None:
    """The page that a browser opens first leads to the first page."""
    if failure is None and app.builder.format == "html":
        to = f"{root_doc}.html"
        text = '<!doctype html><meta charset="utf-8"><title>innerattn</title>\n'
        text += f'<meta http-equiv="refresh" content="0; url={to}"><a href="{to}">innerattn</a>\n'
        (Path(app.outdir) / "index.html").write_text(text, "utf-8")


def load_lazy_names(_: Sphinx, __: str, source: list[str]) -> None:
    """Names that are imported when they are asked for are there before autodoc looks."""
    for module in map(import_module, re.findall(r"automodule:: (\S+)", source[0])):
        for one in getattr(module, "__all__", ()):
            setattr(module, one, getattr(module, one))


def name_pages_by_title(app: Sphinx, tree: nodes.document, name: str) -> None:
    """A link that shows the name of a page's file shows the page's title instead."""
    for link in tree.findall(nodes.reference):
        to = link.get("refuri", "").partition("#")[0]
        if link.get("internal") and re.fullmatch(r"[\w./-]+\.md", link.astext()):
            page = normpath(join(dirname(name), to.removesuffix(".html")))
            link.children = [nodes.Text(app.env.titles[page].astext())]


def open_images(app: Sphinx, tree: nodes.document, name: str) -> None:
    """A click on a picture shows it in its own size."""
    for image in list(tree.findall(nodes.image)):
        if image["uri"] in app.env.images:
            folder = relative_uri(app.builder.get_target_uri(name), "_images")
            file = f"{folder}/{app.env.images[image['uri']][1]}"
            image.replace_self(nodes.reference("", "", image.deepcopy(), refuri=file))


def setup(app: Sphinx) -> None:
    """Connect the functions above."""
    app.connect("doctree-resolved", name_pages_by_title)
    app.connect("doctree-resolved", open_images)
    app.connect("env-get-outdated", pages_of_the_program)
    app.connect("source-read", load_lazy_names)
    app.add_lexer("mermaid", TextLexer)
    app.connect("source-read", add_navigation)
    app.connect("source-read", link_teams)
    app.connect("build-finished", write_start)
    app.connect("build-finished", write_teams)
