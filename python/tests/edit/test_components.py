"""Connected components, against a flood fill of arrays."""

import itertools

import numpy as np
import pytest
import voxdag


def flooded(cells, connectivity):
    """Returns the size and the box of each component, the largest component first."""
    steps = [
        step
        for step in itertools.product((-1, 0, 1), repeat=3)
        if connectivity == 26 or sum(map(abs, step)) == 1
    ]
    left = {tuple(voxel) for voxel in np.argwhere(cells).tolist()}
    found = []
    while left:
        waiting = [left.pop()]
        component = []
        while waiting:
            at = waiting.pop()
            component.append(at)
            near = {(at[0] + x, at[1] + y, at[2] + z) for x, y, z in steps} & left
            left -= near
            waiting += near
        box = np.min(component, axis=0).tolist() + (np.max(component, axis=0) + 1).tolist()
        found.append((len(component), box))
    return sorted(found, key=lambda item: (-item[0], item[1]))


@pytest.mark.parametrize("connectivity", [6, 26])
@pytest.mark.parametrize("share", [0, 0.02, 0.1, 0.3, 0.6, 1])
def test_equals_a_flood_fill(connectivity, share):
    cells = np.random.default_rng(11).random((16, 16, 16)) < share
    expected = flooded(cells, connectivity)
    found = voxdag.from_dense(cells).components(connectivity, 1000)
    assert found.total == len(expected)
    assert found.voxels.tolist() == [size for size, _ in expected][:1000]
    assert found.boxes.tolist() == [box for _, box in expected][:1000]
    assert found.boxes.shape == (len(found.voxels), 6) and found.voxels.dtype == np.int64


def test_boxes_are_regions(dag):
    total, voxels, boxes = dag.components(memory="64MiB")
    assert total == 1 and voxels.tolist() == [dag.voxels]
    assert dag.count(boxes[0]) == dag.voxels
    two = dag.edit(cut="box:24,0,0,40,64,64")
    found = two.components(largest=1)
    assert found.total == 2 and len(found.voxels) == 1
    assert two.count(found.boxes[0]) == found.voxels[0]


def test_progress_and_errors(dag):
    stages = set()
    dag.components(progress=lambda stage, *_: stages.add(stage))
    assert stages <= {"components"}
    for options in (
        {"connectivity": 18},
        {"connectivity": "26"},
        {"largest": -1},
        {"largest": 1 << 40},
        {"memory": "1MiB"},
        {"memory": "much"},
    ):
        with pytest.raises(voxdag.Error) as error:
            dag.components(**options)
        assert error.value.code == "invalid_input", options
    with pytest.raises(TypeError):
        dag.components(largest=1.5)
