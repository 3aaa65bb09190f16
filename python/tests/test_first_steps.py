"""Runs the Python program of docs/examples/first-steps.md."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "examples" / "first-steps.md"


def test_the_program_of_the_page(tmp_path, monkeypatch):
    (program,) = re.findall(
        r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(program, PAGE.name, "exec"), names)
    assert names["picture"].startswith(b"\x89PNG") and len(names["points"]) > 1000
