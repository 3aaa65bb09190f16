"""Elements over the viewer's picture: card, measured line, focus frame, help, title, frames."""

import math
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from control_checks import PICK, center_of, numbers
from visitor import TWO_FRAMES

MARKS = """() => [".mark.picked", ".mark.start"].map((name) => {
  const box = document.querySelector(name).getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
})"""
LINE = """() => {
  const line = document.querySelector(".measured .line");
  const stage = document.querySelector(".stage").getBoundingClientRect();
  return ["2", "1"].map((end) => ["x", "y"].map(
      (axis) => Number(line.getAttribute(axis + end)) + stage[axis]));
}"""
ON_SKY = "async ([x, y]) => (await voxdagViewer.renderer.pick(x, y)) === null"


def inside(inner, outer):
    return (
        inner["x"] >= outer["x"]
        and inner["y"] >= outer["y"]
        and inner["x"] + inner["width"] <= outer["x"] + outer["width"]
        and inner["y"] + inner["height"] <= outer["y"] + outer["height"]
    )


def check_card(visitor, camera, press):
    """The card at the pick has the voxel of the panel; a measurement is drawn with its length."""
    page = visitor.page
    visitor.show(camera)
    x, y = center_of(page)
    press(x, y)
    card = page.locator(".pick-card")
    card.wait_for()
    stage = page.locator(".stage").bounding_box()
    assert inside(card.bounding_box(), stage), "the card is not in the picture"
    first = page.locator('[data-card="voxel"]').inner_text()
    assert first == page.evaluate("voxdagViewer.viewer.panel.pick.pick.voxel.join(', ')")
    assert not page.locator("#scene.keyed").count(), "a frame although no key was used"
    page.locator('[data-action="card-measure"]').click()
    press(x - 40, y + 30)
    page.locator('[data-card="measure"]').wait_for()
    page.evaluate(TWO_FRAMES)
    assert page.locator('[data-card="voxel"]').inner_text() != first
    for mark, end in zip(page.evaluate(MARKS), page.evaluate(LINE)):
        assert math.dist(mark, end) < 1.5, (mark, end)
    length = numbers(page.locator(".measured-length").inner_text())[0]
    assert length == numbers(page.locator('[data-card="measure"]').inner_text())[0] > 0
    assert inside(card.bounding_box(), stage), "the card is not in the picture"
    visitor.picture("measured")
    page.locator('[data-action="card-close"]').click()
    card.wait_for(state="hidden")
    assert page.locator(".measured-length").is_hidden()


def check_frame_of_keys(visitor):
    """The frame and the dot for keys appear with the first key and go with the next click."""
    page = visitor.page
    frame = "getComputedStyle(document.getElementById('scene')).outlineStyle"
    page.mouse.click(*center_of(page))
    assert page.evaluate(frame) == "none"
    page.keyboard.press("w")
    assert page.evaluate(frame) == "solid"
    page.mouse.click(*center_of(page))
    assert page.evaluate(frame) == "none"
    page.locator('[data-action="card-close"]').click()


def check_help_and_title(visitor, name, resolution):
    page = visitor.page
    page.locator("#scene").focus()
    page.keyboard.press("h")
    assert page.evaluate("document.querySelector('dialog').scrollTop") == 0
    page.get_by_role("button", name="Close").click()
    assert page.locator("#title").inner_text().startswith(name), page.locator("#title").inner_text()
    for text in (page.title(), page.locator("#title").inner_text()):
        assert f"{resolution}³" in text and "voxels" in text, text


def check_wheel_on_sky(visitor, camera):
    """The wheel over the sky moves toward the scene, and the scene remains in the picture."""
    page = visitor.page
    visitor.show(camera)
    place = next(at for at in ((4, 4), (700, 4), (4, 150)) if page.evaluate(ON_SKY, at))
    box = page.locator("#scene").bounding_box()
    page.mouse.move(box["x"] + place[0], box["y"] + place[1])
    first = visitor.camera()["eye"]
    for _ in range(6):
        eye = visitor.camera()["eye"]
        page.mouse.wheel(0, -200)
        visitor.wait_until("(eye) => voxdagViewer.camera.eye[0] !== eye[0]", eye)
    assert math.dist(visitor.camera()["eye"], first) > 1
    center = [box["width"] / 2, box["height"] / 2]
    assert page.evaluate(PICK.replace(".position", "?.position ?? null"), center), "left the scene"


def check_framing(visitor, url):
    """On a phone, the first picture shows the complete scene, as large as possible."""
    visitor.open(url)
    page = visitor.page
    page.evaluate("voxdagViewer.renderer.complete()")
    box = page.locator("#scene").bounding_box()
    width, height = 96, round(96 * box["height"] / box["width"])
    depths, _ = visitor.capture(width, height)
    seen = [(i % width, i // width) for i, depth in enumerate(depths) if math.isfinite(depth)]
    columns, rows = ([place[axis] for place in seen] for axis in (0, 1))
    assert min(columns) > 0 and max(columns) < width - 1, "the scene is cut off"
    assert min(rows) > 0 and max(rows) < height - 1, "the scene is cut off"
    share = max((max(columns) - min(columns)) / width, (max(rows) - min(rows)) / height)
    assert share > 0.8, f"the scene has only {share:.0%} of the picture"


class ParentPage(BaseHTTPRequestHandler):
    """Serves the page of another program of this machine. It has two frames with the viewer."""

    url = ""  # the URL of the viewer

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        for query in ("?embed#occlusion=0&amp;shadows=0", ""):
            frame = f"<iframe src='{self.url}/{query}' width=500 height=300></iframe>"
            self.wfile.write(frame.encode())

    def log_message(self, *_):
        pass


def check_embedded(visitor, url):
    """Pages of this machine can show the viewer in a frame only with ?embed."""
    page = visitor.page
    ParentPage.url = url
    with ThreadingHTTPServer(("127.0.0.1", 0), ParentPage) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with visitor.expecting("frame-ancestors|404"):
            page.goto(f"http://localhost:{server.server_port}/")
            frame = page.frames[1]
            for _ in range(600):
                if frame.evaluate("Boolean(window.voxdagViewer)"):
                    break
                page.wait_for_timeout(200)
        assert frame.locator("#scene").is_visible(), "no picture in the frame"
        assert frame.locator(".viewer-top").is_hidden()
        visitor.picture("embedded")
        server.shutdown()
