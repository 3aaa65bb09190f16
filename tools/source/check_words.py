#!/usr/bin/env python3
"""Checks that names, comments, messages and docs use the standard terms (CONTRIBUTING.md, "Style").

Each rule gives words that were used here once and the term that replaced them. Prints one line per
finding, as "file:line: ..."; exits 1 if there is any. `--count` prints one line per rule instead.
"""

import re
import subprocess
import sys

UNITS = (
    "voxels|units|bits|bytes|words|rows|nodes|bricks|triangles|requests|tokens|pixels|tests|files|jobs"
    "|ns|ms|[KMG]i?B"
)
EACH = (
    "edge|axis|node|brick|voxel|row|word|byte|level|cube|cell|triangle|subvolume|file|line|page|second"
    "|minute|hour|day|worker|thread|core|client|connection|request|doubling"
)

# Each rule is a standard term and the pattern of the words that it replaces. A pattern also matches a part of an
# identifier, unless \b prevents this.
RULES = [
    (
        "max_, min_, kMax, kMin",
        r"k(Most|Least)[A-Z]|(?<![a-z])(most|least)_(?!significant|recently)[a-z]",
    ),
    ("max_concurrent_*", r"at_a_time"),
    ("action", r"(?<![a-z])deeds?(?![a-z])|Deed"),
    ("retry policy, backoff, retry_after_s", r"\b[Pp]atience\b|come[ _]again"),
    (
        "partition, descend, cull",
        r"\bhand(s|ed|ing)?[ _](it |them |triangles )?down\b|\bhand-down\b",
    ),
    ("producer, consumer, bounded queue", r"[Ss]lot_?[Rr]ing|make_and_take|\btaker\b|Taker\b"),
    ("sequencer", r"[Tt]urnstile"),
    ("build context, dependencies, interface", r"(?<![a-z])seams?(?![a-z])|Seams?\b"),
    (
        "free, release, punch a hole, return",
        r"\b(give|gives|given|giving|gave)[ _](\w+ )?back\b|give_back",
    ),
    ("wait, join", r"(?<![a-z])settle"),
    ("is_corruption", r"speaks?_of_damage|speaks? of damage"),
    ("report, rethrow, say", r"\btold\b|\btells? of\b"),
    ("check disk space, space required", r"check_room|room_needed|\bmake room\b"),
    ("folder", r"\brooms\b|check_rooms"),
    ("estimate, compute", r"[Rr]eckon"),
    (
        "duplicates, deduplicate",
        r"(drop|dropping|dropped|without|no|their) doubles\b|doubles (are )?dropped|DropDoubles",
    ),
    ("merge pass", r"[Mm]erge rounds?\b|\brounds? of (the )?merg|\bin rounds\b|merge_round"),
    ("truncated hash", r"cut_hash|\b[Uu]?n?cut hash|hash(es)? (are |is )?cut\b"),
    ("checksum", r"\bsummed\b|block_sums|(?<!check)sum_words"),
    ("estimate range", r"\bFigure\b"),
    (
        "access control, concurrency limiter, thread pool",
        r"\bcrew\b|ThreadCrew|class (Gate|Slots)\b",
    ),
    ("during, concurrently, next to, in the background", r"\b([Bb]eside|[Aa]mid|[Mm]eanwhile)\b"),
    ("again", r"\b[Aa]new\b"),
    (
        "per edge, per node, per second",
        rf"\b({UNITS}) an? ({EACH})\b|\b(once|twice) a (second|minute)\b",
    ),
    ("tone mapper, noise", r"\bFilm\b|\bfilm_|\bgrain\b"),
    ("oom_score_adj is raised", r"volunteer"),
    ("release", r"\blet(s|ting)? go\b|let_go"),
    ("American spelling: canceled", r"[Cc]ancell(ed|ing)"),
    (
        "American spelling: color, center, gray, neighbor, behavior",
        r"[Cc]olour|[Cc]entre|\b[Gg]rey|[Nn]eighbour|[Bb]ehaviour|[Hh]onour|[Ff]avour",
    ),
    (
        "American spelling: -ize, -yze",
        r"([Rr]aster|[Nn]ormal|[Oo]ptim|[Ii]nitial|[Ss]erial|[Rr]ecogn|[Oo]rgan|[Vv]oxel|[Ss]ynchron|[Ss]ummar|[Mm]inim|[Mm]axim)is(e|ed|es|er|ers|ing|ation)\b|[Aa]nalys(e|ed|es|ing)\b",
    ),
    (
        "American spelling: meter, labeled, modeled, traveled, toward",
        r"\b[Mm]etres?\b|\b([Ll]abell|[Mm]odell|[Tt]ravell)(ed|ing)(?!by)|\b[Tt]owards\b",
    ),
    ("a text that a reader can get", r"\bDESIGN\b|\bthe study\b|\bGLOSSARY\b"),
]
COMPILED = [(term, re.compile(pattern)) for term, pattern in RULES]

TEXT = re.compile(
    r"\.(h|cc|cu|cuh|cmake|py|sh|js|css|html|md|json|toml|txt)$|^(tools|\.ci)/|^Dockerfile$"
)
# Two scripts contain the forbidden words themselves, and the license is a fixed text.
LEFT_OUT = ("tools/source/check_words.py", "tools/source/check_prose.py", "LICENSE")


def main():
    listing = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True)
    counts = {term: 0 for term, _ in COMPILED}
    show = "--count" not in sys.argv[1:]
    for path in filter(TEXT.search, listing.stdout.split("\0")):
        if path in LEFT_OUT:
            continue
        with open(path, encoding="utf-8") as file:
            for number, line in enumerate(file, start=1):
                for term, pattern in COMPILED:
                    if match := pattern.search(line):
                        counts[term] += 1
                        if show:
                            print(f'{path}:{number}: "{match.group()}": say {term}')
    if not show:
        for term, count in counts.items():
            print(f"{count:5}  {term}")
        print(f"{sum(counts.values()):5}  in all")
    return 1 if any(counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
