"""Extension of Sphinx: help of the commands, figures for the gallery, and what must be there before a build."""

import html
import os
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from matplotlib.figure import Figure
from sphinx.util.docutils import SphinxDirective
from sphinx_gallery.scrapers import figure_rst

import ringsweep
from ringsweep import cli
from ringsweep.cli.parser import build_parser

sys.path.insert(0, str(Path(__file__).parents[1]))
from benchmarks._common import sources

GALLERY = Path(__file__).parent / "gallery"


class CommandHelp(SphinxDirective):
    """The help of every command, each in a section of its own."""

    def run(self) -> list[Any]:
        os.environ["COLUMNS"] = "100"
        (commands,) = (action for action in build_parser()._actions if isinstance(action.choices, dict))
        found = []
        for name, parser in commands.choices.items():
            section = nodes.section(ids=[name])
            section += [nodes.title(text=name), nodes.literal_block(text=parser.format_help(), language="none")]
            found.append(section)
        return found


def collect_figures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Show the figures, films and pages that a block of a gallery script made; no figure comes from pyplot."""
    names, paths = block_vars["example_globals"], []
    for name in [name for name, value in names.items() if isinstance(value, Figure)]:
        paths.append(next(block_vars["image_path_iterator"]))
        # A figure is shown once, after the block that made it.
        names.pop(name).savefig(paths[-1], dpi=140)
    for film in GALLERY.glob("*.gif"):
        paths.append(str(Path(next(block_vars["image_path_iterator"])).with_suffix(".gif")))
        film.rename(paths[-1])
    shown = figure_rst(paths, gallery_conf["src_dir"])
    for page in GALLERY.glob("*.html"):
        inside = html.escape(page.read_text(encoding="utf-8")).replace("\n", "&#10;")
        page.unlink()
        shown += f'\n\n.. raw:: html\n\n    <iframe srcdoc="{inside}" style="width: 100%; height: 50em"></iframe>\n\n'
    return shown


def mark_older_results(app: Any, document: str, source: list[str]) -> None:
    """Say at the head of a report that it is older than the sources, if it does not bear their digest."""
    if document.startswith("benchmarks/results/") and f"on sources `{sources()}`" not in source[0]:
        title, _, rest = source[0].partition("\n")
        source[0] = f"{title}\n\n```{{note}}\nThese figures were measured on older sources of the package.\n```\n{rest}"


def setup(app: Any) -> dict[str, Any]:
    """Add the directive and the notes, write the files that the gallery reads, and import all public names."""
    app.add_directive("command-help", CommandHelp)
    app.connect("source-read", mark_older_results)
    for older in GALLERY.glob("*.nc"):
        # After an edit of the sources it holds another sweep, which is not replaced.
        older.unlink()
    for model, name in (("ring", "my-sweep.yaml"), ("belt", "belt.yaml")):
        if not (path := GALLERY / name).exists():
            cli.main(["init", "-q", "--model", model, str(path)])
    for module in (ringsweep, ringsweep.plots):
        for name in module.__all__:
            # They are imported on first access, and autosummary looks into the module before.
            setattr(module, name, getattr(module, name))
    return {"parallel_read_safe": True}
