"""Picks while tiles load or leave, the end of the first view, and reduced motion."""

import math

from control_checks import steady_place
from failure_checks import TILES
from picture_checks import HEIGHT, PLAIN, WIDTH, address, assert_equal
from visitor import PIXEL_RATIO

# Picks at a pixel and draws a picture at the same moment. Returns the pick, the distance at this
# pixel of the picture, and the number of tiles that are being loaded.
PICK_AND_DEPTH = """async ([x, y, width, height, ratio]) => {
  const {renderer} = voxdagViewer, picking = renderer.pick(x, y);
  const {depth} = await renderer.capture({width, height});
  return [
    await picking, depth[Math.floor(y * ratio) * width + Math.floor(x * ratio)],
    renderer.statistics().loading
  ];
}"""


def check_one_pick(pick, dag):
    """The picked cell and its node are in the file."""
    assert pick is not None, "nothing is picked"
    offset = dag.find(pick["voxel"], pick["nodeLevel"])
    assert str(offset) == pick["nodeOffset"], f"not the node around the voxel, {offset}: {pick}"
    in_file = (
        dag.is_set(pick["voxel"])
        if pick["level"] == dag.levels
        else dag.find(pick["voxel"], min(pick["level"], dag.levels - 2))
    )
    assert in_file is not None and in_file is not False, f"the file has no such cell: {pick}"


def check_picks_while_loading(visitor, url, dag, camera, reference):
    """A pick agrees with the current picture: without tiles, while they arrive, and with all."""
    visitor.page.add_init_script(TILES % "late")
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera, complete=False)
    visitor.wait_until("tiles.asked > 0")
    x, y = steady_place(reference)

    def pick():
        found, depth, loading = visitor.page.evaluate(
            PICK_AND_DEPTH, [x, y, WIDTH, HEIGHT, PIXEL_RATIO]
        )
        check_one_pick(found, dag)
        assert math.isclose(found["distance"], depth, rel_tol=1e-4), (
            f"picked at {found['distance']}, shown at {depth}"
        )
        return found, loading

    coarse, _ = pick()
    # Lets the tiles arrive one by one while complete() waits.
    visitor.page.evaluate("""() => {
      window.whole = false;
      voxdagViewer.renderer.complete().then(() => whole = true);
      const next = () => {
        tiles.held.shift()?.();
        if (!whole) setTimeout(next, 20);
      };
      next();
    }""")
    levels, busy = {coarse["level"]}, 0
    while not visitor.page.evaluate("whole"):
        found, loading = pick()
        levels.add(found["level"])
        busy += loading > 0
    fine, _ = pick()
    assert fine["level"] > coarse["level"] and busy > 0, (
        f"no pick while tiles came: {sorted(levels)}, {busy}"
    )


# All tiles but the root are evicted between a pick's ray and its reading.
PICK_WITHOUT_TILES = """async ([x, y]) => {
  const {renderer} = voxdagViewer, {context: {passes}, stream: {store}} = renderer,
        itsPick = passes.pickOne;
  let left = 0, evicted = 0;
  passes.pickOne = function(values) {
    const reading = itsPick.call(passes, values);
    evicted = store.evicted;
    for (const tile of left === 0 ? [...store.tiles.values()] : []) {
      if (tile === store.root) continue;
      store.evict(tile);
      ++left;
    }
    return reading;
  };
  const pick = await renderer.pick(x, y);
  passes.pickOne = itsPick;
  return [pick, left, store.evicted - evicted];
}"""


# Looks at the 30 tiles that were loaded first. Returns how many of them the current view is known
# to use, and their number.
SEEN = """() => {
  const {store} = voxdagViewer.renderer.stream, tiles = [...store.tiles.values()].slice(0, 30);
  return [tiles.filter(({epoch}) => epoch === store.epoch).length, tiles.length];
}"""


