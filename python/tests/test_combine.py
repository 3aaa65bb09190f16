"""Set operations from Python, against numpy."""

import operator
import os

import numpy as np
import pytest
import voxdag

OPERATIONS = {
    "union": (operator.or_, np.logical_or),
    "minus": (operator.sub, lambda a, b: a & ~b),
    "and": (operator.and_, np.logical_and),
    "xor": (operator.xor, np.logical_xor),
}


@pytest.fixture(scope="module")
def arrays():
    random = np.random.default_rng(7)
    return tuple(random.random((16, 16, 16)) < 0.3 for _ in range(2))


@pytest.fixture(scope="module")
def dags(arrays):
    return tuple(voxdag.from_dense(array, resolution=16) for array in arrays)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_operations(operation, arrays, dags, tmp_path):
    on_dags, on_arrays = OPERATIONS[operation]
    expected = on_arrays(*arrays)
    combined = on_dags(*dags)
    assert np.array_equal(combined.dense(), expected)
    written = voxdag.combine(*dags, operation, tmp_path / "c.vdag", memory="64MiB")
    assert written == combined and written.path == str(tmp_path / "c.vdag")
    written.close()
    assert os.path.exists(tmp_path / "c.vdag")


def test_temporary_file_is_removed(dags):
    a, b = dags
    combined = a | b
    folder = os.path.dirname(combined.path)
    assert (combined - b) == (a - b)
    combined.close()
    assert not os.path.exists(folder)


def test_offset(arrays, dags):
    a, b = dags
    moved = np.zeros_like(arrays[0])
    moved[3:, :, :-2] = arrays[1][:-3, :, 2:]
    combined = voxdag.combine(a, b, "union", offset=(3, 0, -2), clip=True)
    assert np.array_equal(combined.dense(), arrays[0] | moved)


def test_refuses(dags, tmp_path):
    a, b = dags
    for options in (
        {"offset": (3, 0, 0)},
        {"offset": (1.5, 0, 0)},
        {"offset": (1, 2)},
        {"memory": "8MiB"},
        {"output": a.path},
    ):
        with pytest.raises(voxdag.Error) as error:
            voxdag.combine(a, b, "union", **options)
        assert error.value.code == "invalid_input", options
    with pytest.raises(voxdag.Error, match="expected union, minus, and, or xor"):
        voxdag.combine(a, b, "or", tmp_path / "c.vdag")
    with pytest.raises(TypeError):
        a | 3
    for color in ((1, 2), (0, 0, 256), "red", (1.5, 0, 0)):
        with pytest.raises(voxdag.Error, match="three integers from 0 to 255"):
            voxdag.combine(a, b, "union", fill_color=color)


def test_colors():
    red = voxdag.from_voxels([[1, 2, 3], [4, 5, 6]], [[255, 0, 0]] * 2, resolution=16)
    blue = voxdag.from_voxels([[4, 5, 6], [7, 8, 9]], [[0, 0, 255]] * 2, resolution=16)
    for combined, voxels, colors in (
        (red | blue, [[1, 2, 3], [4, 5, 6], [7, 8, 9]], [[255, 0, 0]] * 2 + [[0, 0, 255]]),
        (red ^ blue, [[1, 2, 3], [7, 8, 9]], [[255, 0, 0], [0, 0, 255]]),
        (red & blue, [[4, 5, 6]], [[255, 0, 0]]),
        (blue - red, [[7, 8, 9]], [[0, 0, 255]]),
    ):
        assert len(combined) == len(voxels)
        assert np.allclose(combined.colors(voxels), colors, atol=48)  # colors are compressed


def test_one_file_has_colors():
    plain = voxdag.from_voxels([[0, 0, 0]], resolution=16)
    red = voxdag.from_voxels([[1, 2, 3]], [[255, 0, 0]], resolution=16)
    with pytest.raises(voxdag.Error, match=r"has colors and .* has none: expected"):
        plain | red
    filled = voxdag.combine(plain, red, "union", fill_color=(0, 255, 0))
    colors = filled.colors([[0, 0, 0], [1, 2, 3]])
    assert np.allclose(colors, [[0, 255, 0], [255, 0, 0]], atol=48)
    assert voxdag.combine(plain, red, "union", no_attributes=True).attributes == []
