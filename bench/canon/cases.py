"""The scenes and the cases of the reference set."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Scene:
    """A generated scene (arguments of `voxdag generate`), or a file with source and license."""

    arguments: tuple = ()
    file: str = ""
    source: str = "voxdag generate"
    license: str = "none needed"


@dataclass(frozen=True)
class Case:
    """A build of a scene; with has_exports, the sizes of its exports are also recorded."""

    scene: str
    resolution: int
    options: tuple = ()
    has_exports: bool = False

    def __str__(self):
        return " ".join((self.scene, str(self.resolution), *self.options))


STANFORD = "Stanford 3D Scanning Repository terms (research use, with credit)"
SCENES = {
    "city": Scene(("city",)),
    "city-colors": Scene(("city", "--colors", "--triangles", "100000")),
    "menger": Scene(("menger", "--level", "4")),
    "soup": Scene(("soup",)),
    "spheres": Scene(("spheres",)),
    "terrain": Scene(("terrain",)),
    "sponza": Scene(
        file="sponza.glb",
        source="superpenshine/sponza, assets/sponza_obj.rar at commit d38ec7ef, as .glb",
        license="CC BY 3.0 (Crytek, Frank Meinl)",
    ),
    "dragon": Scene(
        file="dragon_100k.glb",
        source="brickray/gpu-pathtracer, dragon.obj at commit 4a8ef9d8, as .glb",
        license=STANFORD,
    ),
    "bunny": Scene(
        file="bunny_69k.glb",
        source="google/draco, testdata/bun_zipper.ply at commit 47238930, as .glb",
        license=STANFORD,
    ),
    "armadillo": Scene(
        file="armadillo.glb",
        source="libigl/libigl-tutorial-data, armadillo.obj at commit c1f9ede3, as .glb",
        license=STANFORD,
    ),
}

# The endings of the names of exported files.
EXPORTS = {"svdag": ".svdag", "bt": ".bt", "npz": ".npz", "ply": ".ply", "glb": ".glb"}

RULES = (("--thin",), ("--solid", "winding"), ("--solid", "parity"), ("--solid", "enclosed"))


def cases_of(scene, resolutions, rules=()):
    """Returns a case without options for every resolution, and one with each rule at the lowest."""
    shells = [Case(scene, r, has_exports=r == resolutions[0]) for r in resolutions]
    return shells + [Case(scene, resolutions[0], rule) for rule in rules]


CASES = [
    *cases_of("city", (1024, 2048, 8192), RULES),
    *cases_of("menger", (128, 1024), RULES),
    *cases_of("soup", (512, 2048), RULES),
    *cases_of("spheres", (1024, 2048, 8192), RULES),
    *cases_of("terrain", (1024, 2048, 8192), (("--thin",),)),
    Case("city-colors", 1024, ("--color",)),
    Case("city-colors", 1024, ("--attributes", "color,normal,material")),
    *cases_of("sponza", (2048, 8192, 16384, 32768, 65536), (("--thin",), ("--solid", "enclosed"))),
    *cases_of("dragon", (2048, 8192, 16384), RULES),
    *cases_of("bunny", (2048, 8192), RULES),
    *cases_of("armadillo", (2048, 8192), RULES),
]


def is_quick(case):
    """True if the case needs no downloaded file and little time."""
    return not SCENES[case.scene].file and case.resolution < 4096
