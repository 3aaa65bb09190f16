"""Packages of `voxdag publish`, on servers that answer requests for ranges in different ways."""

import contextlib
import gzip
import re
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

from picture_checks import HEIGHT, MIN_EQUAL_DEPTH, PLAIN, WIDTH, assert_equal, compare

# How a server answers a request for a range.
#   ranges:     with the range
#   whole:      with the complete file, like `python -m http.server`
#   compressed: with a range of the compressed file, like some content delivery networks
#   refused:    with an error
#   strict:     with the range; and with a policy that forbids modules of blob: URLs
HOSTS = ["ranges", "whole", "compressed", "refused", "strict"]
CHECKED_HOSTS = ["ranges", "compressed", "strict"]  # to save time
HOSTS_OF_RANGES = ["ranges", "strict"]
POLICY = (
    "default-src 'none'; script-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "style-src 'unsafe-inline'"
)
PUBLIC_URL = "https://example.org/scene"
RANGE = re.compile(r"bytes=(\d+)-(\d+)$")


class Handler(SimpleHTTPRequestHandler):
    """Serves a folder below /scenes/one/. `host` is one of HOSTS."""

    protocol_version = "HTTP/1.1"

    def __init__(self, *arguments, host, **options):
        self.host = host
        super().__init__(*arguments, **options)

    def log_message(self, *_):
        pass

    def translate_path(self, path):
        return super().translate_path(path.removeprefix("/scenes/one"))

    def end_headers(self):
        self.send_header("Access-Control-Allow-Origin", "*")
        self.send_header("Cache-Control", "no-store")
        if self.host == "strict":
            self.send_header("Content-Security-Policy", POLICY)
        super().end_headers()

    def do_GET(self):
        wanted = RANGE.match(self.headers.get("Range", ""))
        if not wanted or self.host == "whole":
            return super().do_GET()
        if self.host == "refused":
            return self.send_error(416)
        try:
            with open(self.translate_path(self.path.split("?")[0]), "rb") as file:
                contents = file.read()
        except OSError:
            return self.send_error(404)
        if self.host == "compressed":
            contents = gzip.compress(contents, 1)
        begin, end = int(wanted[1]), min(int(wanted[2]) + 1, len(contents))
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{len(contents)}")
        self.send_header("Content-Length", str(max(0, end - begin)))
        self.end_headers()
        self.wfile.write(contents[begin:end])
        return None


@contextlib.contextmanager
def serve(folder, host):
    """Yields the URL of a server of a package's folder."""
    server = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(Handler, directory=str(folder), host=host)
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/scenes/one"
    finally:
        server.shutdown()
        server.server_close()


def check_host(visitor, url, host, camera, reference):
    """The picture is the same from every server, and the page requests no range in vain. Loads the
    compressed viewer, unless the policy of the server forbids it."""
    ranges, modules = [], []
    visitor.page.on(
        "request", lambda request: ranges.append((request.url, request.headers.get("range")))
    )
    visitor.page.on(
        "request",
        lambda request: modules.extend(re.findall(r"/viewer-[0-9a-f]+(\.js)$", request.url)),
    )
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(reference, depths, camera, f"a package from a server of kind {host}")
    ranges = [(url, RANGE.match(asked)) for url, asked in ranges if asked]
    assert (len(ranges) > 1) == (host in HOSTS_OF_RANGES), f"{host}: {ranges}"
    if host in HOSTS_OF_RANGES:
        places = sorted((url, int(asked[1]), int(asked[2])) for url, asked in ranges)
        for (url, _, end), (next_url, begin, _) in zip(places, places[1:]):
            assert (url, end) < (next_url, begin), f"{url}: byte {begin} is requested twice"
    assert len(modules) == (host == "strict"), f"{host}: {len(modules)} plain modules"
    if host == "strict":
        violations = visitor.page.evaluate("window.violations.splice(0)")
        assert violations == ["script-src-elem blob"], violations


def check_single_file(visitor, walk, city, camera, reference):
    """A page that contains its package shows the same picture without a web server."""
    path = walk.folder / "single.html"
    walk.voxdag.run("publish", city.built, "-o", path, "--single-file")
    visitor.open(f"{path.as_uri()}{PLAIN}")
    visitor.show(camera)
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    assert_equal(reference, depths, camera, "a package in one file")


