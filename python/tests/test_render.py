"""Pictures from Python; what they show is tested in C++."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import voxdag


def shown(picture):
    """The part of the picture that is not the background, which each row begins with."""
    return (np.abs(picture.astype(int) - picture[:, :1].astype(int)).max(axis=2) > 24).mean()


def test_a_picture_shows_the_mesh(path):
    picture = voxdag.render(path, view="top", size=(96, 64), samples=1)
    assert picture.shape == (64, 96, 3) and picture.dtype == np.uint8
    assert 0.1 < shown(picture) < 0.9
    assert np.array_equal(picture, voxdag.render(path, view="top", size=(96, 64), samples=1, threads=3))


def test_a_camera_is_placed_in_scene_units(path):
    def picture(distance):
        return voxdag.render(path, camera=(0.01, 0, distance), target=[0, 0, 0], fov=40, size=(48, 48), samples=1)

    assert shown(picture(16)) > 2 * shown(picture(40)) > 0


@pytest.mark.parametrize("options, code", [
    ({"view": "behind"}, "invalid_input"),
    ({"size": (0, 10)}, "invalid_input"),
    ({"size": (10, 16385)}, "invalid_input"),
    ({"camera": (1, 2, 3)}, "invalid_input"),
    ({"camera": (1, 2), "target": (0, 0, 0)}, "invalid_input"),
    ({"camera": (1, 2, float("nan")), "target": (0, 0, 0)}, "invalid_input"),
    ({"camera": (1, 2, 3), "target": (1, 2, 3)}, "invalid_input"),
    ({"camera": (1, 2, 3), "target": (0, 0, 0), "view": "top"}, "invalid_input"),
    ({"fov": 171}, "invalid_input"),
    ({"samples": 9}, "invalid_input"),
])
def test_refuses(path, options, code):
    with pytest.raises(voxdag.Error) as refused:
        voxdag.render(path, **{"size": (8, 8), **options})
    assert refused.value.code == code, refused.value


def test_a_file_that_is_not_there(path):
    with pytest.raises(voxdag.Error) as refused:
        voxdag.render(str(path) + "x", size=(8, 8))
    assert refused.value.code == "not_found"


def test_progress_stops_it(path):
    def stop(*_):
        raise RuntimeError("enough")
    with pytest.raises(RuntimeError):
        voxdag.render(path, size=(1000, 1000), samples=4, progress=stop)


def test_the_example_of_the_docs(tmp_path):
    """From a mesh to a picture, as docs/python.md says it, in six lines."""
    text = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    assert len([line for line in example.splitlines() if line.strip()]) <= 6
    subprocess.run([sys.executable, "-c", example], cwd=tmp_path, check=True,
                   env={**os.environ, "MPLBACKEND": "Agg"})
    assert (tmp_path / "scene.png").read_bytes().startswith(b"\x89PNG")
