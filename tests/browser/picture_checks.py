"""The picture equals the picture of `voxdag render`; small budgets leave no holes."""

import math
import re
import time

from visitor import resident_bytes_of_descendants

WIDTH, HEIGHT = 200, 90  # size of the canvas in the visitor's window, in device pixels
MIN_EQUAL_MASK = 0.995
MIN_EQUAL_DEPTH = 0.99
MIB = 1 << 20
PLAIN = "#occlusion=0&shadows=0"  # without lighting, because a CPU draws here


def numbers(text):
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", text)]


def camera_text(eye, target, fov):
    return f"--camera {','.join(map(str, eye))} --target {','.join(map(str, target))} --fov {fov}"


def street_camera(dag, eye):
    """Returns a camera along the x axis, a little upward: houses below, sky above."""
    return camera_text(
        eye, [eye[0] - dag.edge / 4, eye[1] + dag.edge / 60, eye[2] - dag.edge / 16], 50
    )


def near_camera(dag, eye, target):
    """Returns a camera on the view's center, so near that a voxel is wider than five pixels."""
    size = dag.edge / dag.resolution
    forward = [(b - a) / math.dist(eye, target) for a, b in zip(eye, target)]
    place = list(eye)
    while not dag.is_set([int((c - low) / size) for c, low in zip(place, dag.origin)]):
        place = [c + 0.5 * size * f for c, f in zip(place, forward)]
    back = [c - 20 * size * f for c, f in zip(place, forward)]
    return camera_text([back[0], back[1] + 6 * size, back[2]], place, 45)


def share_of_sky(depths):
    return sum(math.isinf(depth) for depth in depths) / len(depths)


def fov_of(camera):
    return float(re.search(r"--fov (\S+)", camera)[1])


def address(url, camera):
    """Returns the address of a page that starts with this camera, so its sun is as in `render`."""
    _, eye, target, fov = re.split(r" ?--\w+ ", camera)
    return f"{url}/{PLAIN}&camera={eye}&target={target}&fov={fov}"


def compare(reference, depths, camera):
    """Returns the shares of pixels that agree: on hit or miss, and on distance where both hit."""
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
    """Returns the share of the reference's hits that are sky in the picture."""
    hits = [i for i, depth in enumerate(reference) if not math.isinf(depth)]
    return sum(math.isinf(depths[i]) for i in hits) / len(hits)


def assert_equal(reference, depths, camera, what):
    mask, depth, common = compare(reference, depths, camera)
    print(
        f"  {what}: mask {100 * mask:.2f} %, depth {100 * depth:.2f} % of {common} hits, "
        f"{100 * share_of_sky(reference):.0f} % sky"
    )
    assert common > 0.05 * len(reference), f"{what}: nothing to see"
    assert mask >= MIN_EQUAL_MASK, f"{what}: the mask differs"
    assert depth >= MIN_EQUAL_DEPTH, f"{what}: the distances differ"


def check_pictures(visitor, cameras, references):
    """The complete picture at each camera equals the reference; a wrong camera would differ."""
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
        assert mask < MIN_EQUAL_MASK or depth < MIN_EQUAL_DEPTH, (
            f"{name} equals {other}: the check sees nothing"
        )


# No tile arrives after the tiles of the first view, whose end a performance mark announces.
ONLY_FIRST_VIEW = """
const itsFetch = window.fetch, itsMark = performance.mark;
window.itsTiles = false;
performance.mark = function(name) {
  itsTiles ||= name === "voxdag: tiles of the first view";
  return itsMark.apply(this, arguments);
};
window.fetch = (url, options) =>
  itsTiles && /\\/tiles\\/[^c]/.test(url) ? new Promise(() => {}) : itsFetch(url, options);
"""
COARSE_PIXELS = 16


def check_first_view(visitor, url, dag, camera, reference):
    """The tiles requested before the first frame give a picture without wide cells or holes."""
    visitor.page.add_init_script(ONLY_FIRST_VIEW)
    visitor.open(address(url, camera))
    visitor.wait_until("itsTiles")
    depths, levels = visitor.capture(WIDTH, HEIGHT)
    spread = math.tan(math.radians(fov_of(camera)) / 2) / (HEIGHT / 2)
    widest = max(
        2 ** (dag.levels - level) / (spread * depth)
        for depth, level in zip(depths, levels)
        if not math.isinf(depth) and level < dag.levels
    )
    _, same, _ = compare(reference, depths, camera)
    print(
        f"  first view: {visitor.statistics()['tiles']} tiles, "
        f"the widest cell has {widest:.1f} pixels"
    )
    assert widest <= COARSE_PIXELS, "the first view is too coarse"
    assert holes(reference, depths) < 0.005, "the first view has holes"
    assert same < MIN_EQUAL_DEPTH, "all tiles are there: the check sees nothing"


