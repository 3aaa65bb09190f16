"""Mouse, touch, keyboard, panel, address and messages of the viewer."""

import math
import re

from picture_checks import HEIGHT, WIDTH, address, numbers
from visitor import PIXEL_RATIO

PICK = "async ([x, y]) => (await voxdagViewer.renderer.pick(x, y)).position"
CAMERA_DIGITS = 5  # digits that `render` prints and keeps


def distance(a, b):
    return math.dist(a, b)


def center_of(page):
    box = page.locator("#scene").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def wait_for_pick(page):
    page.locator('[data-fact="voxel"]').wait_for()
    return {
        name: page.locator(f'[data-fact="{name}"]').inner_text()
        for name in ("voxel", "scene", "level", "node")
    }


def check_pick(visitor, dag, camera):
    """A picked voxel and its node are in the file, at the place that the picture shows."""
    visitor.show(camera)
    page = visitor.page
    page.mouse.click(*center_of(page))
    facts = wait_for_pick(page)
    voxel = [int(number) for number in numbers(facts["voxel"])]
    level = int(facts["level"].split()[0])
    node_level, offset = (int(number) for number in facts["node"].split("/"))
    assert level == dag.levels, f"not a voxel: {facts}"
    assert dag.is_set(voxel), f"the file has no voxel {voxel}"
    assert node_level <= dag.levels - 2 and dag.find(voxel, node_level) == offset, facts
    scene = numbers(facts["scene"])
    size = dag.edge / dag.resolution
    for axis in range(3):
        in_voxels = (scene[axis] - dag.origin[axis]) / size
        assert voxel[axis] - 0.01 <= in_voxels <= voxel[axis] + 1.01, facts
    eye = visitor.camera()["eye"]
    forward = [b - a for a, b in zip(eye, visitor.camera()["target"])]
    # In the center of the picture, no voxel of the file is nearer along the ray.
    far = distance(eye, [(scene[axis] - dag.origin[axis]) / size for axis in range(3)])
    for step in range(int(far) - 2):
        cell = [math.floor(a + step * f / math.hypot(*forward)) for a, f in zip(eye, forward)]
        inside = all(0 <= c < dag.resolution for c in cell)
        assert not (inside and dag.is_set(cell)), f"{cell} is in front of {voxel}"


def check_measure(visitor):
    """The measured distance equals the distance of the two positions."""
    page = visitor.page
    x, y = center_of(page)
    first = numbers(wait_for_pick(page)["scene"])
    page.get_by_role("button", name="Measure from here").click()
    page.mouse.click(x + 25, y + 20)
    visitor.wait_until(
        "document.querySelector('[data-fact=\"measure\"]')?.textContent.startsWith('0 ') === false"
    )
    second = numbers(wait_for_pick(page)["scene"])
    in_scene = numbers(page.locator('[data-fact="measure"]').inner_text())[1]
    assert first != second and math.isclose(in_scene, distance(first, second), rel_tol=1e-3)
    page.locator("summary", has_text="Clipping box").click()
    page.get_by_role("button", name="Box of the two picks").click()
    low, high = page.evaluate("(({low, high}) => [low, high])(voxdagViewer.viewer.options.clip)")
    assert all(a < b for a, b in zip(low, high))
    page.get_by_label("Show only the inside of a box").uncheck()
    assert page.evaluate("voxdagViewer.viewer.options.clip") is None
    # After a click into the sky, the start of the measurement and the buttons for it remain.
    page.evaluate("voxdagViewer.viewer.panel.pick.set(null)")
    page.get_by_role("button", name="Measure from here", pressed=True).wait_for()
    page.get_by_role("button", name="Clear").click()
    page.locator("#scene").focus()
    page.keyboard.press("m")
    page.get_by_text("Pick a voxel first").wait_for(state="attached")
    assert page.get_by_role("button", name="Measure from here").count() == 0


def steady_place(reference, radius=3):
    """Returns the canvas pixel whose neighborhood has the most even distances, all of them hits."""

    def spread(place):
        x, y = place
        around = [
            reference[row * WIDTH + column]
            for row in range(y - radius, y + radius + 1)
            for column in range(x - radius, x + radius + 1)
        ]
        return max(around) / min(around)

    places = [
        (x, y) for x in range(radius, WIDTH - radius, 2) for y in range(radius, HEIGHT - radius, 2)
    ]
    x, y = min((place for place in places if math.isfinite(spread(place))), key=spread)
    return (x + 0.5) / PIXEL_RATIO, (y + 0.5) / PIXEL_RATIO


