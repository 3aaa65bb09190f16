"""A browser window that shows the viewer, and the actions of the test."""

import base64
import contextlib
import os
import time
from array import array
from pathlib import Path

from chromium import Window

# Pixels of the canvas per pixel of the page. Low, because a CPU draws here.
PIXEL_RATIO = 0.5

# Waits for two animation frames. After them, the picture shows the view of the new camera.
TWO_FRAMES = """async () => {
  for (let i = 0; i < 2; ++i) await new Promise((resolve) => requestAnimationFrame(resolve));
}"""

SHOW = """async ([camera, complete]) => {
  const {viewer, renderer} = window.voxdagViewer;
  viewer.flyToText(camera);
  await (TWO_FRAMES)();
  if (!complete) return;
  await renderer.complete();
  if (!renderer.progress.isFullSize || !renderer.isSunPlaced)
    throw new Error("complete() came before the final picture");
}""".replace("TWO_FRAMES", TWO_FRAMES)

CAPTURE = """async ([width, height]) => {
  const {depth, level} = await window.voxdagViewer.renderer.capture({width, height});
  const text = (bytes) => {
    let out = "";
    for (let i = 0; i < bytes.length; i += 32768)
      out += String.fromCharCode(...bytes.subarray(i, i + 32768));
    return btoa(out);
  };
  return [text(new Uint8Array(depth.buffer, depth.byteOffset, depth.byteLength)), text(level)];
}"""


# The pixels of the canvas, rows from the top: red, green, blue, alpha.
READ_CANVAS = """async () => {
  const {renderer, viewer} = window.voxdagViewer;
  while (renderer.statistics().samples < 16) {
    viewer.schedule();
    await new Promise((resolve) => requestAnimationFrame(resolve));
  }
  const scene = document.getElementById("scene"), copy = document.createElement("canvas");
  copy.width = scene.width;
  copy.height = scene.height;
  const context = copy.getContext("2d");
  context.drawImage(scene, 0, 0);
  const {data} = context.getImageData(0, 0, copy.width, copy.height);
  let out = "";
  for (let i = 0; i < data.length; i += 32768)
    out += String.fromCharCode(...data.subarray(i, i + 32768));
  return [copy.width, copy.height, btoa(out)];
}"""


class Visitor(Window):
    def __init__(self, browser, pictures, name, width=720, height=230, **options):
        options = {"reduced_motion": "reduce", "device_scale_factor": PIXEL_RATIO, **options}
        super().__init__(
            browser, pictures, name, viewport={"width": width, "height": height}, **options
        )

    def open(self, url, wait=True):
        self.page.goto("about:blank")  # a new fragment alone would not reload the page
        self.page.goto(url)
        if wait:
            self.wait_until("Boolean(window.voxdagViewer)")

    def wait_until(self, expression, argument=None):
        """Polls an expression. The policy forbids Playwright's wait_for_function."""
        deadline = time.monotonic() + self.timeout_ms / 1000
        while not self.page.evaluate(expression, argument):
            assert time.monotonic() < deadline, (
                f"{self.name}: not within {self.timeout_ms} ms: {expression}"
            )
            self.page.wait_for_timeout(50)

    def show(self, camera, complete=True):
        self.page.evaluate(SHOW, [camera, complete])

    def capture(self, width, height):
        depth_text, level_text = self.page.evaluate(CAPTURE, [width, height])
        depths = array("f")
        depths.frombytes(base64.b64decode(depth_text))
        levels = base64.b64decode(level_text)
        assert len(depths) == len(levels) == width * height
        return depths, levels

    def canvas(self):
        """Returns width, height and pixels of the complete canvas, four bytes per pixel."""
        width, height, text = self.page.evaluate(READ_CANVAS)
        pixels = base64.b64decode(text)
        assert len(pixels) == 4 * width * height
        return width, height, pixels

    def statistics(self):
        return self.page.evaluate("window.voxdagViewer.renderer.statistics()")

    def camera(self):
        return self.page.evaluate("window.voxdagViewer.camera.get()")

    def camera_text(self):
        """Returns the string in the panel, which follows the camera with a delay."""
        self.page.evaluate(TWO_FRAMES)
        self.wait_until("!voxdagViewer.viewer.bookmarkTimer")
        return self.page.locator("#camera-text").inner_text()


def resident_bytes_of_descendants():
    """Returns the resident memory of all child processes, direct or not: mostly the browser."""
    parents, pages = {}, {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        with contextlib.suppress(OSError):
            stat = (folder / "stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
            parents[int(folder.name)] = int(stat[1])
            pages[int(folder.name)] = int(stat[21])
    total = 0
    for pid, count in pages.items():
        ancestor = pid
        while ancestor in parents and ancestor != os.getpid():
            ancestor = parents[ancestor]
        total += count if ancestor == os.getpid() and pid != os.getpid() else 0
    return total * os.sysconf("SC_PAGE_SIZE")
