"""The generated city of the viewer's test, its cameras, and the pictures of `voxdag render`."""

import json

from picture_checks import HEIGHT, WIDTH, near_camera, numbers, street_camera
from programs import DagFile, read_npy


class City:
    """The city. One process builds it in a folder, and several processes read it there."""

    def __init__(self, folder):
        self.folder, self.built = folder, folder / "city_8192.vdag"

    def build(self, voxdag):
        built = voxdag.build("city", 8192, "--triangles", 200000)
        assert built == self.built
        cameras = self.make_cameras(voxdag)
        for name, camera in cameras.items():
            voxdag.render(built, camera, WIDTH, HEIGHT, self.path_of(name))
        (self.folder / "cameras.json").write_text(json.dumps(cameras), encoding="utf-8")
        return self.load()

    def load(self):
        self.cameras = json.loads((self.folder / "cameras.json").read_text(encoding="utf-8"))
        self.references = {
            name: read_npy(self.path_of(name), WIDTH, HEIGHT) for name in self.cameras
        }
        self.dag = DagFile(self.built)
        return self

    def path_of(self, name):
        return self.folder / f"depth-{name}.npy"

    def make_cameras(self, voxdag):
        """Returns cameras from far to near: two see much sky, one looks straight down, and one sees
        large voxels."""
        views = {name: voxdag.named_view(self.built, name) for name in ("iso", "top", "inside")}
        dag = DagFile(self.built)
        inside = numbers(views["inside"])
        eye, target = inside[:3], inside[3:6]
        return {
            "wide": views["iso"],
            "top": views["top"],
            "inside": views["inside"],
            "street": street_camera(dag, eye),
            "near": near_camera(dag, eye, target),
        }
