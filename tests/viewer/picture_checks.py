"""The picture equals that of `voxdag render`; missing tiles, small budgets and lost servers leave no holes."""

import math
import re
import time

from visitor import resident_bytes_of_descendants

WIDTH, HEIGHT = 400, 180  # of the canvas in the visitor's window
MIN_EQUAL_MASK = 0.995
MIN_EQUAL_DEPTH = 0.99
MIB = 1 << 20
PLAIN = "#occlusion=0&shadows=0"  # where the light does not matter: a CPU draws here
CONNECTION_LOST = "ERR_CONNECTION_REFUSED|ERR_FAILED|ERR_CONNECTION_RESET|ERR_EMPTY_RESPONSE|Failed to load resource"


def camera_text(eye, target, fov):
    return f"--camera {','.join(map(str, eye))} --target {','.join(map(str, target))} --fov {fov}"


def street_camera(dag, eye):
    """Along the x axis from a place, a little upward: houses below, sky above."""
    return camera_text(eye, [eye[0] - dag.edge / 4, eye[1] + dag.edge / 60, eye[2] - dag.edge / 16], 50)


def near_camera(dag, eye, target):
    """What is in the center of a view, from so near that a voxel is wider than five pixels."""
    size = dag.edge / dag.resolution
    forward = [(b - a) / math.dist(eye, target) for a, b in zip(eye, target)]
    place = list(eye)
    while not dag.is_set([int((c - low) / size) for c, low in zip(place, dag.origin)]):
        place = [c + 0.5 * size * f for c, f in zip(place, forward)]
    back = [c - 40 * size * f for c, f in zip(place, forward)]
    return camera_text([back[0], back[1] + 12 * size, back[2]], place, 45)


def share_of_sky(depths):
    return sum(math.isinf(depth) for depth in depths) / len(depths)


def fov_of(camera):
    return float(re.search(r"--fov (\S+)", camera)[1])


def compare(reference, depths, camera):
    """Shares of equal pixels: of the mask of hits, and of the distances where both hit."""
    spread = math.tan(math.radians(fov_of(camera)) / 2) / (HEIGHT / 2)
    same_mask = common = same_depth = 0
    for a, b in zip(reference, depths):
        if math.isinf(a) == math.isinf(b):
            same_mask += 1
            if not math.isinf(a):
                common += 1
                same_depth += abs(a - b) <= max(1, spread * a)
    return same_mask / len(reference), same_depth / max(1, common), common


def holes(reference, depths):
    """The share of the reference's hits that are sky in the picture."""
    hits = [i for i, depth in enumerate(reference) if not math.isinf(depth)]
    return sum(math.isinf(depths[i]) for i in hits) / len(hits)


def assert_equal(reference, depths, camera, what):
    mask, depth, common = compare(reference, depths, camera)
    print(f"  {what}: mask {100 * mask:.2f} %, depth {100 * depth:.2f} % of {common} hits, "
          f"{100 * share_of_sky(reference):.0f} % sky")
    assert common > 0.05 * len(reference), f"{what}: nothing to see"
    assert mask >= MIN_EQUAL_MASK, f"{what}: the mask differs"
    assert depth >= MIN_EQUAL_DEPTH, f"{what}: the distances differ"


def check_pictures(visitor, cameras, references):
    """Still and complete at each camera; two see much sky; a wrong camera would be noticed."""
    skies = sorted(share_of_sky(reference) for reference in references.values())
    assert sum(0.2 <= sky <= 0.8 for sky in skies) >= 2, f"too little or too much sky: {skies}"
    pictures = {}
    for name, camera in cameras.items():
        visitor.show(camera)
        pictures[name], levels = visitor.capture(WIDTH, HEIGHT)
        assert_equal(references[name], pictures[name], camera, name)
        assert len(set(levels)) > 1, "all hits and the sky have one level"
        visitor.picture(name)
    names = list(cameras)
    for name, other in zip(names, names[1:] + names[:1]):
        mask, depth, _ = compare(references[other], pictures[name], cameras[other])
        assert mask < MIN_EQUAL_MASK or depth < MIN_EQUAL_DEPTH, f"{name} equals {other}: the check sees nothing"


def check_budget(visitor, url, cameras, references):
    """Tiles leave a small pool; it never has more than its budget; the picture is right nevertheless."""
    visitor.open(f"{url}/?budget=1{PLAIN}")
    for name, camera in [*cameras.items(), *cameras.items()]:
        visitor.show(camera, complete=False)
        until = time.monotonic() + 0.5
        while time.monotonic() < until:
            statistics = visitor.statistics()
            assert 0 < statistics["poolBytes"] <= statistics["budgetBytes"] <= MIB, statistics
            visitor.page.wait_for_timeout(40)
    for name, camera in cameras.items():
        visitor.show(camera, complete=False)
        depths, _ = visitor.capture(WIDTH, HEIGHT)
        assert holes(references[name], depths) < 0.005, f"holes at {name} with a small budget"
    statistics = visitor.statistics()
    assert statistics["evicted"] > 0 and statistics["tiles"] > 1, f"no tile has left: {statistics}"


