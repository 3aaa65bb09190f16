"""Runs the commands and the C++ program of docs/examples/first-steps.md, in their order.

    first_steps_test.py VOXDAG CXX

A test of the Python package runs the Python program of the page.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "browser"))

from programs import Server  # noqa: E402

PAGE = (ROOT / "docs" / "examples" / "first-steps.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def run(command, **options):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def run_shell(commands, environment):
    run(["bash", "-euo", "pipefail", "-c", commands], env=environment)


def run_cpp(program, compiler):
    Path("engine.cc").write_text(program, encoding="utf-8")
    run([compiler, "-std=c++17", "-I", ROOT / "core/format/global", "engine.cc", "-o", "engine"])
    assert run(["./engine", "scene-256.vdag"]) == "hole 0, corner 1\n"


def check_results():
    lines = Path("scene.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 4 and lines[0].startswith("file,"), lines
    assert Path("scene.png").read_bytes().startswith(b"\x89PNG")
    manifest = json.loads(Path("chunks/manifest.json").read_text(encoding="utf-8"))
    assert [len(level["chunks"]) > 1 for level in manifest["levels"]] == [True, True]
    assert json.loads(Path("report.json").read_text(encoding="utf-8"))["state"] == "succeeded"
    for name in "scene256.basic_dag.dag.bin", "collision.glb", "result.ply":
        assert Path(name).stat().st_size > 1000, name


def main():
    voxdag, compiler = sys.argv[1:]
    with tempfile.TemporaryDirectory(prefix="first-steps-") as name:
        os.chdir(name)
        Path("bin").mkdir()
        Path("bin/voxdag").symlink_to(voxdag)
        command = [voxdag, "serve", "--port", 0, "--data", "data"]
        with Server(command, Path(name), "serve") as server:
            environment = os.environ | {
                "PATH": f"{name}/bin:{os.environ['PATH']}",
                "SERVER": server.url,
            }
            for language, text in BLOCKS:
                if language == "sh":
                    run_shell(text, environment)
                elif language == "cpp":
                    run_cpp(text, compiler)
        check_results()
    assert sorted({language for language, _ in BLOCKS}) == ["cpp", "python", "sh"]
    return 0


if __name__ == "__main__":
    sys.exit(main())
