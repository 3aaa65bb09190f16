"""Runs the examples of docs/python/interop.md whose libraries are installed, and compares the page
of all names with the package."""

import importlib
import re
from pathlib import Path

import pytest
import voxdag

DOCS = Path(__file__).parents[2] / "docs" / "python"
PAGE = (DOCS / "interop.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"^## (.*?)\n\n```python\n(.*?)```", PAGE, re.DOTALL | re.MULTILINE))


def libraries(example):
    """Returns the names of the modules that the import statements name."""
    names = re.findall(r"^(?:import|from) (.*)$", example, re.MULTILINE)
    return {word.split()[0].split(".")[0] for line in names for word in line.split(",")}


@pytest.mark.parametrize("library", EXAMPLES)
def test_example(library, tmp_path, monkeypatch):
    for name in libraries(EXAMPLES[library]):
        try:
            importlib.import_module(name)
        except ImportError as error:
            pytest.skip(f"{name} cannot be imported: {error}")
    monkeypatch.chdir(tmp_path)
    exec(compile(EXAMPLES[library], f"interop.md, {library}", "exec"), {})


def test_every_library_has_an_example():
    assert list(EXAMPLES) == ["trimesh", "Open3D", "PyVista", "meshio", "OctoMap", "PyTorch"]


def test_all_names_are_documented():
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (?:class )?(\w+)", page, re.MULTILINE)
    assert set(headings) == set(voxdag.__all__)
    assert all(getattr(voxdag, name).__doc__ for name in voxdag.__all__ if name.islower())
    for member in dir(voxdag.Dag):
        if not member.startswith("_"):
            assert f"### Dag.{member}" in page, member
            assert getattr(voxdag.Dag, member).__doc__, member