def check_missing_tiles(visitor, url, cameras, references):
    """Without any tile but the root's only detail is missing; it is there once the tiles come."""
    name, camera = "wide", cameras["wide"]
    tiles = re.compile(r"/api/v1/.*/tiles/")  # not the scripts in viewer/tiles/
    for way in ("fail", "are late"):
        held, passing = [], []

        def handle(route, way=way, held=held, passing=passing):
            if passing or re.search(r"/tiles/0/0\b|nodes=0\.0(&|$)", route.request.url):
                route.continue_()
                return
            held.append(route)
            if way == "fail":
                route.abort("failed")

        with visitor.expecting(CONNECTION_LOST):
            visitor.page.route(tiles, handle)
            visitor.open(f"{url}/{PLAIN}")
            visitor.show(camera, complete=False)
            visitor.page.wait_for_timeout(700)
            depths, _ = visitor.capture(WIDTH, HEIGHT)
            assert held, "no tile was asked for"
            assert holes(references[name], depths) < 0.005, f"tiles that {way} leave holes"
            _, near, _ = compare(references[name], depths, camera)
            assert near < MIN_EQUAL_DEPTH, f"tiles that {way} are not missed: the check sees nothing"
            visitor.picture(f"tiles-{way.split()[-1]}")
            passing.append(True)
            for route in held if way == "are late" else ():
                route.continue_()
            visitor.show(camera)
            visitor.page.unroute(tiles)
        depths, _ = visitor.capture(WIDTH, HEIGHT)
        assert_equal(references[name], depths, camera, f"{name}, after tiles that {way}")


def check_restart(visitor, server, cameras, references):
    """Asks for tiles while the server is gone; the picture is completed when it is there again."""
    visitor.open(f"{server.url}/{PLAIN}")
    visitor.show(cameras["wide"])
    with visitor.expecting(CONNECTION_LOST):
        server.kill()
        visitor.show(cameras["street"], complete=False)
        visitor.page.wait_for_timeout(1200)
        assert visitor.statistics()["failed"] > 0, "no request has failed: the check sees nothing"
        depths, _ = visitor.capture(WIDTH, HEIGHT)
        assert holes(references["street"], depths) < 0.005, "a lost server leaves holes"
        visitor.page.locator("#status.bad").wait_for()
        server.start()
        visitor.show(cameras["street"])
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(references["street"], depths, cameras["street"], "street, after a restart")
    visitor.page.locator("#status:not(.bad)").wait_for(state="attached")


FLY = """async ([cameras, seconds]) => {
  const {viewer} = window.voxdagViewer;
  const end = performance.now() + 1000 * seconds;
  let frames = 0, most = 0;
  for (let i = 0; performance.now() < end; ++i) {
    viewer.fly_to_text(cameras[i % cameras.length]);
    for (let turn = 0; turn < 12 && performance.now() < end; ++turn, ++frames) {
      viewer.camera.turn(0.03, 0);
      viewer.camera.move(0, 0, viewer.camera.distance / 200);
      viewer.schedule();
      await new Promise((resolve) => requestAnimationFrame(resolve));
      most = Math.max(most, viewer.renderer.statistics().poolBytes);
    }
  }
  return [frames, most];
}"""


def check_memory(visitor, url, cameras, seconds):
    """After a first flight over all cameras, more flying needs no more memory."""
    visitor.open(f"{url}/?budget=2{PLAIN}")
    session = visitor.context.new_cdp_session(visitor.page)

    def fly(part):
        frames, most = visitor.page.evaluate(FLY, [list(cameras.values()), part])
        assert frames >= 8, f"{frames} frames in {part} s"
        assert most <= 2 * MIB
        session.send("HeapProfiler.collectGarbage")
        return session.send("Runtime.getHeapUsage")["usedSize"], resident_bytes_of_descendants()

    heap, resident = fly(max(3, seconds / 4))
    heap_after, resident_after = fly(seconds)
    print(f"  flight of {seconds} s: heap {heap / MIB:.1f} to {heap_after / MIB:.1f} MiB, "
          f"all processes {resident / MIB:.0f} to {resident_after / MIB:.0f} MiB")
    assert heap_after < heap + 2 * MIB, "the heap grows"
    assert resident_after < resident + 64 * MIB, "the memory of the browser grows"
