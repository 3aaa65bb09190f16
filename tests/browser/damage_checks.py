"""Files with damaged, removed or replaced parts, in the whole page."""

import json
import re
import struct
from urllib.parse import parse_qs, urlsplit

from loader_checks import check_bad_input, check_trials
from memory_checks import check_many_tiles
from picture_checks import HEIGHT, PLAIN, WIDTH, camera_text, holes


class Faults:
    """A proxy that changes some answers to requests for tiles and color pages."""

    def __init__(self, page):
        self.page, self.asked = page, []
        self.way = "none"
        # The names of the damaged tile, the damaged color page and the malformed tile, once chosen.
        self.tile = self.page_of_colors = self.malformed = None
        page.route(re.compile(r"/api/.*/tiles(/|$)"), self.answer)

    def answer(self, route):
        names = self.names_of(route.request.url)
        self.asked.append(names)
        if self.way == "damaged":
            self.answer_damaged(route, names)
        elif self.way == "removed":
            self.refuse(route, 404, "not_found")
        elif self.way == "replaced" and names:
            self.refuse(route, 410, "gone")
        elif self.way == "no root" and names == ["0.0"]:
            self.refuse(route, 500, "corrupt")
        else:
            route.continue_()

    @staticmethod
    def names_of(url):
        """Returns the names in a request: LEVEL.OFFSET of tiles, LEVEL.X.Y.Z of color pages. A
        request for the manifest has no names."""
        parts = urlsplit(url)
        query = parse_qs(parts.query)
        if "nodes" in query or "pages" in query:
            return (query.get("nodes") or query["pages"])[0].split(",")
        single = re.search(r"/tiles/(\d+)/(\d+)$", parts.path)
        return [f"{single[1]}.{single[2]}"] if single else []

    @staticmethod
    def refuse(route, status, code):
        route.fulfill(
            status=status,
            content_type="application/problem+json",
            body=json.dumps({"status": status, "code": code, "detail": f"it is {code}"}),
        )

    def answer_damaged(self, route, names):
        if len(names) > 1:
            if names[0].count(".") == 3:
                self.page_of_colors = self.page_of_colors or names[0]
            else:
                self.tile, self.malformed = self.tile or names[0], self.malformed or names[1]
        if self.tile in names or self.page_of_colors in names:
            self.refuse(route, 500, "corrupt")
        elif self.malformed in names:
            answer = route.fetch()
            route.fulfill(response=answer, body=self.with_wrong_shape(answer.body(), names))
        else:
            route.continue_()

    def with_wrong_shape(self, body, names):
        """Sets the level count of the damaged tile in an answer to 200."""
        begin = 0
        if len(names) > 1:
            for name in names:
                (length,) = struct.unpack_from("<I", body, begin)
                begin += 4
                if name == self.malformed:
                    break
                begin += length
        shape = struct.unpack_from("<I", body, begin + 4)[0] & 255 | 200 << 8
        return body[: begin + 4] + struct.pack("<I", shape) + body[begin + 8 :]

    def tries_alone(self, name):
        return self.asked.count([name])


def status_says(visitor, text):
    visitor.wait_until(
        "(text) => document.getElementById('status').textContent.includes(text)", text
    )


def check_damaged_parts(visitor, faults, url, wide, reference):
    """Damaged tiles and pages are reported; the view completes without holes."""
    warnings = []
    visitor.page.on(
        "console",
        lambda message: warnings.append(message.text) if message.type == "warning" else None,
    )
    faults.way = "damaged"
    with visitor.expecting("status of 500"):
        visitor.open(f"{url}/{PLAIN}")
        visitor.show(wide)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert holes(reference, depths) < 0.005, "damaged tiles leave holes"
    status_says(visitor, "damaged and drawn coarse: run voxdag verify")
    # The remaining samples of the picture can request a few more tiles.
    visitor.wait_until("voxdagViewer.renderer.statistics().loading === 0")
    seen = visitor.statistics()
    assert seen["tiles"] > 10 and seen["colorPages"] > 10, seen
    for name, what, most in (
        (faults.tile, "tile", 1),
        (faults.malformed, "tile", 3),
        (faults.page_of_colors, "color page", 1),
    ):
        assert 1 <= faults.tries_alone(name) <= most, (
            f"{what} {name} was asked for {faults.tries_alone(name)} times alone"
        )
        said = f"voxdag: {what} {name.replace('.', '/')} is unusable"
        assert any(said in warning for warning in warnings), f"{said}: {warnings}"
    before = len(faults.asked)
    visitor.page.wait_for_timeout(300)
    again = {faults.tile, faults.malformed, faults.page_of_colors} & {
        name for names in faults.asked[before:] for name in names
    }
    assert not again, f"the view is complete, and asks for {again}"


def check_file_that_goes(visitor, faults, url, near, wide):
    """A removed or replaced file is reported and requests end. "Reload" shows the new one."""
    page = visitor.page
    for way, status, text in (
        ("removed", 404, "The file was removed"),
        ("replaced", 410, "replaced by another one"),
    ):
        faults.way = "none"
        visitor.open(f"{url}/{PLAIN}")
        visitor.show(near)
        faults.way, faults.asked = way, []
        with visitor.expecting(f"status of {status}"):
            visitor.show(wide)
            status_says(visitor, text)
        before = len(faults.asked)
        assert 0 < before <= 7, f"{way}: {faults.asked}"  # requests in flight, manifest
        visitor.show(near)
        visitor.show(wide)
        assert len(faults.asked) == before, f"{way}: asks for {faults.asked[before:]}"
    faults.way = "none"
    page.evaluate("window.isOld = true")
    page.get_by_role("button", name="Reload").click()
    visitor.wait_until("!window.isOld && Boolean(window.voxdagViewer)")
    visitor.show(wide)


def check_root_that_fails(visitor, faults):
    """A root that fails to load after a lost context is reported."""
    with visitor.expecting("CONTEXT_LOST|Context lost|status of 500|it is corrupt"):
        faults.way = "no root"
        visitor.page.evaluate("""async () => {
  const {renderer, viewer} = voxdagViewer,
                   context = renderer.context.gl.getExtension("WEBGL_lose_context");
  const lost = new Promise(
      (resolve) => viewer.canvas.addEventListener("webglcontextlost", resolve, {once: true}));
  context.loseContext();
  await lost;
  setTimeout(() => context.restoreContext());
}""")
        status_says(visitor, "it is corrupt")
        visitor.page.locator("#status.bad").wait_for()


def check_all(walk, server, built):
    """Runs all checks of this module, with a small file that has colors."""
    wide = walk.voxdag.named_view(built, "iso")
    eye, target = (
        list(map(float, re.search(rf"--{name} (\S+)", wide)[1].split(",")))
        for name in ("camera", "target")
    )
    near = camera_text([b + 0.1 * (a - b) for a, b in zip(eye, target)], target, 20)
    reference = walk.voxdag.render(built, wide, WIDTH, HEIGHT)
    visitor = walk.visitor("unlucky", width=660, height=150)
    visitor.open(f"{server.url}/{PLAIN}")
    check_bad_input(visitor)
    check_trials(visitor)
    walk.say("bad input, trials of the loader")
    check_many_tiles(visitor)
    walk.say("many tiles")
    faults = Faults(visitor.page)
    check_damaged_parts(visitor, faults, server.url, wide, reference)
    check_file_that_goes(visitor, faults, server.url, near, wide)
    check_root_that_fails(visitor, faults)
    faults.way = "none"
    visitor.leave()
    walk.say("damaged, removed and replaced files")
