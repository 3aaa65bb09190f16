"""Failed or late tiles and lost servers leave no holes, and the final picture is right."""

import time

from picture_checks import HEIGHT, MIN_EQUAL_DEPTH, PLAIN, WIDTH, assert_equal, compare, holes

CONNECTION_LOST = (
    "ERR_CONNECTION_REFUSED|ERR_FAILED|ERR_CONNECTION_RESET|ERR_EMPTY_RESPONSE"
    "|Failed to load resource"
)


# Changes the requests for all tiles except the root. `tiles.way` decides: they "arrive", they
# "fail", or they are "late", which means that they wait until the test releases them.
TILES = """
window.tiles = {way: "%s", pauseMs: 0, asked: 0, held: []};
const plainFetch = window.fetch;
window.fetch = async (url, options) => {
  if (/\\/tiles\\/(?!0\\/0\\?)/.test(url)) {
    ++tiles.asked;
    if (tiles.way === "fail") throw new TypeError("failed");
    if (tiles.pauseMs) await new Promise((resolve) => setTimeout(resolve, tiles.pauseMs));
    if (tiles.way === "late") await new Promise((resolve) => tiles.held.push(resolve));
  }
  return plainFetch(url, options);
};
"""


def check_missing_tiles(visitor, url, way, cameras, references):
    """With the root tile alone only detail is missing; it appears once the tiles arrive."""
    name, camera = "street", cameras["street"]
    visitor.page.add_init_script(TILES % way)
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera, complete=False)
    visitor.wait_until("tiles.asked > 0")
    visitor.page.wait_for_timeout(200)  # so that failed requests have an effect
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert holes(references[name], depths) < 0.005, f"tiles that are {way} leave holes"
    _, near, _ = compare(references[name], depths, camera)
    assert near < MIN_EQUAL_DEPTH, f"tiles that are {way} are not missed: the check sees nothing"
    visitor.picture("missing")
    visitor.page.evaluate("tiles.way = 'arrive', tiles.held.forEach((resolve) => resolve())")
    visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(references[name], depths, camera, f"{name}, after tiles: {way}")


# The first request for several tiles is never answered.
HANG = """
const answeringFetch = window.fetch;
window.hangs = 0;
window.fetch = (url, options) =>
  /\\/tiles\\/batch/.test(url) && !hangs++ ? new Promise(() => {}) : answeringFetch(url, options);
"""


def check_hanging_request(visitor, url):
    """One request without an answer does not delay the other tiles of a view."""
    visitor.page.add_init_script(HANG)
    visitor.open(f"{url}/{PLAIN}")
    visitor.wait_until("hangs > 0")
    visitor.wait_until("performance.getEntriesByName('voxdag: tiles of the first view').length > 0")


# Simulates a browser that compiles a program only when its result is queried. Counts the programs
# that were linked before the first query.
SERIAL_COMPILER = """
const {getExtension, linkProgram, getProgramParameter} = WebGL2RenderingContext.prototype;
const serial = window.serial = {linked: 0, beforeResult: 0};
WebGL2RenderingContext.prototype.getExtension = function(name) {
  return name === "KHR_parallel_shader_compile" ? null : getExtension.call(this, name);
};
WebGL2RenderingContext.prototype.linkProgram = function(program) {
  ++serial.linked;
  linkProgram.call(this, program);
};
WebGL2RenderingContext.prototype.getProgramParameter = function(program, name) {
  serial.beforeResult ||= serial.linked;
  return getProgramParameter.call(this, program, name);
};
"""


def check_serial_compiler(visitor, url):
    """All programs of the first picture are linked before the first result is queried."""
    visitor.page.add_init_script(SERIAL_COMPILER)
    visitor.open(f"{url}/{PLAIN}")
    visitor.wait_until("voxdagViewer.renderer.hasDrawn")
    assert visitor.page.evaluate("serial.beforeResult") == 6, visitor.page.evaluate("serial")


def check_restart(visitor, server, cameras, references):
    """Requests tiles while the server is down; the picture completes after its restart."""
    visitor.open(f"{server.url}/{PLAIN}")
    visitor.show(cameras["top"])
    with visitor.expecting(CONNECTION_LOST):
        server.kill()
        visitor.show(cameras["street"], complete=False)
        visitor.wait_until("voxdagViewer.renderer.statistics().failed > 0")
        depths, _ = visitor.capture(WIDTH, HEIGHT)
        assert holes(references["street"], depths) < 0.005, "a lost server leaves holes"
        visitor.page.locator("#status.bad").wait_for()
        server.start()
        visitor.show(cameras["street"])
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(references["street"], depths, cameras["street"], "street, after a restart")
    visitor.page.locator("#status:not(.bad)").wait_for(state="attached")


