"""Headless Chromium, driven by Playwright, and windows of it that record every error."""

import contextlib
import os
import re
import shutil
import tempfile
from pathlib import Path

SKIPPED = 77  # what ctest counts as skipped

WATCH_POLICY = """
window.violations = [];
document.addEventListener("securitypolicyviolation", (event) =>
  window.violations.push(`${event.violatedDirective} ${event.blockedURI}`));
delete window.showSaveFilePicker;  // it would open a dialog that nobody answers
"""


def in_chromium(name, screenshots, check, options=()):
    """Calls check(browser, folder, screenshots folder) and returns the exit status of the test."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("skipped: no Playwright here (pip install playwright)")
        return SKIPPED
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if not chromium:
        print("skipped: no Chromium here (apt-get install chromium)")
        return SKIPPED
    # Chromium's sandbox does not work for root.
    options = [*options, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with tempfile.TemporaryDirectory(prefix=f"check-{name}-") as scratch, sync_playwright() as play:
        pictures = Path(screenshots or Path(scratch) / "screenshots").resolve()
        pictures.mkdir(parents=True, exist_ok=True)
        browser = play.chromium.launch(executable_path=chromium, args=options)
        check(browser, Path(scratch), pictures)
        browser.close()
    print(f"the {name} passes")
    return 0


class Window:
    """Records every error that the browser reports; leave() fails if there were any."""

    timeout_ms = 60_000  # for each step

    def __init__(self, browser, pictures, name, **options):
        self.name, self.pictures = name, pictures
        self.context = browser.new_context(accept_downloads=True, **options)
        self.context.set_default_timeout(self.timeout_ms)
        self.context.add_init_script(WATCH_POLICY)
        self.page = self.context.new_page()
        self.errors = []
        self.expected = None  # pattern of console errors that the current step causes
        self.page.on("console", self.on_console)
        self.page.on("pageerror", lambda error: self.errors.append(f"page error: {error}"))

    def on_console(self, message):
        is_error = message.type == "error" or "INVALID_" in message.text
        if is_error and not (self.expected and re.search(self.expected, message.text)):
            self.errors.append(f"console: {message.text} ({message.location.get('url')})")

    @contextlib.contextmanager
    def expecting(self, pattern):
        self.expected = pattern
        yield
        self.expected = None

    def picture(self, name, full_page=False):
        self.page.screenshot(path=self.pictures / f"{name}-{self.name}.png", full_page=full_page)
        wide = self.page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, f"{name} ({self.name}): {wide} pixels wider than the window"

    def leave(self):
        violations = self.page.evaluate("window.violations")
        assert not violations, f"{self.name}: policy violated: {violations}"
        assert not self.errors, f"{self.name}: {self.errors}"
        self.context.close()
