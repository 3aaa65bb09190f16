#!/usr/bin/env python3
"""Counts sentence patterns that make comments and pages hard to read (CONTRIBUTING.md, "Language").

    tools/source/check_prose.py [--list] [PATH...]     default: all tracked files

Prose is comments of C++, CUDA, JavaScript and CSS, comments and docstrings of Python, comments of CMake and
shell, and paragraphs of Markdown outside of code. A pattern marks a place to look at; each has good uses. So
the check limits the rate per top-level folder, in places per 1,000 lines of prose. Prints the rates, and the
lines of every folder above the limit; exits 1 if there is one.
"""

import argparse
import collections
import pathlib
import re
import subprocess
import sys

MAX_PER_1000 = 6
# If a folder has fewer lines of prose, its rate is computed for this number of lines. Otherwise a single finding
# would make the check fail for a small folder.
MIN_LINES = 200

VERBS = (
    "is|are|was|were|has|have|had|comes|came|lies|stays|does|do|did|can|cannot|could|must|may|takes|took|needs|fits"
    "|goes|remains|belongs|depends|follows|cost|costs|counts|reads|writes|makes|made|gives|gets"
)
PATTERNS = {
    "name the thing": rf"\bwhat (?!(?:if|went|happens|happened|to)\b)(?:\w+ )?"
    rf"(?:{VERBS}|it|they|a|an|the|each|every|one|others|no|users|people)\b",
    "repeat the noun": r"\b(?:that|those) of\b",
    "begin with a subject": r"^\s*(?:Of|For the least|Besides|Further|As many|As much|So much|So many)\b",
    "use an adjective": r"\b(?:[Oo]ne|[Tt]hose|[Aa]ll|[Nn]one|[Tt]hat) that "
    r"(?:is|are|was|were|has|have|had|cannot|can|does|do)\b",
    "is in, is stored in": r"\b(?:lies|lie|lay|lying)\b",
    "remains, is kept": r"\b(?:stays?|stayed)\b",
    "immediately, concurrently, finally": r"\b(?:at once|at a time|by turns|at last|for good|in the end|by now"
    r"|so far as|anew|amid|besides|meanwhile)\b",
    "reports, requests": r"\b(?:is|are|was|were) (?:said|told|asked|looked|waited|begun|tried)\b"
    r"|\bsays (?:so|what|which|how|whether)\b|\basked for\b",
    "exists, is present": r"\b(?:is|are|was|were) (?:there|gone|none|so)\b(?! (?:a|an|any|no|to)\b)",
    "complete, intact": r"\b(?:as a whole|is whole|are whole|wholly)\b",
    "also, before the verb": r", too\b",
    "differs from": r"\banother \w+ than\b|\bother than that\b|\bof (?:its|their|our|his) own\b|\bours\b|\bforeign\b",
    "because it lacks; on demand; fix": r"\bfor want of\b|\bby (?:need|windows|place|hand|turns)\b|\bmends?\b|\bmended\b",
    "normal word order": r"^\s*(?:Uncharged|Unlike others|Thread-safe are|Not counted|Not included|Named|Left out"
    r"|Read|Written|Given) (?:is|are)\b",
}
COMPILED = {cure: re.compile(pattern) for cure, pattern in PATTERNS.items()}
# This file contains the patterns themselves, and the license is a fixed text.
LEFT_OUT = {"tools/source/check_prose.py", "LICENSE"}

SLASHES = (".h", ".cc", ".cpp", ".cu", ".cuh", ".c", ".js", ".css")
HASHES = (".py", ".sh", ".cmake", ".yml", "CMakeLists.txt")


def markdown_prose(lines):
    fenced = False
    for number, line in enumerate(lines, start=1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif not fenced and not line.startswith("    ") and line.strip():
            yield number, re.sub(r"`[^`]*`", "`", line)


def slash_prose(lines):
    in_block = False
    for number, line in enumerate(lines, start=1):
        if in_block:
            in_block = "*/" not in line
            yield number, line.split("*/")[0].lstrip(" *")
        elif match := re.search(r"(?:^|\s)(?://[/!]?(?P<line>.*)|/\*+(?P<block>.*))$", line):
            in_block = match["block"] is not None and "*/" not in match["block"]
            text = match["line"] if match["line"] is not None else match["block"]
            if text.strip(" -=/*"):
                yield number, text.replace("*/", "")


def hash_prose(lines):
    in_docstring = False
    for number, line in enumerate(lines, start=1):
        quotes = line.count('"""')
        if in_docstring or quotes:
            if quotes % 2:
                in_docstring = not in_docstring
            if text := line.replace('"""', "").strip():
                yield number, text
        elif not line.startswith("#!") and (match := re.search(r"(?:^|\s)# ?(.*\S)", line)):
            yield number, match[1]


def prose_of(path):
    """Yields (line number, text) for each line of prose in a file."""
    try:
        lines = pathlib.Path(path).read_text(encoding="utf-8").split("\n")
    except (UnicodeDecodeError, OSError):
        return iter(())
    if path.endswith(".md"):
        return markdown_prose(lines)
    if path.endswith(SLASHES):
        return slash_prose(lines)
    if path.endswith(HASHES) or lines[0].startswith("#!"):
        return hash_prose(lines)
    return iter(())


def tracked_files(paths):
    listing = subprocess.run(
        ["git", "ls-files", "-z", *paths], check=True, capture_output=True, text=True
    )
    return [path for path in listing.stdout.split("\0") if path and path not in LEFT_OUT]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--list", action="store_true", help="print every place, in all folders")
    parser.add_argument("paths", nargs="*")
    arguments = parser.parse_args()
    lines, places = collections.Counter(), collections.defaultdict(list)
    for path in tracked_files(arguments.paths):
        folder = path.split("/")[0] if "/" in path else "top level"
        for number, text in prose_of(path):
            lines[folder] += 1
            for cure, pattern in COMPILED.items():
                places[folder] += [f"{path}:{number}: [{cure}] {text.strip()}"] * len(
                    pattern.findall(text)
                )
    failed = False
    for folder in sorted(lines):
        rate = 1000 * len(places[folder]) / max(lines[folder], MIN_LINES)
        is_above = rate > MAX_PER_1000
        failed |= is_above
        if arguments.list or is_above:
            print("\n".join(places[folder]))
        print(
            f"{folder}: {lines[folder]} lines of prose, {rate:.1f} places per 1,000 lines (at most {MAX_PER_1000})"
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