# Treats the first camera, which determines the sun, as inside the scene. Returns whether the view
# becomes complete within two minutes. This is long, because a busy machine draws slowly.
COMPLETE_WITH_SUN = """async (pauseMs) => {
  const {viewer, renderer, camera, manifest} = voxdagViewer, {eye, target} = camera.get();
  renderer.light.placeSun(eye, target.map((c, axis) => c - eye[axis]));
  renderer.light.outside = false;
  renderer.sun.idleTrials = 6,
  renderer.sun.fewestMissing = 0;  // of 8 that may wait for tiles in vain
  tiles.pauseMs = pauseMs;
  tiles.asked = 0;
  viewer.setOptions({shadows: true});
  return Promise.race([
    renderer.complete().then(() => true),
    new Promise((resolve) => setTimeout(() => resolve(false), 120000))
  ]);
}"""


def check_late_sun(visitor, url, camera):
    """A view inside the scene completes with a placed sun even if its tiles are late."""
    visitor.page.add_init_script(TILES % "arrive")
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera)
    before = visitor.page.evaluate("voxdagViewer.renderer.light.sun")
    assert visitor.page.evaluate(COMPLETE_WITH_SUN, 1500), "the view is never complete"
    assert visitor.page.evaluate("tiles.asked") > 0, "the sun needs no tile: the check sees nothing"
    assert visitor.page.evaluate("voxdagViewer.renderer.light.sun") != before, (
        "the sun has not moved"
    )


# Draws and picks as soon as the context is restored, before programs and tiles are restored.
LOSE = """() => {
  const {viewer, renderer} = voxdagViewer;
  window.lost = {
    context: renderer.context.gl.getExtension("WEBGL_lose_context"),
    restored: 0,
    errors: []
  };
  viewer.canvas.addEventListener("webglcontextrestored", async () => {
    ++lost.restored;
    try {
      renderer.setOptions({});  // begins the picture again
      renderer.frame(performance.now());
      await renderer.pick(10, 10);
    } catch (error) {
      lost.errors.push(String(error.stack));
    }
  });
  lost.context.loseContext();
}"""


# The first context is lost as soon as it is created.
LOSE_AT_ONCE = """
const itsContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function(kind, ...more) {
  const made = itsContext.call(this, kind, ...more);
  if (kind === "webgl2" && made && !window.earlyLoss) {
    window.earlyLoss = made.getExtension("WEBGL_lose_context");
    %s
  }
  return made;
};
"""
LOSSES = {
    "before the page": "earlyLoss.loseContext();",
    "while programs compile": "setTimeout(() => earlyLoss.loseContext());",
}
LOSE_AND_RESTORE = """earlyLoss.loseContext();
addEventListener("webglcontextlost", () => setTimeout(() => earlyLoss.restoreContext()), true);"""


def hold_page(visitor):
    """Delays the page's main module, so the context exists and changes before it runs."""

    def hold(route):
        time.sleep(0.5)
        route.continue_()

    visitor.page.route("**/viewer/main.js", hold)


def check_early_loss(visitor, url, when, camera, reference):
    """If the context is lost before the first frame, the page waits for it and then starts."""
    page = visitor.page
    visitor.page.add_init_script(LOSE_AT_ONCE % LOSSES[when])
    if when == "before the page":
        hold_page(visitor)
    with visitor.expecting("CONTEXT_LOST|Context lost"):
        visitor.open(f"{url}/{PLAIN}", wait=False)
        page.get_by_text("The graphics card is not available").wait_for()
        assert not page.evaluate("Boolean(window.voxdagViewer)"), (
            "it began before the context was lost: the check sees nothing"
        )
        assert page.locator('[data-tool="screenshot"]').is_disabled(), (
            "a picture is to be saved that is not there"
        )
        page.locator("#scene").press("p")
        page.get_by_text("There is no picture yet.").wait_for(state="attached")
        page.evaluate("earlyLoss.restoreContext()")
        visitor.wait_until("Boolean(window.voxdagViewer)")
        visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(reference, depths, camera, f"after a context that was lost {when}")
    assert page.locator('[data-tool="screenshot"]').is_enabled(), "the picture cannot be saved"


def check_brief_loss(visitor, url):
    """A context lost and restored before the main module runs works like a new one."""
    visitor.page.add_init_script(LOSE_AT_ONCE % LOSE_AND_RESTORE)
    hold_page(visitor)
    with visitor.expecting("CONTEXT_LOST|Context lost"):
        visitor.open(f"{url}/{PLAIN}")
        visitor.wait_until("voxdagViewer.renderer.hasDrawn")


def check_lost_context(visitor, url, camera, reference):
    """A lost context is reported and restored, even after a second loss in between."""
    page = visitor.page
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera)
    with visitor.expecting("CONTEXT_LOST|Context lost"):
        page.evaluate(LOSE)
        page.get_by_text("The graphics card is not available").wait_for()
        assert page.evaluate("voxdagViewer.renderer.pick(10, 10)") is None
        page.evaluate("lost.context.restoreContext()")
        visitor.wait_until("lost.restored === 1")
        page.evaluate("lost.context.loseContext()")
        visitor.wait_until("voxdagViewer.renderer.context.isLost")
        page.evaluate("lost.context.restoreContext()")
        visitor.wait_until("lost.restored === 2")
        visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(reference, depths, camera, "after a lost context")
    errors = page.evaluate("lost.errors")
    assert not errors, errors
    visitor.wait_until("document.getElementById('status').textContent === ''")
