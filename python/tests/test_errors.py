"""Errors are also built-in exceptions; progress=True shows bars or lines."""

import os
import pickle
import sys

import pytest
import voxdag


@pytest.mark.parametrize(
    "code, message, builtin",
    [
        ("invalid_input", "x", ValueError),
        ("limit", "x", ValueError),
        ("not_found", "x", FileNotFoundError),
        ("io", "open x: Permission denied", PermissionError),
        ("io", "read x: Input/output error", OSError),
        ("no_space", "x", OSError),
        ("out_of_memory", "x", MemoryError),
        ("device", "x", RuntimeError),
        ("corrupt", "x", Exception),
    ],
)
def test_types(code, message, builtin):
    error = voxdag.Error(message, code)
    for each in (error, pickle.loads(pickle.dumps(error))):
        assert isinstance(each, builtin) and isinstance(each, voxdag.Error)
        assert (str(each), each.code) == (message, code)
    assert isinstance(error, PermissionError) == (builtin is PermissionError)


def test_calls_raise_them(path, tmp_path):
    with pytest.raises(FileNotFoundError):
        voxdag.open(tmp_path / "x.vdag")
    with pytest.raises(ValueError, match="resolution"):
        voxdag.build("x.glb", resolution=7, output=tmp_path / "x.vdag")
    with pytest.raises(MemoryError):
        voxdag.render(path, size=(16384, 16384), memory="1GiB")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_permission(path, tmp_path):
    (tmp_path / "x.vdag").write_bytes(path.read_bytes())
    (tmp_path / "x.vdag").chmod(0)
    with pytest.raises(PermissionError):
        voxdag.open(tmp_path / "x.vdag")


def test_progress_as_text(mesh, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    voxdag.build(mesh, resolution=256, output=tmp_path / "x.vdag", progress=True)
    lines = capsys.readouterr().err.splitlines()
    assert lines and all(line.startswith("voxdag: ") for line in lines)


def test_progress_with_tqdm(path, monkeypatch):
    bars = []

    class Tqdm:
        def __init__(self, desc, unit, unit_scale):
            self.desc, self.total, self.n, self.is_open = desc, None, 0, True
            bars.append(self)

        def refresh(self):
            pass

        def close(self):
            self.is_open = False

    class Module:
        tqdm = Tqdm

    monkeypatch.setitem(sys.modules, "tqdm.auto", Module)
    voxdag.render(path, size=(200, 100), progress=True)
    assert bars and not any(bar.is_open for bar in bars)
    voxdag.render(path, size=(8, 8), progress=False)
