#!/usr/bin/env python3
"""The reader header compiles without exceptions and for Windows, and reads a file from memory.

    portable_test.py VOXDAG INCLUDE_FOLDER COMPILER

Compiles count_voxels.cc with COMPILER, and with mingw-w64 if it is installed. Runs both programs on
a generated scene; the Windows program needs wine.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

MINGW = "x86_64-w64-mingw32-g++"
FLAGS = "-std=c++17 -O0 -fno-exceptions -fno-rtti -Wall -Wextra -Wshadow -Wconversion -Werror"


def run(*command, status=0):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == status, f"{command}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def check(program, folder, voxels):
    damaged = folder / "damaged.vdag"
    damaged.write_bytes((folder / "a.vdag").read_bytes()[:5000])
    assert run(*program, folder / "a.vdag").split() == [str(voxels), str(voxels), "0"]
    message = run(*program, damaged, status=3)
    assert message.startswith("problem 2: packed.vdag: "), message


def main():
    voxdag, include, compiler = sys.argv[1:]
    source = Path(__file__).parent / "count_voxels.cc"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(voxdag, "generate", "menger", folder / "a.glb", "--level", "1")
        run(voxdag, "build", folder / "a.glb", "-r", "32", "--color", "-o", folder / "a.vdag")
        voxels = json.loads(run(voxdag, "info", folder / "a.vdag", "--json"))["voxels"]
        flags = [*FLAGS.split(), f"-I{include}", source, "-o"]
        run(compiler, *flags, folder / "count_voxels")
        check([folder / "count_voxels"], folder, voxels)
        if not shutil.which(MINGW):
            print(f"there is no {MINGW} (g++-mingw-w64-x86-64) to compile for Windows")
            return 0
        run(MINGW, *flags, folder / "count_voxels.exe", "-static")
        wine = shutil.which("wine") or shutil.which("wine64")
        if wine:
            check([wine, folder / "count_voxels.exe"], folder, voxels)
        else:
            print("compiled for Windows; there is no wine to run the program")
    return 0


if __name__ == "__main__":
    sys.exit(main())
