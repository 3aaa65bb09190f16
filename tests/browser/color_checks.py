"""Colors equal the colors of `voxdag render` with all pages, with few, and with none."""

import base64
import json
import struct

from picture_checks import HEIGHT, WIDTH, assert_light

MIN_SHARE = 0.03  # minimum share of the picture for each box
MAX_MEAN = 3  # maximum difference of a channel's mean, of 255

# Decodes a PNG picture of the canvas. Returns its pixels, the top row first.
DECODE = """async (png) => {
  const image = new Image();
  image.src = `data:image/png;base64,${png}`;
  await image.decode();
  const copy = document.createElement("canvas");
  copy.width = image.width;
  copy.height = image.height;
  const context = copy.getContext("2d");
  context.drawImage(image, 0, 0);
  let out = "";
  for (const byte of context.getImageData(0, 0, copy.width, copy.height).data)
    out += String.fromCharCode(byte);
  return btoa(out);
}"""

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOXES = [
    ((0, 0, 0), (1, 1, 1), (1, 0, 0, 1)),
    ((1.2, 0, 0), (2.2, 1, 1), (0.02, 0.1, 0.9, 1)),
    ((-1, -0.2, -1), (3, -0.1, 2), (0.02, 0.4, 0.02, 1)),
]


def write_boxes(path):
    """Writes a .glb with a red and a blue box on a green plate."""
    indices = struct.pack("<36H", *(i for a, b, c, d in SIDES for i in (a, b, c, a, c, d)))
    data = indices
    accessors = [{"bufferView": 0, "componentType": 5123, "count": 36, "type": "SCALAR"}]
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": len(indices)}]
    meshes, materials = [], []
    for low, high, color in BOXES:
        points = struct.pack(
            "<24f", *((low, high)[corner[axis]][axis] for corner in CORNERS for axis in range(3))
        )
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(points)})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": 5126,
                "count": 8,
                "type": "VEC3",
                "min": list(low),
                "max": list(high),
            }
        )
        meshes.append(
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": len(accessors) - 1},
                        "indices": 0,
                        "material": len(materials),
                    }
                ]
            }
        )
        materials.append({"pbrMetallicRoughness": {"baseColorFactor": color}})
        data += points
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"mesh": i} for i in range(len(meshes))],
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(
        struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
        + text
        + struct.pack("<II", len(data), 0x004E4942)
        + data
    )


def pixels_of(visitor):
    width, height, pixels = visitor.canvas()
    assert (width, height) == (WIDTH, HEIGHT), (width, height)
    return pixels


def share(pixels, channel):
    """Returns the share of pixels in which one channel exceeds twice both others."""
    others = [c for c in range(3) if c != channel]
    count = sum(
        pixels[at + channel] > 2 * max(pixels[at + c] for c in others) + 20
        for at in range(0, len(pixels), 4)
    )
    return count / (len(pixels) / 4)


def means(pixels):
    return [sum(pixels[channel::4]) / (len(pixels) / 4) for channel in range(3)]


def rendered(visitor, voxdag, built, camera, *options, size=(WIDTH, HEIGHT)):
    path = voxdag.folder / "colors.png"
    voxdag.run(
        "render",
        built,
        "-o",
        path,
        *camera.split(),
        "--force",
        "--size",
        "x".join(map(str, size)),
        "--samples",
        2,
        *options,
    )
    return base64.b64decode(
        visitor.page.evaluate(DECODE, base64.b64encode(path.read_bytes()).decode())
    )


def assert_colored(pixels, reference, what):
    shares = [[share(each, channel) for channel in range(3)] for each in (pixels, reference)]
    off = max(abs(a - b) for a, b in zip(means(pixels), means(reference)))
    print(
        f"  {what}: red, green, blue "
        + ", ".join(f"{100 * a:.1f} ({100 * b:.1f})" for a, b in zip(*shares))
        + f" % of the picture (of render's); means within {off:.1f}"
    )
    for ours, its in zip(*shares):
        assert its > MIN_SHARE, "too little of a box to see"
        assert abs(ours - its) < 0.2 * its, f"{what}: the boxes do not have their colors"
    assert off < MAX_MEAN, f"{what}: other colors than those of render"


