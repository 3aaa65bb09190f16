"""The order of the nodes in a file, from Python."""

import numpy as np
import pytest
import voxdag


def test_there_and_back(path, dag, tmp_path):
    first, back = tmp_path / "first.vdag", tmp_path / "back.vdag"
    report = dag.reorder(first, memory="64MiB")
    assert report["node_order"] == "first-parent"
    assert report["bytes"] == first.stat().st_size
    with voxdag.open(first) as reordered:
        assert (dag.node_order, reordered.node_order) == ("hash", "first-parent")
        assert np.array_equal(reordered.dense(), dag.dense())
        with pytest.raises(voxdag.Error, match="order first-parent"):
            reordered | dag
    voxdag.reorder(first, back, order="hash", threads=2)
    with open(path, "rb") as original:
        assert back.read_bytes() == original.read()


def test_build_in_the_order(mesh, tmp_path):
    built, reordered = tmp_path / "built.vdag", tmp_path / "reordered.vdag"
    options = {"resolution": 64, "memory": "64MiB"}
    report = voxdag.build(mesh, output=built, order="first-parent", **options)
    assert report["node_order"] == "first-parent"
    voxdag.build(mesh, output=tmp_path / "hash.vdag", **options)
    voxdag.reorder(tmp_path / "hash.vdag", reordered)
    assert built.read_bytes() == reordered.read_bytes()
    with pytest.raises(voxdag.Error, match="order"):
        voxdag.build(mesh, output=tmp_path / "x.vdag", order="random", **options)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"order": "random"}, "expected first-parent or hash"),
        ({"memory": "8MiB"}, "memory"),
        ({"force": False}, "exists"),
    ],
)
def test_refuses(path, tmp_path, options, message):
    output = tmp_path / "x.vdag"
    if "force" in options:
        output.write_text("text")
    with pytest.raises(voxdag.Error, match=message) as error:
        voxdag.reorder(path, output, **options)
    assert error.value.code == "invalid_input"
