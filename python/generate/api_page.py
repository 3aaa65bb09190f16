#!/usr/bin/env python3
"""Writes docs/python/api.md from the docstrings of the Python package.

    python/generate/api_page.py            writes the page
    python/generate/api_page.py --check    fails if the page is not up to date

Reads the sources without importing them, so the package need not be built.
"""

import ast
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python" / "voxdag"
PAGE = ROOT / "docs" / "python" / "api.md"
WIDTH = 150
TITLE = """# Python: all public names

`python/generate/api_page.py` makes this page from the docstrings. [python.md](../python.md) is an
introduction.
"""
GENERATED = (
    "The type of the report of `build()`, a `TypedDict`. "
    "[cli.md](../cli.md#the-report-of-a-build) explains its members."
)
# Base classes whose members are documented with the class that inherits them.
MEMBERS_OF = {"Dag": ["DagFile"]}
_TABLE = "[cli.md](../cli.md#options-of-build-and-plan)"
OPTIONS_TEXT = {
    "BuildOptions": f"`options` are the geometry and run options in {_TABLE}, with `_` in place of "
    "`-`.",
    "VoxelOptions": f"`options` are two kinds of options in {_TABLE}: the run options except "
    "`allow_empty`, and the geometry options `hash_bits`, `order`, `attributes` and "
    "`color_resolution`. The names have `_` in place of `-`.",
}
# The parameter of a function for keyword options, such as **options: Unpack[BuildOptions].
OPTIONS = re.compile(r"\*\*(\w+): Unpack\[(\w+)\]")


class Module:
    """The definitions and the comments of one source file."""

    def __init__(self, name):
        self.text = (PACKAGE / f"{name}.py").read_text(encoding="utf-8")
        self.tree = ast.parse(self.text)
        self.lines = self.text.splitlines()

    def find(self, name):
        for node in self.tree.body:
            if getattr(node, "name", None) == name or _is_assignment(node, name):
                return node
        raise SystemExit(
            f"python/generate/api_page.py: {name} is not defined where __init__.py imports it"
        )

    def comment_above(self, node):
        first = node.lineno - 1
        while self.lines[first - 1].startswith("# "):
            first -= 1
        return " ".join(line[2:] for line in self.lines[first : node.lineno - 1])

    def comment_beside(self, node):
        return self.lines[node.end_lineno - 1].partition("  # ")[2]


def _is_assignment(node, name):
    return isinstance(node, ast.Assign) and getattr(node.targets[0], "id", None) == name


def public_names():
    """Returns the module of each public name, in the order of the imports."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    names = {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            names.update({alias.name: node.module for alias in node.names})
    return names


def signature(function):
    """Returns the parameters of a function without `self`, and its result."""
    arguments = function.args
    given = [a for a in arguments.args if a.arg not in ("self", "cls")]
    defaults = [None] * (len(given) - len(arguments.defaults)) + arguments.defaults
    parts = [_parameter(a, d) for a, d in zip(given, defaults)]
    if arguments.kwonlyargs:
        parts.append("*")
    parts += [_parameter(a, d) for a, d in zip(arguments.kwonlyargs, arguments.kw_defaults)]
    if arguments.kwarg:
        parts.append(f"**{arguments.kwarg.arg}")
    return ", ".join(parts)


def _parameter(argument, default):
    return argument.arg + ("" if default is None else "=" + ast.unparse(default).replace("'", '"'))


def prose(docstring):
    """Converts a docstring to Markdown. Aligned lists of arguments become lists."""
    blocks = re.split(r"\n\s*\n", textwrap.dedent(docstring or "").strip())
    return "\n\n".join(_block(block) for block in blocks if not block.startswith("    "))


def _block(block):
    items, current = [], []
    for line in block.splitlines():
        start = re.match(r"(\w[\w, ]*?) {2,}(\S.*)", line)
        if start:
            items.append([start[1], [start[2]]])
        elif items and line.startswith("   "):
            items[-1][1].append(line.strip())
        else:
            current.append(line)
    if not items or current:
        return wrapped(" ".join(block.split()))
    return "\n".join(
        wrapped(f"- {', '.join(f'`{n}`' for n in names.split(', '))}: {' '.join(text)}", "  ")
        for names, text in items
    )


def wrapped(text, indent=""):
    return "\n".join(
        textwrap.wrap(
            text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
    )


def documented(text):
    """Completes the docstring of a function: the options of build() are in another page."""
    text = re.sub(r"\n *Further\s+options:\s*$", "", text or "")
    return re.sub(r"Further\s+options:\s*$", "", text.rstrip())


def function_page(function, level="##"):
    text = prose(documented(ast.get_docstring(function, clean=True)))
    options = OPTIONS.search(ast.unparse(function.args))
    if options and options[2] in OPTIONS_TEXT:
        text += f"\n\n{wrapped(OPTIONS_TEXT[options[2]])}"
    return f"{level} {function.name}({signature(function)})\n\n{text}\n"


def class_page(module_name, node):
    module = Module(module_name)
    parts = [f"## class {node.name}\n\n{prose(ast.get_docstring(node))}\n"]
    fields = [n for n in node.body if isinstance(n, ast.AnnAssign) and n.simple]
    if fields and not any(f"{f.target.id}  " in (ast.get_docstring(node) or "") for f in fields):
        parts.append("\n".join(_field(module, field) for field in fields) + "\n")
    bodies = [node.body]
    for base in MEMBERS_OF.get(node.name, []):
        bodies.insert(0, Module("_file").find(base).body)
    seen = set()
    for member in (m for body in bodies for m in body if isinstance(m, ast.FunctionDef)):
        is_overload = any("overload" in ast.unparse(d) for d in member.decorator_list)
        if member.name.startswith("_") or is_overload or member.name in seen:
            continue
        seen.add(member.name)
        if any(ast.unparse(d) == "property" for d in member.decorator_list):
            parts.append(f"### {node.name}.{member.name}\n\n{prose(ast.get_docstring(member))}\n")
        else:
            parts.append(function_page(member, f"### {node.name}.").replace(". ", ".", 1))
    return "\n".join(parts)


def _field(module, field):
    comment = module.comment_beside(field)
    kind = ast.unparse(field.annotation)
    return f"- `{field.target.id}`: `{kind}`" + (f", {comment}" if comment else "")


def section(name, module_name):
    if not (PACKAGE / f"{module_name}.py").exists():
        return f"## {name}\n\n{wrapped(GENERATED)}\n"
    module = Module(module_name)
    node = module.find(name)
    if isinstance(node, ast.FunctionDef):
        return function_page(node)
    if isinstance(node, ast.ClassDef):
        return class_page(module_name, node)
    return f"## {name}\n\n{wrapped(module.comment_above(node))}\n"


def main():
    text = TITLE + "".join(f"\n{section(name, module)}" for name, module in public_names().items())
    if "--check" not in sys.argv:
        PAGE.write_text(text, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != text:
        sys.exit("docs/python/api.md is not up to date: run python/generate/api_page.py")


if __name__ == "__main__":
    main()
