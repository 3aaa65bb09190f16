"""A small scene that all tests share, and a function that interrupts a program."""

import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import voxdag


def torus(around=48, across=24, big=3.0, small=1.25):
    """Returns the vertices (N, 3) and triangles (M, 3) of a torus. `around` and `across` are
    numbers of vertices; `big` is the radius of the ring, `small` the radius of the tube."""
    u, v = np.meshgrid(
        np.arange(around) * 2 * np.pi / around,
        np.arange(across) * 2 * np.pi / across,
        indexing="ij",
    )
    ring = big + small * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), small * np.sin(v)], axis=-1)
    a = np.arange(around)[:, None] * across + np.arange(across)
    b = np.roll(a, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return vertices.reshape(-1, 3), triangles


def interrupted(lines):
    """Runs a Python program of these lines, and sends Ctrl-C after the first line of its output.
    Fails unless Ctrl-C ends the program. Returns the output after the first line. The program can
    use the module voxdag, and the function say() as a `progress` that prints a line."""
    program = textwrap.dedent(f"""
        import sys
        sys.path[:0] = {sys.path!r}
        import voxdag
        say = lambda *status: print(*status, flush=True)
    """) + textwrap.dedent(lines)
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    output, messages = process.communicate(timeout=60)
    assert process.returncode != 0 and "KeyboardInterrupt" in messages, messages
    return output


@pytest.fixture(scope="session")
def mesh():
    return torus()


@pytest.fixture(scope="session")
def path(mesh, tmp_path_factory):
    output = tmp_path_factory.mktemp("dag") / "torus.vdag"
    voxdag.build(mesh, resolution=64, output=output, memory="64MiB")
    return output


@pytest.fixture()
def dag(path):
    with voxdag.open(path) as opened:
        yield opened


@pytest.fixture(scope="session")
def cells(path):
    """Returns whether each voxel of the file is set, (64, 64, 64) bool, found by lookup()."""
    with voxdag.open(path) as opened:
        grid = np.stack(np.meshgrid(*[np.arange(64)] * 3, indexing="ij"), axis=-1)
        return opened.lookup(grid.reshape(-1, 3)).reshape(64, 64, 64)
