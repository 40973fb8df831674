"""What the site adds to the pages of docs/: two pages of reference, and formulas as MathML, which browsers draw themselves."""

from __future__ import annotations

import html
import re
import unicodedata
from pathlib import Path
from typing import Any

import typer
from latex2mathml.converter import convert
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
STUB = ROOT / "src" / "topobelief" / "__init__.pyi"

# headings of the page on Python, each with the rooms whose public names stand below it
ROOMS = {
    "Graphs": ("graph", "estimation"),
    "Files": ("io", "conversions"),
    "Worlds, roadmaps and candidates": ("world", "candidates"),
    "Searching a roadmap": ("search",),
    "Deciding among candidates": ("planning", "bounds"),
    "Signatures": ("signatures",),
    "Entropy, errors and measurements": ("entropy", "position_errors", "measurement_selection"),
    "Pictures and progress": ("report",),
    "Errors and version": ("errors", "version"),
}


def public_names() -> list[tuple[str, str]]:
    """Each public name with its module, in the order of the stub."""
    return [(name, module) for module, name in re.findall(r"^from \.([\w.]+) import (\w+) as", STUB.read_text(), re.MULTILINE)]


def python_page() -> str:
    """The page on Python, whose entries mkdocstrings fills from docstrings."""
    below = {
        heading: [pair for pair in public_names() if pair[1].partition(".")[0] in rooms] for heading, rooms in ROOMS.items()
    }
    missing = {name for name, _ in public_names()} - {name for pairs in below.values() for name, _ in pairs}
    if missing:
        raise ValueError(f"expected a heading for each public name, got none for {', '.join(sorted(missing))}; see ROOMS")
    lines = [
        "# Python",
        "",
        "Every public name of `import topobelief as tb`, by what it is for."
        " Units, frames and the order of tangents are those of the [conventions](conventions.md).",
        "",
    ]
    for heading, pairs in below.items():
        lines += [f"## {heading}", ""]
        for name, module in pairs:
            lines += [f"::: topobelief.{module}.{name}", "    options:", f"      heading: {name}"]
            lines += ["      show_if_no_docstring: true"] * name.startswith("__") + [""]
    return "\n".join(lines)


def command_line_page() -> str:
    """The page on the command line, from what `--help` says."""
    from topobelief.cli.app import app

    group: Any = typer.main.get_command(app)
    lines = [
        "# Command line",
        "",
        "What `topobelief COMMAND --help` prints, for all commands."
        " Bad input gives one line on the standard error and exit code 2; see [errors](conventions.md#errors-and-exit-codes).",
        "",
    ]
    for name, command in group.commands.items():
        context = typer.Context(command, info_name=f"topobelief {name}")
        lines += [f"## topobelief {name}", "", *paragraphs(command.help), ""]
        lines += [f"    topobelief {name} {' '.join(command.collect_usage_pieces(context))}", ""]
        panels: dict[str, list[Any]] = {}
        for parameter in command.get_params(context):
            kind = "Arguments" if parameter.param_type_name == "argument" else "Options"
            panels.setdefault(getattr(parameter, "rich_help_panel", None) or kind, []).append(
                parameter.get_help_record(context)
            )
        for panel, records in panels.items():
            lines += [f"**{plain(panel)}**", "", "| | |", "|---|---|"]
            lines += [f"| <code>{plain(record[0])}</code> | {described(record[1])} |" for record in records if record]
            lines.append("")
    return "\n".join(lines)


def paragraphs(text: str | None) -> list[str]:
    return [f"{plain(paragraph)}\n" for paragraph in (text or "").split("\n\n")]


def described(text: str) -> str:
    """The text of an option, with its default and range set apart."""
    said, bracket, facts = text.partition("  [")
    return f"{plain(said)} *[{plain(facts)}*" if bracket else plain(said)


def plain(text: str) -> str:
    """Text for a cell of a table or a paragraph: on one line, without what Markdown or HTML would take for its own."""
    return html.escape(" ".join(text.split()), quote=False).replace("|", "&#124;").replace("*", "&#42;").replace("_", "&#95;")


@event_priority(-200)  # after the plugin named offline, which would fetch this script from elsewhere
def on_config(config: Any) -> Any:
    config.extra["polyfills"] = ["site/file_worker.js"]
    return config


def on_files(files: Files, config: Any) -> Files:
    files.append(File.generated(config, "api.md", content=python_page()))
    files.append(File.generated(config, "command_line.md", content=command_line_page()))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Blocks of mathematics as code hosts write them, in the form that Arithmatex reads."""
    return re.sub(r"^```math\n(.*?)\n```$", r"\n$$\n\1\n$$\n", markdown, flags=re.DOTALL | re.MULTILINE)


def on_page_content(content: str, **_: Any) -> str:
    """Arithmatex leaves formulas as TeX; here they become MathML, so that no script has to."""
    content = re.sub(
        r'<div class="arithmatex">\\\[(.*?)\\\]</div>', lambda found: displayed(found[1]), content, flags=re.DOTALL
    )
    return re.sub(
        r'<span class="arithmatex">\\\((.*?)\\\)</span>', lambda found: formula(found[1], "inline"), content, flags=re.DOTALL
    )


def displayed(tex: str) -> str:
    """A formula on lines of its own, and its number at the right."""
    number = re.search(r"\\tag\{([^}]*)\}", tex)
    drawn = formula(re.sub(r"\\tag\{[^}]*\}", "", tex), "block")
    return f'<div class="formula">{drawn}{f"<span>({number[1]})</span>" if number else ""}</div>'


def formula(tex: str, display: str) -> str:
    """MathML of a formula, with what the converter leaves out: aligned lines, relations with space, norms of one height."""
    source = html.unescape(tex).strip().replace("{aligned}", "{align*}").replace(r"\arg", r"\operatorname{arg}")
    drawn = convert(source, display=display)
    drawn = re.sub(r"<mi>(&#x\w+;)</mi>", lambda found: relation(found[1]), drawn)
    drawn = re.sub(
        r"<(m[io])(?: movablelimits=\"true\")?>([A-Za-z]{2,})</\1>", r'<mo lspace="0.15em" rspace="0.1em">\2</mo>', drawn
    )
    bar = r'<mo stretchy="false" lspace="0" rspace="0">\1</mo>'
    return re.sub(r'<mo(?: stretchy="false")?>(&#x0(?:2016|007C);)</mo>', bar, drawn)


def relation(entity: str) -> str:
    """A mathematical sign as an operator; Greek letters and the like stay names."""
    sign = html.unescape(entity).replace("~", "\u223c")
    return (
        f"<mo>{sign}</mo>" if unicodedata.category(sign) == "Sm" and sign not in "\u2202\u2207\u221e" else f"<mi>{entity}</mi>"
    )