def check_tiles_that_left(visitor, url, dag, cameras, references):
    """An evicted tile is fetched again when needed. A pick during an eviction is repeated."""
    visitor.open(f"{url}/?budget=0.25{PLAIN}")
    visitor.page.evaluate("""() => {
  const {source} = voxdagViewer, itsFetch = source.fetchTiles;
  window.fetched = {};
  source.fetchTiles = function(nodes) {
    for (const {level, offset} of nodes)
      fetched[`${level}.${offset}`] = (fetched[`${level}.${offset}`] ?? 0) + 1;
    return itsFetch.call(source, nodes);
  };
}""")
    visitor.show(cameras["top"])
    visitor.show(cameras["wide"], complete=False)
    visitor.show(cameras["top"])
    seen, tiles = visitor.page.evaluate(SEEN)
    assert seen > tiles / 4, (
        f"only {seen} of {tiles} tiles are known to be seen: others would leave first"
    )
    visitor.page.evaluate(
        "window.tilesOfTop = [...voxdagViewer.renderer.stream.store.tiles.keys()]"
    )
    for _ in range(10):
        for name in ("near", "inside", "street"):
            visitor.show(cameras[name], complete=False)
            visitor.page.wait_for_timeout(100)
        if visitor.page.evaluate(
            "tilesOfTop.some((key) => !voxdagViewer.renderer.stream.store.tiles.has(key))"
        ):
            break
    assert visitor.page.evaluate(
        "tilesOfTop.some((key) => !voxdagViewer.renderer.stream.store.tiles.has(key))"
    ), "no tile of the first view has left"
    visitor.show(cameras["top"])
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(references["top"], depths, cameras["top"], "top, after its tiles have left")
    assert visitor.page.evaluate("Object.values(fetched).some((times) => times > 1)"), (
        "no tile was fetched twice"
    )
    pick, left, left_since = visitor.page.evaluate(
        PICK_WITHOUT_TILES, steady_place(references["top"])
    )
    assert left > 0, "no tile has left: the check sees nothing"
    assert left_since == 0, f"{left_since} tiles have left since the ray of the pick"
    check_one_pick(pick, dag)


MAX_TILES, FEW_TILES = "const kMaxTiles = 1500;", 40
FIRST_PIXELS, FINE_PIXELS = "const kPixels = 15;", 1
MOST_UNDER_WAY = 5 * 48  # tiles of four requests in progress and of one that has just arrived
# Counts requested tiles. `asked.atMark` is their number at the end of the search for the first
# view.
COUNT_TILES = """
window.asked = {
  tiles: 0,
  atMark: null
};
const countedFetch = window.fetch, countedMark = performance.mark;
performance.mark = function(name) {
  if (name === "voxdag: tiles of the first view") asked.atMark ??= asked.tiles;
  return countedMark.apply(this, arguments);
};
window.fetch = (url, options) => {
  if (/\\/tiles\\/[0-9b]/.test(url))
    asked.tiles += /nodes=/.test(url) ? url.split("nodes=")[1].split(",").length : 1;
  return countedFetch(url, options);
};
"""


def check_end_of_first_view(visitor, url, camera, reference):
    """The search before the first frame ends at its limit; later frames load the other tiles."""

    def make_small(route):
        script = route.fetch().text()
        for old, new in (
            (MAX_TILES, f"const kMaxTiles = {FEW_TILES};"),
            (FIRST_PIXELS, f"const kPixels = {FINE_PIXELS};"),
        ):
            assert old in script, f"{old} is not there any more"
            script = script.replace(old, new)
        route.fulfill(body=script, content_type="text/javascript")

    visitor.page.route("**/tiles/first_view.js", make_small)
    visitor.page.add_init_script(COUNT_TILES)
    visitor.open(address(url, camera))
    visitor.wait_until("asked.atMark !== null")
    at_mark = visitor.page.evaluate("asked.atMark")
    visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(reference, depths, camera, f"after {at_mark} tiles of the first view")
    asked = visitor.page.evaluate("asked.tiles")
    assert FEW_TILES < at_mark <= FEW_TILES + MOST_UNDER_WAY < asked, (
        f"{at_mark} tiles in the first view, {asked} in all"
    )


# Moves the camera to another view. Returns the number of different positions on the way, whether a
# drag has inertia, and the final position.
GLIDE = """async (camera) => {
  const {viewer} = voxdagViewer, places = new Set(), end = performance.now() + 120000;
  viewer.motion.startCoasting([1, 0], () => {});
  const coasts = viewer.motion.coast !== null;
  viewer.motion.stop();
  viewer.flyToText(camera);
  for (;;) {
    places.add(viewer.camera.eye.join());
    if (viewer.motion.flight === null || performance.now() > end)
      return [places.size, coasts, [...viewer.camera.eye]];
    await new Promise((resolve) => requestAnimationFrame(resolve));
  }
}"""


def check_reduced_motion(visitor, cameras):
    """The camera jumps if the system requests reduced motion, and glides otherwise."""
    for motion in ("no-preference", "reduce"):
        visitor.page.emulate_media(reduced_motion="reduce")
        visitor.show(cameras["top"], complete=False)
        visitor.page.emulate_media(reduced_motion=motion)
        places, coasts, eye = visitor.page.evaluate(GLIDE, cameras["wide"])
        visitor.page.emulate_media(reduced_motion="reduce")
        visitor.show(cameras["wide"], complete=False)
        assert math.dist(eye, visitor.camera()["eye"]) < 1, "the camera has not arrived"
        if motion == "reduce":
            assert places == 1 and not coasts, (
                f"the camera glides though motion is reduced: {places} places, {coasts}"
            )
        else:
            assert places > 1 and coasts, "the camera never glides: the check sees nothing"
