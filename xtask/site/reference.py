"""The reference of the Python package from its docstrings, as Markdown: `python reference.py SOURCE PAGE`."""

import pathlib
import re
import sys

import griffe
from griffe2md import render_object_docs

HEAD = """# Python

Made from the docstrings of the package. `import gpsindy` is enough for the first part.

"""
#: Modules that are imported by name, since they need packages of their own, with what a user takes from each.
BESIDE = {
    "gpsindy.mujoco": ("MuJoCo models, with `gpsindy[mujoco]`.", ["mujoco.Simulator", "mujoco.drivers.Driver", "mujoco.settings.Setting"]),
    "gpsindy.fmu": ("FMUs, with `gpsindy[fmu]`.", ["fmu.Simulator"]),
    "gpsindy.plot": ("Figures, with `gpsindy[plot]`.", ["plot.rollouts", "plot.smoothed", "plot.diagnosis"]),
}
SETTINGS = {
    # A list, not a table: it reads on a phone.
    "docstring_section_style": "list",
    "members_order": "source",
    "show_root_full_path": False,
    "show_root_members_full_path": False,
    "show_object_full_path": False,
    "show_if_no_docstring": False,
    "summary": False,
}


def page(name, thing):
    """The page's part on one name, with links to nowhere taken out."""
    text = render_object_docs(thing, SETTINGS)
    text = re.sub(r"\[([^\]\n]+)\]\(#[^)\n]*\)", r"\1", text)
    text = re.sub(r":(?:meth|class|func|attr|mod):`([^`]+)`", r"`\1`", text)
    # Two marks are one in Markdown; three are a fence.
    return re.sub(r"(?<!`)``(?!`)", "`", text).strip() + "\n"


def main():
    source, target = sys.argv[1:3]
    package = griffe.load("gpsindy", search_paths=[source], docstring_parser="numpy", resolve_aliases=True)
    parts = []
    for name in sorted((getattr(entry, "name", entry) for entry in package.exports), key=str.lower):
        thing = package[name]
        thing = thing.final_target if thing.is_alias else thing
        # The compiled part has a stub without docstrings.
        if thing.is_class or thing.is_function:
            parts.append(page(name, thing))
    for module, (words, names) in BESIDE.items():
        parts.append(f"## {module}\n\n{words} `import {module}`.\n")
        # A name that is gone is an error here, so that the list can't go stale.
        for name in names:
            own = name.rpartition(".")[2]
            parts.append(page(name, package[name]).replace(f"`{own}`", f"`{module.rpartition('.')[2]}.{own}`", 1))
    pathlib.Path(target).write_text(HEAD + "\n".join(parts), encoding="utf-8")


main()