def check_first_picture(visitor, url):
    """The page draws the first picture with the tiles of the head, without a request for a pack."""
    page, requests = visitor.page, []
    page.route("**/packs/*", lambda route: route.abort())
    page.on("request", lambda request: requests.append(request.url.removeprefix(url)))
    visitor.open(f"{url}/")
    visitor.wait_until("window.voxdagViewer?.renderer.measured.hasFirstPicture")
    early = [each for each in requests if not each.startswith("/packs/")]
    kinds = sorted(re.split(r"[-.]", each[1:] or "index")[0] for each in early)
    expected = ["directory", "head", "index", "package", "poster", "start", "viewer"]
    assert kinds == expected, kinds


def check_poster(visitor, url):
    """The page shows the poster until the viewer has drawn."""
    page, scripts = visitor.page, []
    page.route("**/viewer-*.bin", lambda route: scripts.append(route))
    page.goto(f"{url}/", wait_until="commit")
    visitor.wait_until("document.getElementById('poster')?.naturalWidth === 640")
    image = page.locator('meta[property="og:image"]').get_attribute("content")
    assert image.startswith(f"{PUBLIC_URL}/poster-"), image
    while not scripts:
        page.wait_for_timeout(10)
    scripts[0].continue_()
    visitor.wait_until(
        "window.voxdagViewer?.renderer.hasDrawn && !document.getElementById('poster')"
    )


def check_missing_packs(visitor, url, folder, camera, reference):
    """Without its last packs, the package is drawn coarse, and the page reports it."""
    packs = sorted((folder / "packs").iterdir(), key=lambda path: int(path.name.split("-")[0]))
    assert len(packs) > 1, "the package has too few packs for this check"
    for pack in packs[1:]:
        pack.unlink()
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera, complete=False)
    visitor.wait_until("document.getElementById('status').textContent.includes('--check')")
    depths, _ = visitor.capture(WIDTH, HEIGHT)
    _, near, _ = compare(reference, depths, camera)
    assert near < MIN_EQUAL_DEPTH, "no tile is missing: the check sees nothing"
    visitor.picture("missing-packs")


def check_later_version(visitor, url, camera):
    """The page reports that another version of the format has replaced its package."""
    answers = []

    def answer(route):
        answer = route.fetch()
        index = answer.json()
        if answers:
            index = {"format": index["format"], "version": 1000}
        answers.append(index)
        route.fulfill(response=answer, json=index)

    visitor.page.route("**/package.json", answer)
    visitor.open(f"{url}/{PLAIN}")
    visitor.show(camera, complete=False)
    visitor.wait_until("document.getElementById('status').textContent.includes('replaced')")
    visitor.page.unroute("**/package.json", answer)


def check_packages(walk, city):
    """Checks a package of the city."""
    folder = walk.folder / "package"
    walk.voxdag.run(
        "publish", city.built, "-o", folder, "--pack-size", "512KiB", "--url", PUBLIC_URL
    )
    camera, reference = city.cameras["street"], city.references["street"]
    for host in CHECKED_HOSTS:
        with serve(folder, host) as url:
            visitor = walk.visitor(f"package-{host}")
            errors = {"refused": "416", "strict": "blob:"}
            with visitor.expecting(errors.get(host, "nothing")):
                check_host(visitor, url, host, camera, reference)
            visitor.leave()
        walk.say(f"a package from a server of kind {host}")
    with serve(folder, "ranges") as url:
        visitor = walk.visitor("package-poster")
        check_poster(visitor, url)
        visitor.leave()
        walk.say("the poster of a package")
    with serve(folder, "ranges") as url:
        visitor = walk.visitor("package-first", width=400, height=200)
        with visitor.expecting("ERR_FAILED"):  # requests for packs can fail until the page closes
            check_first_picture(visitor, url)
            visitor.leave()
        walk.say("the first picture of a package")
    visitor = walk.visitor("package-single")
    check_single_file(visitor, walk, city, camera, reference)
    visitor.leave()
    walk.say("a package in one file")
    with serve(folder, "ranges") as url:
        visitor = walk.visitor("package-missing")
        with visitor.expecting("404"):
            check_missing_packs(visitor, url, folder, camera, reference)
            check_later_version(visitor, url, camera)
        visitor.leave()
    walk.say("a package without its last packs")
