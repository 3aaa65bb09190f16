"""Tiles that fail or are late and lost servers leave no holes, and the picture is right afterwards."""

import re

from picture_checks import HEIGHT, MIN_EQUAL_DEPTH, PLAIN, WIDTH, assert_equal, compare, holes

CONNECTION_LOST = "ERR_CONNECTION_REFUSED|ERR_FAILED|ERR_CONNECTION_RESET|ERR_EMPTY_RESPONSE|Failed to load resource"


# Requests for all tiles but the root's "arrive", "fail", or are "late" until their turn comes.
TILES = """
window.tiles = {way: "%s", asked: 0, held: []};
const plain_fetch = window.fetch;
window.fetch = async (url, options) => {
  if (/\\/tiles\\/(?!0\\/0\\?)/.test(url)) {
    ++tiles.asked;
    if (tiles.way === "fail") throw new TypeError("failed");
    if (tiles.way === "late") await new Promise((resolve) => tiles.held.push(resolve));
  }
  return plain_fetch(url, options);
};
"""


def check_missing_tiles(visitor, url, way, cameras, references):
    """Without any tile but the root's only detail is missing; it is there once the tiles come."""
    name, camera = "wide", cameras["wide"]
    visitor.context.add_init_script(TILES % way)
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera, complete=False)
    visitor.page.wait_for_timeout(500)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert visitor.page.evaluate("tiles.asked") > 0, "no tile was asked for"
    assert holes(references[name], depths) < 0.005, f"tiles that are {way} leave holes"
    _, near, _ = compare(references[name], depths, camera)
    assert near < MIN_EQUAL_DEPTH, f"tiles that are {way} are not missed: the check sees nothing"
    visitor.picture("missing")
    visitor.page.evaluate("tiles.way = 'arrive', tiles.held.forEach((resolve) => resolve())")
    visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(references[name], depths, camera, f"{name}, after tiles: {way}")


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