MIN_REGION = 100  # minimum number of pixels of a region
MIN_SHADOW = 8  # a shadow is at least this much darker than the sky, of 255
SKY_TOP, SKY_BOTTOM = (0.46, 0.54, 0.65), (0.86, 0.87, 0.88)  # linear light


def sky_of_row(row, height):
    """Returns the color of the sky in a row from the top, 0 to 255."""
    share = 1 - (row + 0.5) / height
    linear = [low + share * (high - low) for low, high in zip(SKY_BOTTOM, SKY_TOP)]
    return [255 * (1.055 * c ** (1 / 2.4) - 0.055) for c in linear]


def inner_pixels(reference, width, height):
    """Yields (index, row, is hit) of pixels whose eight neighbors are sky, or hits, as they are."""
    for row in range(1, height - 1):
        for column in range(1, width - 1):
            at = row * width + column
            kinds = {
                math.isinf(reference[at + width * y + x]) for y in (-1, 0, 1) for x in (-1, 0, 1)
            }
            if len(kinds) == 1:
                yield at, row, False in kinds


def worst_region(differences, width, height):
    """Returns the largest mean difference among the 8 x 4 regions that have enough pixels."""
    regions = {}
    for at, off in differences.items():
        regions.setdefault((at // width * 4 // height, at % width * 8 // width), []).append(off)
    return max(
        (sum(each) / len(each) for each in regions.values() if len(each) >= MIN_REGION), key=abs
    )


def assert_light(pixels, rendered, reference, what, has_shadow, size=(WIDTH, HEIGHT)):
    """The lit canvas equals the picture of `render`: surfaces in light and shadow, the gradient of
    the sky, and the shadow on the floor if the scene does not fill its box. Returns the sorted
    brightness of the hits."""
    width, height = size
    off, shadow, tones = ({}, {}), {}, []
    for at, row, is_hit in inner_pixels(reference, width, height):
        color, expected = pixels[4 * at : 4 * at + 3], rendered[4 * at : 4 * at + 3]
        off[is_hit][at] = (sum(color) - sum(expected)) / 3
        if is_hit:
            tones.append(sum(color) / 3)
        elif sum(sky_of_row(row, height)) - sum(expected) > 3 * MIN_SHADOW:
            shadow[at] = off[False][at]
    means = [sum(each.values()) / max(1, len(each)) for each in (*off, shadow)]
    worst = [worst_region(each, width, height) for each in off]
    print(
        f"  light of {what}: hits are brighter than in render by {means[1]:.1f} "
        f"(a region by {worst[1]:.1f}), sky by "
        f"{means[0]:.1f} ({worst[0]:.1f}), of that {len(shadow)} pixels in shadow by {means[2]:.1f}"
    )
    assert min(map(len, off)) > 0.05 * width * height, "too little of the sky or of the scene"
    assert (len(shadow) > 0.005 * width * height) == has_shadow, (
        "a shadow on the floor, or none: the check sees nothing"
    )
    for which, max_mean, max_region in ((0, 2, 6), (1, 5, 12)):
        assert abs(means[which]) <= max_mean and abs(worst[which]) <= max_region, (
            "other light than that of render"
        )
    assert abs(means[2]) <= 5, "the floor's shadow is not that of render"
    return sorted(tones)


LIGHT_SIZE = 2 * WIDTH, 2 * HEIGHT  # a smaller picture has too few pixels to measure its brightness


def check_canvas(visitor, camera, reference, rendered):
    """The lit canvas equals `rendered`, and has light and shadow."""
    visitor.page.evaluate("voxdagViewer.viewer.setOptions({shadows: true, occlusion: true})")
    visitor.show(camera)
    width, height, pixels = visitor.canvas()
    assert (width, height) == LIGHT_SIZE, (width, height)
    tones = assert_light(
        pixels, rendered, reference, "the canvas", has_shadow=False, size=LIGHT_SIZE
    )
    dark, bright = tones[len(tones) // 10], tones[len(tones) * 9 // 10]
    assert dark > 20 and bright < 254 and bright - dark > 60, (
        f"no light and shadow: {dark} to {bright}"
    )
    visitor.picture("light")


MAX_BLACK = 0.02  # maximum black share of the canvas


def check_inside_cell(visitor, camera):
    """A picture from inside a cell that is drawn as one block is not black."""
    visitor.page.evaluate(
        "voxdagViewer.viewer.setOptions({level: 2, shadows: true, occlusion: true})"
    )
    visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert max(depths) == 0, "the eye is not in a cell: the check sees nothing"
    width, height, pixels = visitor.canvas()
    black = sum(max(pixels[at : at + 3]) < 16 for at in range(0, len(pixels), 4)) / (width * height)
    print(f"  within a cell: {100 * black:.1f} % of the picture are black")
    assert black < MAX_BLACK, "black within a cell"
    visitor.picture("within-cell")


# Returns four values of the same moment: the number of blocks in the lists of all tiles, how many
# of these entries are repetitions, the number of blocks in use, and the statistics.
COUNT_BLOCKS = """() => {
  const {renderer} = voxdagViewer, {store} = renderer.stream, seen = new Set();
  let count = 0;
  for (const tile of store.tiles.values())
    for (const block of tile.blocks) {
      ++count;
      seen.add(block);
    }
  return [
    count, count - seen.size, store.pool.blockCount - store.pool.freeBlocks, renderer.statistics()
  ];
}"""


def check_pool(visitor):
    """Each block in use belongs to exactly one loaded tile."""
    count, shared, used, statistics = visitor.page.evaluate(COUNT_BLOCKS)
    assert count == used > 0 and shared == 0, (count, shared, used)
    assert (
        statistics["tileBytes"]
        == 256 * count
        <= statistics["poolBytes"]
        <= statistics["budgetBytes"]
    ), statistics


def check_still(visitor, wait_ms):
    """The picture of a still camera ends: nothing more is drawn or requested."""
    visitor.wait_until(
        "!voxdagViewer.viewer.scheduled && voxdagViewer.renderer.statistics().samples >= 16"
    )
    before = visitor.statistics()
    visitor.page.wait_for_timeout(wait_ms)
    after = visitor.statistics()
    assert after["loading"] == 0 and after["requested"] == before["requested"], (before, after)
    assert after["samples"] == before["samples"], "a finished picture is drawn again"


def check_budget(visitor, url, cameras, references):
    """A small pool evicts tiles and never exceeds its budget; the picture is still right."""
    visitor.open(f"{url}/?budget=0.25{PLAIN}")
    assert visitor.statistics()["budgetBytes"] <= MIB / 4
    for camera in cameras.values():
        visitor.show(camera, complete=False)
        until = time.monotonic() + 0.3
        while time.monotonic() < until:
            check_pool(visitor)
            visitor.page.wait_for_timeout(40)
    for name, camera in cameras.items():
        visitor.show(camera, complete=name == "street")
        if name == "street":
            check_still(visitor, 400)
        depths, _ = visitor.capture(WIDTH, HEIGHT)
        assert holes(references[name], depths) < 0.005, f"holes at {name} with a small budget"
    statistics = visitor.statistics()
    assert statistics["evicted"] > 0 and statistics["tiles"] > 1, f"no tile has left: {statistics}"


# A pool starts with 256 KiB, not 16 MiB, so that a small scene makes it grow.
FIRST_ROWS, SMALL_ROWS = "const kFirstRows = 256;", 4
# Makes the allocation of textures for tiles fail if they have more than SMALL_ROWS rows.
NO_MEMORY = """
const {texStorage2D, getError} = WebGL2RenderingContext.prototype;
window.refusals = 0;
let refused = false;
WebGL2RenderingContext.prototype.texStorage2D = function(target, levels, format, width, height) {
  if (format !== this.RGBA32UI || width !== 4096 || height <= SMALL_ROWS)
    return texStorage2D.call(this, target, levels, format, width, height);
  refused = true;
  ++refusals;
};
WebGL2RenderingContext.prototype.getError = function() {
  const was = refused;
  refused = false;
  return was ? this.OUT_OF_MEMORY : getError.call(this);
};
""".replace("SMALL_ROWS", str(SMALL_ROWS))
POOL_ROWS = "voxdagViewer.renderer.stream.store.pool.rows"


def check_growing_pool(visitor, url, cameras, references, can_grow):
    """A pool that grows loses no tile. A pool that cannot grow keeps its first texture and
    works."""

    def begin_small(route):
        script = route.fetch().text()
        assert FIRST_ROWS in script, "the pool's first size has another name"
        route.fulfill(
            body=script.replace(FIRST_ROWS, f"const kFirstRows = {SMALL_ROWS};"),
            content_type="text/javascript",
        )

    visitor.page.route("**/tiles/tile_pool.js", begin_small)
    if not can_grow:
        visitor.page.add_init_script(NO_MEMORY)
    visitor.open(f"{url}/?budget=32{PLAIN}")
    for name in ("wide", "street"):
        camera = cameras[name]
        visitor.show(camera, complete=can_grow)
        if not can_grow:
            visitor.wait_until("refusals > 0 || voxdagViewer.renderer.isComplete")
            visitor.page.wait_for_timeout(300)  # more tiles arrive
        check_pool(visitor)
        depths, _ = visitor.capture(WIDTH, HEIGHT)
        if can_grow:
            assert_equal(references[name], depths, camera, f"{name}, with a growing pool")
        assert holes(references[name], depths) < 0.005, (
            f"holes at {name} in a pool that {'grows' if can_grow else 'cannot grow'}"
        )
    rows = visitor.page.evaluate(POOL_ROWS)
    if can_grow:
        assert rows > SMALL_ROWS, "the pool did not grow: the check sees nothing"
        return
    assert visitor.page.evaluate("refusals") == 1, "the pool did not try to grow, or did again"
    assert rows == SMALL_ROWS and visitor.statistics()["poolBytes"] <= 2 * MIB, visitor.statistics()


FLY = """async ([cameras, seconds]) => {
  const {viewer} = window.voxdagViewer;
  const end = performance.now() + 1000 * seconds;
  let frames = 0, most = 0;
  for (let i = 0; performance.now() < end; ++i) {
    viewer.flyToText(cameras[i % cameras.length]);
    for (let turn = 0; turn < 12 && performance.now() < end; ++turn, ++frames) {
      viewer.camera.turn(0.03, 0);
      viewer.camera.move(0, 0, viewer.camera.distance / 200);
      viewer.schedule();
      await new Promise((resolve) => setTimeout(resolve, 120));  // leaves the CPU to other checks
      await new Promise((resolve) => requestAnimationFrame(resolve));
      const {tileBytes, poolBytes} = viewer.renderer.statistics();
      if (tileBytes > poolBytes)
        throw new Error(`${tileBytes} bytes of tiles are in a pool of ${poolBytes}`);
      most = Math.max(most, poolBytes);
    }
  }
  return [frames, most, viewer.renderer.statistics().evicted];
}"""


def check_memory(visitor, url, cameras, seconds):
    """After a first flight over all cameras, further flights need no more memory."""
    visitor.open(f"{url}/?budget=0.25{PLAIN}")
    session = visitor.context.new_cdp_session(visitor.page)

    def fly(part):
        frames, most, evicted = visitor.page.evaluate(FLY, [list(cameras.values()), part])
        assert frames >= 8, f"{frames} frames in {part} s"
        assert most <= MIB / 4
        session.send("HeapProfiler.collectGarbage")
        return (
            session.send("Runtime.getHeapUsage")["usedSize"],
            resident_bytes_of_descendants(),
            evicted,
        )

    heap, resident, evicted = fly(max(3, seconds / 6))
    heap_after, resident_after, evicted_after = fly(seconds)
    check_pool(visitor)
    assert evicted_after > evicted > 0, "no tile has left: the check sees nothing"
    print(
        f"  flight of {seconds} s: heap {heap / MIB:.1f} to {heap_after / MIB:.1f} MiB, "
        f"all processes {resident / MIB:.0f} to {resident_after / MIB:.0f} MiB, "
        f"{evicted} to {evicted_after} tiles have left"
    )
    assert heap_after < heap + 2 * MIB, "the heap grows"
    assert resident_after < resident + 64 * MIB, "the memory of the browser grows"