def check_mouse(visitor, camera, reference):
    """Drags orbit and pan, the wheel zooms to the cursor, a double click sets the pivot."""
    page = visitor.page
    visitor.show(camera)
    x, y = center_of(page)
    before = visitor.camera()

    def drag(button, dx, dy):
        page.mouse.move(x, y)
        page.mouse.down(button=button)
        page.mouse.move(x + dx / 2, y + dy / 2)
        page.mouse.move(x + dx, y + dy)
        page.mouse.up(button=button)
        return visitor.camera()

    orbited = drag("left", 60, 10)
    assert orbited["target"] == before["target"] and distance(orbited["eye"], before["eye"]) > 1
    assert math.isclose(
        distance(orbited["eye"], orbited["target"]),
        distance(before["eye"], before["target"]),
        rel_tol=1e-9,
    )
    panned = drag("right", 40, 0)
    shift = [b - a for a, b in zip(orbited["eye"], panned["eye"])]
    assert distance(
        shift, [b - a for a, b in zip(orbited["target"], panned["target"])]
    ) < 1e-6 * math.hypot(*shift)

    visitor.show(camera)
    cursor = steady_place(reference)
    point = page.evaluate(PICK, cursor)
    box = page.locator("#scene").bounding_box()
    on_page = box["x"] + cursor[0], box["y"] + cursor[1]
    page.mouse.move(*on_page)
    for _ in range(3):
        eye = visitor.camera()["eye"]
        page.mouse.wheel(0, -200)
        visitor.wait_until(
            "(eye) => voxdagViewer.camera.eye[0] !== eye[0] &&"
            " voxdagViewer.viewer.controls.anchor.point",
            eye,
        )
    zoomed = visitor.camera()
    assert distance(zoomed["eye"], point) < 0.8 * distance(before["eye"], point)
    again = page.evaluate(PICK, cursor)
    assert distance(point, again) < 0.1 * distance(zoomed["eye"], point), (
        "the cursor's place has moved"
    )
    page.mouse.dblclick(*on_page)
    visitor.wait_until(
        "([x]) => Math.abs(voxdagViewer.camera.target[0] - x) < 1e-6 + Math.abs(x) / 50", again
    )
    assert visitor.camera()["eye"] == zoomed["eye"]
    page.get_by_role("button", name="Reset").click()
    visitor.wait_until(
        "(eye) => Math.hypot(...voxdagViewer.camera.eye.map((c, axis) => c - eye[axis])) > 1",
        zoomed["eye"],
    )


def check_camera_text(visitor, voxdag, built, camera):
    """Panel, address and `render` print the same camera."""
    page = visitor.page
    visitor.show(camera, complete=False)
    page.keyboard.press("w")
    text = visitor.camera_text()
    printed = voxdag.printed_camera(built, text)
    mine = numbers(text)
    theirs = [*printed["camera"], *printed["target"], printed["fov"]]
    assert all(
        math.isclose(a, b, rel_tol=10**-CAMERA_DIGITS, abs_tol=1e-9) for a, b in zip(mine, theirs)
    ), (mine, theirs)
    before, address = visitor.camera(), page.url
    visitor.show(camera, complete=False)
    page.get_by_label("Move the camera to").fill(f"voxdag render x.vdag {text} --samples 2")
    page.get_by_role("button", name="Show").click()
    size = distance(before["eye"], before["target"])
    assert distance(visitor.camera()["eye"], before["eye"]) < 1e-3 + 1e-6 * size
    assert visitor.camera_text() == text and page.url == address
    assert "#c=" in address, address
    visitor.open(address)
    assert visitor.camera_text() == text and page.url == address, (
        "the address does not bring the camera back"
    )
    page.get_by_label("Move the camera to").fill("--camera 1,2")
    page.keyboard.press("Enter")
    page.get_by_text("Expected --camera X,Y,Z.").wait_for()


# Sets the fragment of the address while the camera glides to another place. Waits until the camera
# stops, and returns whether it was gliding.
FOLLOW = """async ([elsewhere, hash]) => {
  const {viewer} = voxdagViewer;
  if (elsewhere) viewer.flyToText(elsewhere);
  const glides = viewer.motion.flight !== null;
  await new Promise((resolve) => {
    addEventListener("hashchange", resolve, {once: true});
    location.hash = hash;
  });
  while (viewer.motion.flight) await new Promise((resolve) => requestAnimationFrame(resolve));
  return glides;
}"""
# Clipping boxes in addresses, and the boxes that the viewer uses for them in a grid of `edge`
# voxels per edge.
BOXES = [
    ("-5,1.6,0,9e99,10.2,1e300", lambda edge: {"low": [0, 2, 0], "high": [edge, 10, edge]}),
    ("1e9,0,0,2e9,9,9", lambda edge: None),
    ("1.1,0,0,1.4,9,9", lambda edge: None),
]


