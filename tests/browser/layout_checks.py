"""The layout of the dashboard: every badge is in its row, and no parts of a row overlap."""

LAYOUTS = [(width, scheme) for width in (320, 768, 1280) for scheme in ("light", "dark")]
ROWS = ".job-row, .title-row, .stage-row, .top-row, .find, .page-head, .scenes tr"

# Returns the faults of the current page as texts.
FAULTS = """(rows) => {
  const box = (element) => element.getBoundingClientRect();
  const isInside = (a, b) => a.left >= b.left - 1 && a.right <= b.right + 1 &&
      a.top >= b.top - 1 && a.bottom <= b.bottom + 1;
  const overlap = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
      Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const faults = [];
  for (const badge of document.querySelectorAll(".state")) {
    const row = badge.closest(rows);
    if (!row || !isInside(box(badge), box(row)))
      faults.push(`the badge "${badge.textContent}" is outside its row`);
  }
  for (const row of document.querySelectorAll(rows)) {
    const parts = [...row.children].filter((part) => box(part).width && box(part).height);
    for (const part of parts) {
      if (!isInside(box(part), box(row)))
        faults.push(`"${part.textContent}" is outside its row`);
      for (const other of parts)
        if (part !== other && overlap(box(part), box(other)))
          faults.push(`"${part.textContent}" overlaps "${other.textContent}"`);
    }
  }
  const wide = document.documentElement.scrollWidth - innerWidth;
  if (wide > 0) faults.push(`${wide} pixels wider than the window`);
  return faults;
}"""


# Returns the difference between the heights of the two columns of a page.
UNEQUAL = """() => {
  const [left, right] = [...document.querySelector(".two").children].map((e) => e.offsetHeight);
  return Math.abs(left - right);
}"""


def check_columns(page, limit=200):
    """Fails if one column of the page is much longer than the other one."""
    page.set_viewport_size({"width": 1280, "height": 800})
    difference = page.evaluate(UNEQUAL)
    assert difference <= limit, f"the columns differ by {difference} pixels"


def check_layout(page, pictures, name, visit):
    """Calls visit(page) for each width and theme, and checks the layout of the page it shows."""
    for width, scheme in LAYOUTS:
        page.set_viewport_size({"width": width, "height": 800})
        page.emulate_media(color_scheme=scheme)
        visit(page)
        page.screenshot(path=pictures / f"{name}-{width}-{scheme}.png")
        faults = page.evaluate(FAULTS, ROWS)
        assert not faults, f"{name}, {width} pixels, {scheme}: {faults}"