def check_colors(visitor, voxdag, url, built, camera):
    """Colors appear first and equal `render`'s. G switches to gray and back."""
    reference = rendered(visitor, voxdag, built, camera)
    gray = rendered(visitor, voxdag, built, camera, "--gray")
    visitor.show(camera)
    colored = pixels_of(visitor)
    depths = voxdag.render(built, camera, WIDTH, HEIGHT)
    assert_colored(colored, reference, "colors")
    assert_light(colored, reference, depths, "the colors", has_shadow=True)
    visitor.picture("colors")
    visitor.page.locator("#scene").focus()
    visitor.page.keyboard.press("g")
    visitor.show(camera)
    plain = pixels_of(visitor)
    off = [max(abs(a - b) for a, b in zip(means(plain), means(each))) for each in (gray, reference)]
    print(f"  gray: means within {off[0]:.1f} of render --gray, {off[1]:.1f} of its colors")
    assert_light(plain, gray, depths, "gray", has_shadow=True)
    assert max(share(plain, channel) for channel in range(3)) == 0, (
        "colors are shown though they are switched off"
    )
    assert off[0] < MAX_MEAN < off[1], "the gray picture is not that of render --gray"
    visitor.wait_until("location.hash.includes('color=0')")
    assert not visitor.page.locator("#switch-color").is_checked()
    visitor.page.locator("#switch-color").check()
    visitor.show(camera)
    assert_colored(pixels_of(visitor), reference, "colors again")
    check_small_pool(visitor, url, camera, reference)
    check_without_pages(visitor, url, camera, gray)


def check_small_pool(visitor, url, camera, reference):
    """A pool too small for all views evicts pages, and the last view is right."""
    visitor.open(f"{url}/?budget=0.0001")
    visitor.show(camera)
    seen = visitor.statistics()
    assert (
        0 < seen["poolBytes"] + seen["colorPoolBytes"] <= seen["budgetBytes"] <= 1 << 18
        and seen["colorPages"] > 0
    ), seen
    visitor.open(f"{url}/?budget=1")
    for _ in range(2):
        for turn in range(4):
            visitor.page.evaluate("(turn) => voxdagViewer.camera.turn(0.4 * turn, 0.1)", turn)
            visitor.page.evaluate("voxdagViewer.viewer.schedule()")
            visitor.page.evaluate("voxdagViewer.renderer.complete()")
    visitor.show(camera)
    assert_colored(pixels_of(visitor), reference, "1 MiB")
    seen = visitor.statistics()
    assert 0 < seen["colorBytes"] <= seen["colorPoolBytes"] <= 1 << 18, seen
    assert seen["poolBytes"] + seen["colorPoolBytes"] <= seen["budgetBytes"], seen
    # Searches the hash table for every loaded page as the shaders do. No other entry may be in use.
    wrong = visitor.page.evaluate("""() => {
  const {store} = voxdagViewer.renderer.stream.colors;
  let wrong = 0, used = 0;
  for (const page of store.pages.values()) {
    if (page.blocks.length === 0) continue;
    let at = store.homeOf(page.place);
    while (store.words[4 * at + 3] !== 0 &&
           page.place.some((word, i) => store.words[4 * at + i] !== word))
      at = at + 1 & store.entries - 1;
    wrong += store.words[4 * at + 3] !== page.blocks[0] + 1;
    ++used;
  }
  for (let at = 0; at < store.entries; ++at) used -= store.words[4 * at + 3] !== 0;
  return [wrong, used, store.evicted];
}""")
    assert wrong[:2] == [0, 0] and wrong[2] > 0, (
        f"wrong entries, unknown ones, pages that left: {wrong}"
    )


def check_without_pages(visitor, url, camera, gray):
    """Without any page the picture is gray and has no holes."""
    visitor.page.route("**/tiles/colors*", lambda route: route.abort())
    with visitor.expecting("Failed to load resource"):
        visitor.open(url)
        visitor.show(camera, complete=False)
        visitor.wait_until(
            "voxdagViewer.renderer.problem && voxdagViewer.renderer.stream.loader.isIdle"
        )
        visitor.wait_until("voxdagViewer.renderer.progress.isFullSize")
        plain = pixels_of(visitor)
        visitor.picture("no-pages")
    visitor.page.unroute("**/tiles/colors*")
    off = max(abs(a - b) for a, b in zip(means(plain), means(gray)))
    print(f"  without pages: means within {off:.1f} of render --gray")
    assert off < MAX_MEAN, "without pages it is not gray"
    visitor.wait_until("!voxdagViewer.renderer.problem")
    visitor.show(camera)
    assert share(pixels_of(visitor), 0) > MIN_SHARE, "the colors have not come back"