def check_addresses(visitor, resolution, cameras):
    """An address takes effect during a glide. Invalid values are reported or clamped."""
    page = visitor.page
    visitor.show(cameras["street"], complete=False)
    wanted = visitor.camera()
    visitor.show(cameras["top"], complete=False)
    page.emulate_media(reduced_motion="no-preference")
    assert page.evaluate(FOLLOW, [cameras["wide"], address("", cameras["street"])[1:]]), (
        "no glide: the check sees nothing"
    )
    page.emulate_media(reduced_motion="reduce")
    off = distance(visitor.camera()["eye"], wanted["eye"])
    assert off < 1e-3 * resolution, (
        f"an address that came in a glide was lost: {off} voxels from its place"
    )
    for refused in (
        "#camera=1,2,x&target=0,0,0",
        "#camera=1,2,NaN&target=0,0,0",
        "#camera=1,2,3&target=0,0,0&fov=1e9",
        "#c=1,2,3,0,0",
        "#c=1,2,3,0,0,0,35,7",
    ):
        page.evaluate(FOLLOW, [None, refused])
        page.locator("#status.bad", has_text="The camera of the address cannot be used.").wait_for()
        page.locator("#scene").focus()
        page.keyboard.press("w")
        page.locator("#status:not(.bad)").wait_for(state="attached")
    page.evaluate(FOLLOW, [None, "#occlusion=0&shadows=0&level=0"])
    assert page.evaluate("voxdagViewer.viewer.options.level") == 1
    note = page.locator("output", has_text="cubes of").inner_text()
    assert re.sub(r"\D", "", note) == str(resolution // 2), note
    for text, expected in BOXES:
        page.evaluate(FOLLOW, [None, f"#occlusion=0&shadows=0&clip={text}"])
        assert page.evaluate("voxdagViewer.viewer.options.clip") == expected(resolution), text
    page.evaluate(FOLLOW, [None, "#occlusion=0&shadows=0"])


def focused(page):
    return page.evaluate(
        "document.activeElement.id || document.activeElement.textContent ||"
        " document.activeElement.tagName"
    )


def tab_to(page, wanted, max_steps=60):
    for _ in range(max_steps):
        page.keyboard.press("Tab")
        if page.evaluate("(selector) => document.activeElement.matches(selector)", wanted):
            style = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
            assert style != "none", f"the focus on {wanted} cannot be seen"
            return
    raise AssertionError(f"the Tab key does not reach {wanted}; it is at {focused(page)}")


OPPOSITE = {
    "ArrowLeft": "ArrowRight",
    "ArrowUp": "ArrowDown",
    "w": "s",
    "e": "q",
    "a": "d",
    "+": "-",
}


def check_keyboard(visitor, url, camera):
    """Every action works without a mouse, starting at the top of the page."""
    visitor.open(url)
    visitor.show(camera, complete=False)
    page = visitor.page
    page.evaluate("document.activeElement.blur()")
    tab_to(page, "#home")
    tab_to(page, "#scene")
    for key, what in (
        ("ArrowLeft", "orbit"),
        ("ArrowUp", "orbit"),
        ("w", "fly"),
        ("e", "rise"),
        ("a", "fly left"),
        ("+", "zoom in"),
    ):
        before = visitor.camera()["eye"]
        page.keyboard.press(key)
        moved = visitor.camera()["eye"]
        assert moved != before, f"{key} does not {what}"
        page.keyboard.press(OPPOSITE[key])
        # The distance depends on how long a key is down, the direction does not.
        back = visitor.camera()["eye"]
        along = sum((m - b) * (k - m) for b, m, k in zip(before, moved, back))
        assert along < 0, f"{OPPOSITE[key]} is not the opposite of {key}"
    before = visitor.camera()["eye"]
    page.keyboard.press("r")
    visitor.wait_until(
        "(eye) => voxdagViewer.camera.eye.some((c, axis) => Math.abs(c - eye[axis]) > 1)", before
    )
    visitor.show(camera, complete=False)
    page.keyboard.press("f")
    before = visitor.camera()
    page.keyboard.press("ArrowRight")
    assert (
        visitor.camera()["eye"] == before["eye"] and visitor.camera()["target"] != before["target"]
    ), "no flight"
    page.keyboard.press("f")
    visitor.show(camera, complete=False)
    page.keyboard.press("Enter")
    wait_for_pick(page)
    visitor.wait_until(
        "document.getElementById('announcer').textContent.startsWith('Picked voxel')"
    )
    page.keyboard.press("m")
    page.get_by_role("button", name="Measure from here", pressed=True).wait_for()
    page.keyboard.press("c")
    page.get_by_text("orbits around this place").wait_for(state="attached")
    page.keyboard.press("h")
    page.get_by_role("dialog").wait_for()
    visitor.picture("help")
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="detached")
    assert focused(page) == "scene"
    with page.expect_download() as download:
        page.keyboard.press("p")
    with open(download.value.path(), "rb") as file:
        head = file.read(24)
    assert head[:8] == b"\x89PNG\r\n\x1a\n" and int.from_bytes(head[16:20], "big") > 100
    page.keyboard.press("o")
    assert page.locator("#panel").is_hidden()
    page.keyboard.press("o")
    assert page.locator("#panel").is_visible() and focused(page) == "scene"
    check_keyboard_in_panel(visitor)


