"""Headless Chromium, driven by Playwright, and windows of it that record every error."""

import contextlib
import copy
import importlib.util
import os
import re
import shutil
import tempfile
from pathlib import Path

SKIPPED = 77  # ctest reports this exit status as skipped

WATCH_POLICY = """
window.violations = [];
document.addEventListener("securitypolicyviolation", (event) =>
  window.violations.push(`${event.violatedDirective} ${event.blockedURI}`));
delete window.showSaveFilePicker;  // it would open a dialog that nobody answers
"""


def missing():
    """Returns the missing requirement of browser tests, or None."""
    if importlib.util.find_spec("playwright") is None:
        return "no Playwright here (pip install playwright)"
    if not chromium_path():
        return "no Chromium here (apt-get install chromium)"
    return None


def chromium_path():
    return shutil.which("chromium") or shutil.which("chromium-browser")


def in_chromium(name, screenshots, check, options=()):
    """Calls check(browser, folder, screenshots folder) and returns the exit status of the test."""
    if lack := missing():
        print(f"skipped: {lack}")
        return SKIPPED
    from playwright.sync_api import sync_playwright

    # Chromium's sandbox does not work for root.
    options = [*options, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with tempfile.TemporaryDirectory(prefix=f"check-{name}-") as scratch, sync_playwright() as play:
        pictures = Path(screenshots or Path(scratch) / "screenshots").resolve()
        pictures.mkdir(parents=True, exist_ok=True)
        browser = play.chromium.launch(executable_path=chromium_path(), args=options)
        check(browser, Path(scratch), pictures)
        browser.close()
    print(f"the {name} passes")
    return 0


class Window:
    """A page that records every error the browser reports. leave() fails if there were any."""

    timeout_ms = 120_000  # limit of each step; long enough for a slow machine

    def __init__(self, browser, pictures, name, **options):
        self.context = browser.new_context(accept_downloads=True, **options)
        self.context.set_default_timeout(self.timeout_ms)
        self.owns_context = True
        self.begin(pictures, name)

    def another(self, name):
        """Returns a window that shares the cache and options of this one, so it opens faster."""
        other = copy.copy(self)
        other.owns_context = False
        other.begin(self.pictures, name)
        return other

    def begin(self, pictures, name):
        self.name, self.pictures = name, pictures
        self.page = self.context.new_page()
        self.page.add_init_script(WATCH_POLICY)
        self.errors = []
        self.expected = None  # pattern of the console errors that the current step causes
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
        (self.context if self.owns_context else self.page).close()
