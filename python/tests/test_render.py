"""Pictures from Python. C++ tests check the pixels."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import voxdag
from conftest import interrupted


def shown(picture):
    """Returns the share of pixels that do not show the background. The first pixel of each row must
    show the background."""
    return (np.abs(picture.astype(int) - picture[:, :1].astype(int)).max(axis=2) > 24).mean()


def test_a_picture_shows_the_mesh(path):
    picture = voxdag.render(path, view="top", size=(96, 64), samples=1)
    assert picture.shape == (64, 96, 3) and picture.dtype == np.uint8
    assert 0.1 < shown(picture) < 0.9
    assert np.array_equal(
        picture, voxdag.render(path, view="top", size=(96, 64), samples=1, threads=3)
    )


def test_the_background_can_be_transparent_or_white(path):
    options = {"view": "top", "size": (48, 32), "samples": 1}
    picture = voxdag.render(path, background="transparent", **options)
    assert picture.shape == (32, 48, 4)
    assert np.all(picture[0] == 0) and picture[:, :, 3].max() == 255
    assert np.all(voxdag.render(path, background="white", **options)[0] > 250)  # a faint shadow


def test_shades_show_normals_levels_and_sharing(path):
    options = {"view": "top", "size": (48, 32), "samples": 1, "background": "transparent"}
    pictures = [
        voxdag.render(path, shade=shade, **options)
        for shade in ("color", "sharing", "level", "normal")
    ]
    for i, picture in enumerate(pictures):
        assert np.array_equal(picture[:, :, 3], pictures[0][:, :, 3])
        assert not any(np.array_equal(picture, other) for other in pictures[:i])
    up = pictures[3][pictures[3][:, :, 3] == 255][:, 1]
    assert np.median(up) > 170  # seen from above, most normals point up


def test_a_camera_is_placed_in_scene_units(path):
    def picture(distance):
        return voxdag.render(
            path, camera=(0.01, 0, distance), target=[0, 0, 0], fov=40, size=(48, 48), samples=1
        )

    assert shown(picture(16)) > 2 * shown(picture(40)) > 0


@pytest.mark.parametrize(
    "options, code",
    [
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
        ({"background": "blue"}, "invalid_input"),
        ({"shade": "blue"}, "invalid_input"),
        ({"background": ["sky"]}, "invalid_input"),
        ({"size": (-1, 10)}, "invalid_input"),
        ({"size": (2**31, 2**31)}, "invalid_input"),
        ({"size": (10**30, 1)}, "invalid_input"),
        ({"size": 640}, "invalid_input"),
        ({"size": (640, 480, 3)}, "invalid_input"),
        ({"size": (64.0, 48)}, "invalid_input"),
        ({"size": ("64", "48")}, "invalid_input"),
        ({"size": None}, "invalid_input"),
        ({"size": (16384, 16384), "memory": "1GiB"}, "out_of_memory"),
        ({"size": (2048, 1024), "memory": 100 << 20}, "out_of_memory"),
        ({"memory": "63MiB"}, "invalid_input"),
        ({"memory": "much"}, "invalid_input"),
        ({"memory": -1}, "invalid_input"),
        ({"camera": (1, 2, 3), "target": (0, 0, float("inf"))}, "invalid_input"),
        ({"camera": "above", "target": (0, 0, 0)}, "invalid_input"),
        ({"camera": ((1, 2, 3),), "target": (0, 0, 0)}, "invalid_input"),
        ({"view": 7}, "invalid_input"),
        ({"view": None}, "invalid_input"),
        ({"fov": float("nan")}, "invalid_input"),
        ({"fov": "wide"}, "invalid_input"),
        ({"samples": 2.5}, "invalid_input"),
        ({"samples": 2**40}, "invalid_input"),
        ({"gray": "no"}, "invalid_input"),
        ({"threads": -1}, "invalid_input"),
        ({"threads": "all"}, "invalid_input"),
    ],
)
def test_refuses(path, options, code):
    with pytest.raises(voxdag.Error) as refused:
        voxdag.render(path, **{"size": (8, 8), **options})
    assert refused.value.code == code, refused.value


def test_types_that_are_type_errors(path):
    for options in ({"progress": 7}, {"progress": "loud"}):
        with pytest.raises(TypeError, match="expected a function"):
            voxdag.render(path, size=(8, 8), **options)
    with pytest.raises(TypeError):
        voxdag.render(7, size=(8, 8))


def test_what_takes_too_much_memory_says_so(path):
    with pytest.raises(
        voxdag.Error,
        match=r"16384 x 16384 pixels takes 16\.5.* GiB .* at most 1.* GiB: "
        "choose a smaller size, or more with memory=",
    ):
        voxdag.render(path, size=(16384, 16384), memory="1GiB")
    # shade="sharing" needs as much memory as the nodes of the file, in addition to the pixels.
    largest = {"size": (1271, 800), "memory": "64MiB", "samples": 1}  # 64 bytes below 64 MiB
    assert voxdag.render(path, **largest).shape == (800, 1271, 3)
    with pytest.raises(voxdag.Error, match="choose a smaller size"):
        voxdag.render(path, shade="sharing", **largest)
    assert voxdag.render(
        path, size=(np.int64(32), np.int32(16)), memory="64MiB", samples=1
    ).shape == (16, 32, 3)


def test_other_threads_run_meanwhile(path):
    ended, ticks = threading.Event(), []

    def tick():
        while not ended.wait(0.002):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    voxdag.render(path, size=(240, 160), threads=1)
    end = time.monotonic()
    ended.set()
    thread.join()
    # A single tick could also happen between time.monotonic() and the call of render().
    assert len([tick for tick in ticks if begin < tick < end]) >= 3, (end - begin, len(ticks))


def test_ctrl_c(path):
    output = interrupted(f"""
        voxdag.render({str(path)!r}, size=(1500, 1500), samples=8, threads=1, progress=say)
        print("finished")
    """)
    assert "finished" not in output


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
    """The example in docs/python.md makes a picture of a mesh, in at most six lines."""
    text = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    assert len([line for line in example.splitlines() if line.strip()]) <= 6
    subprocess.run(
        [sys.executable, "-c", example],
        cwd=tmp_path,
        check=True,
        env={**os.environ, "MPLBACKEND": "Agg"},
    )
    assert (tmp_path / "scene.png").read_bytes().startswith(b"\x89PNG")