def check_keyboard_in_panel(visitor):
    page = visitor.page
    option = "voxdagViewer.viewer.options"
    tab_to(page, ".panel-part:nth-child(3) summary")
    page.keyboard.press("Enter")
    tab_to(page, "#clip-on")
    page.keyboard.press("Space")
    tab_to(page, ".clip-axis input")
    page.keyboard.press("PageUp")
    assert page.evaluate(f"{option}.clip.low[0]") > 0
    tab_to(page, '.panel input[type="range"][max]:not(.clip-axis input)')
    level = page.evaluate(f"{option}.level")
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(f"{option}.level") == level - 1
    tab_to(page, ".panel .field select")
    page.keyboard.press("ArrowDown")
    assert page.evaluate(f"{option}.wire") == 0
    tab_to(page, "#switch-occlusion")
    page.keyboard.press("Space")
    assert page.evaluate(f"{option}.occlusion") is True
    visitor.camera_text()
    for part in ("clip=", f"level={level - 1}", "wire=0", "shadows=0"):
        assert part in page.url, f"{part} is not in the address {page.url}"
    page.reload()
    visitor.wait_until("Boolean(window.voxdagViewer)")
    assert page.evaluate(f"[{option}.level, {option}.wire, {option}.occlusion]") == [
        level - 1,
        0,
        True,
    ]
    visitor.picture("options")


def check_phone(visitor, url, camera):
    """At 390 x 844 nothing overflows; one finger orbits, two fingers zoom, a tap picks."""
    visitor.open(url)
    page = visitor.page
    box = page.locator("#scene").bounding_box()
    assert box["width"] == 390 and box["height"] > 500, box
    visitor.picture("first")
    visitor.show(camera, complete=False)
    x, y = center_of(page)
    session = visitor.context.new_cdp_session(page)

    def touch(kind, *points):
        session.send(
            "Input.dispatchTouchEvent",
            {
                "type": kind,
                "touchPoints": [{"x": px, "y": py, "id": i} for i, (px, py) in enumerate(points)],
            },
        )

    before = visitor.camera()
    touch("touchStart", (x, y))
    for step in (10, 30, 60):
        touch("touchMove", (x + step, y))
    touch("touchEnd")
    assert (
        visitor.camera()["target"] == before["target"] and visitor.camera()["eye"] != before["eye"]
    )
    before = visitor.camera()
    touch("touchStart", (x - 30, y))
    touch("touchStart", (x - 30, y), (x + 30, y))
    for step in (40, 60, 90):
        touch("touchMove", (x - step, y), (x + step, y))
    touch("touchEnd")
    after = visitor.camera()
    assert distance(after["eye"], after["target"]) < 0.6 * distance(
        before["eye"], before["target"]
    ), "no pinch"
    visitor.show(camera, complete=False)
    page.touchscreen.tap(x, y)
    page.get_by_role("button", name="Panel").tap()
    wait_for_pick(page)
    for button in page.locator("#tools button:visible").all():
        size = button.bounding_box()
        assert size["width"] >= 24 and size["height"] >= 24, (
            f"too small for a finger: {button.inner_text()} {size}"
        )
        assert size["x"] >= 0 and size["x"] + size["width"] <= 390, (
            f"out of reach: {button.inner_text()} {size}"
        )
    box = page.locator("#scene").bounding_box()
    assert box["height"] >= 844 * 0.4, "the panel leaves too little of the picture"
    visitor.picture("panel")
