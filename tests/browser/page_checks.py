"""Pages without WebGL2, with an expired token, and of a job of the service."""

import json
import math
import re

NO_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function(kind, ...more) {
  return kind === "webgl2" ? null : getContext.call(this, kind, ...more);
};
"""
# Simulates a driver that offers WebGL2 but cannot compile the shaders.
NO_PROGRAMS = """
const parameter = WebGL2RenderingContext.prototype.getProgramParameter;
WebGL2RenderingContext.prototype.getProgramParameter = function(program, name) {
  return name === this.LINK_STATUS ? false : parameter.call(this, program, name);
};
"""


def check_without_webgl(visitor, url, still, lack=NO_WEBGL):
    """Without WebGL2 the page shows the render command, and the still picture of a job."""
    visitor.page.add_init_script(lack)
    visitor.open(f"{url}#camera=1,2.5,-3e2&target=0,0,0&fov=$(id)", wait=False)
    page = visitor.page
    page.get_by_text("needs WebGL2").wait_for()
    command = page.get_by_text("voxdag render FILE.vdag").inner_text()
    assert command.endswith(" --camera 1,2.5,-3e2 --target 0,0,0"), (
        f"not to be copied to a shell: {command}"
    )
    if still:
        visitor.wait_until("document.querySelector('img.still')?.naturalWidth > 100")
    visitor.picture("no-webgl")


def check_expired_token(visitor, viewer, token):
    """An expired token leads to the login page before the first tile, to a message later."""
    page, expired = visitor.page, []

    def expire(route):
        if expired[0].search(route.request.url):
            route.continue_(headers={**route.request.headers, "authorization": "Bearer expired"})
        else:
            route.continue_()

    with visitor.expecting("status of 401"):
        page.route(re.compile("/tiles"), expire)
        expired[:] = [re.compile(r"/tiles$")]
        visitor.open(viewer, wait=False)
        page.get_by_label("Token").wait_for()
        expired[:] = [re.compile(r"/tiles/0/0")]
        page.get_by_label("Token").fill(token)
        with page.expect_response(expired[0]):
            page.keyboard.press("Enter")
        visitor.wait_until("document.querySelector('#message:not([hidden]) input')?.value === ''")
        for part in ("panel", "tools", "scene"):
            assert page.locator(f"#{part}").is_hidden(), f"#{part} is shown next to the form"
        expired[:] = [re.compile(r"/tiles/batch|/tiles/[1-9]")]
        page.get_by_label("Token").fill(token)
        page.keyboard.press("Enter")
        page.get_by_text("The service no longer accepts the token").wait_for()
        depths, _ = visitor.capture(64, 36)
        assert any(math.isfinite(d) for d in depths), "nothing is drawn without a token"
        page.unroute(re.compile("/tiles"))
        page.locator("#status:not(.bad)").wait_for(state="attached")
    page.evaluate("voxdagViewer.renderer.complete()")


def check_job(visitor, server, voxdag, scene, token):
    """The viewer of a job opens from the job's page, with a token, and inside the page."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    token_file = ["--token-file", scene.parent / "token"] if token else []
    job = json.loads(
        voxdag.run("submit", scene, "-r", 256, "--server", server.url, "--json", *token_file)
    )
    page = visitor.page
    viewer = f"{server.url}/viewer.html?job={job['id']}"
    if token:
        # Waits until the job has succeeded. If it ended right after the viewer saw it running, a
        # request for its partial result would fail, and Chromium would report this as an error.
        while json.loads(server.get(f"/api/v1/jobs/{job['id']}", headers))["state"] != "succeeded":
            page.wait_for_timeout(100)
        with visitor.expecting("status of 401"):
            visitor.open(viewer, wait=False)
            page.get_by_label("Token").fill(token)
            page.keyboard.press("Enter")
            visitor.wait_until("Boolean(window.voxdagViewer)")
    else:
        visitor.open(f"{server.url}/#/jobs/{job['id']}", wait=False)
        page.locator('[data-action="view"]').click()
        visitor.wait_until("Boolean(window.voxdagViewer)")
    depths, _ = visitor.capture(64, 36)
    assert any(math.isfinite(d) for d in depths) and any(math.isinf(d) for d in depths)
    visitor.picture("job")
    page.locator("#home").click()
    page.locator(".title-row .state.succeeded").wait_for()
    while not json.loads(server.get(f"/api/v1/jobs/{job['id']}", headers))["preview"]:
        page.wait_for_timeout(200)
    page.locator(".picture img").wait_for()
    page.locator('[data-action="look"]').click()
    page.locator(".picture canvas").wait_for()
    page.keyboard.press("h")
    page.get_by_role("dialog").wait_for()
    page.keyboard.press("Escape")
    assert page.url.endswith(f"#/jobs/{job['id']}"), (
        "the picture's camera has replaced the page's address"
    )
    visitor.picture("page")
    page.evaluate(
        "window.embedded = document.querySelector('.picture canvas').getContext('webgl2')"
    )
    assert not page.evaluate("embedded.isContextLost()")
    page.evaluate("location.hash = '#/jobs'")
    # The page releases the graphics context, because it remains open and a browser has few
    # contexts.
    visitor.wait_until("embedded.isContextLost()")
    if token:
        check_expired_token(visitor, viewer, token)
    return viewer
