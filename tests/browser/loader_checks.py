"""Answers that are damaged, refused, late or missing."""

BAD_PAGE = 77  # the number of the page that the services of TRIALS report as damaged

# Makes invalid input by changes to a valid tile, page, batch and manifest. All must be refused.
# Returns the changes that were accepted.
BAD_INPUT = """async () => {
  const {decodeTile, tileShape} = await import("/viewer/tiles/tile_format.js");
  const {decodePage} = await import("/viewer/colors/page_format.js");
  const {splitBatch, TileSource, TileError} = await import("/viewer/tile_source.js");
  const wrong = [];
  const refuses = (what, decode) => {
    try {
      decode();
    } catch {
      return;
    }
    wrong.push(`accepted: ${what}`);
  };
  const accepts = (what, decode) => {
    try {
      decode();
    } catch (error) {
      wrong.push(`refused: ${what}: ${error.message}`);
    }
  };
  const edited = (words, at, value) =>
      Uint32Array.from(words, (word, i) => i === at ? value : word);
  const cut = (words, length) => Uint32Array.from({length}, (_, i) => words[i] ?? 0);

  // A root, two nodes, two nodes, two leaves. Without `bricks` these are cut off.
  const head = 4, nodes = [3, 3, 5, 1, 7, 1, 9, 1, 0, 1, 1], leaves = head + nodes.length;
  const tileOf = (shape, nodes, leaves) =>
      Uint32Array.of(0x31544456, shape, nodes.length, 2, ...nodes, ...leaves);
  const cutOff = tileOf(3 << 8, nodes, [12, 255, 1, 0, 3, 0, 0, 1]),
        bricks = tileOf(3 << 8 | 1 << 16, nodes, [1, 0, 0, 1]);
  const grid = {levels: 11, tile_levels: 3}, flat = {levels: 5, tile_levels: 3};
  const decode = (words, info = grid, level = 0) =>
      decodeTile(words, level, tileShape(info, level));
  accepts("a tile", () => decode(cutOff));
  accepts("a tile with bricks", () => decode(bricks, flat));
  for (const [what, at, value] of [
           ["magic", 0, 0x31544457],
           ["level", 1, 3 << 8 | 1],
           ["no levels", 1, 0],
           ["fewer levels", 1, 2 << 8],
           ["200 levels", 1, 200 << 8],
           ["bricks above them", 1, 3 << 8 | 1 << 16],
           ["reserved bits", 1, 3 << 8 | 1 << 17],
           ["no words of nodes", 2, 0],
           ["more words of nodes", 2, 15],
           ["huge words of nodes", 2, 0xffffffff],
           ["fewer leaves", 3, 1],
           ["more leaves", 3, 0x40000000],
           ["no mask", head, 0],
           ["a mask of 9 bits", head, 256 | 3],
           ["a mask beyond the nodes", head + 9, 255],
           ["a child before its parent", head + 4, 3],
           ["a child within a node", head + 1, 4],
           ["a child beyond the nodes", head + 2, 11],
           ["a node that none names", head + 2, 3],
           ["a leaf beyond the leaves", head + 10, 2],
           ["an offset of 2^40", leaves + 1, 256],
           ["an offset of 2^63", leaves + 1, 2 ** 31],
           ["an empty coarse brick", leaves + 2, 0],
  ])
    refuses(`a tile: ${what}`, () => decode(edited(cutOff, at, value)));
  refuses("a tile with an empty brick", () => decode(edited(bricks, leaves, 0), flat));
  refuses(
      "a tile of another depth of the file", () => decode(cutOff, {levels: 12, tile_levels: 3}));
  refuses("a tile cut off where bricks are", () => decode(cutOff, flat));
  for (const length of [0, 1, head, head + 5, cutOff.length - 1, cutOff.length + 1])
    refuses(`a tile of ${length} words`, () => decode(cut(cutOff, length)));
  // The root names a node that another one names, which would be on two levels.
  refuses(
      "a tile with a node on two levels",
      () =>
          decode(tileOf(3 << 8, [7, 4, 6, 8, 1, 8, 1, 10, 1, 0, 1, 1], [12, 0, 1, 0, 3, 0, 0, 1])));

  const mask = [5, ...new Array(15).fill(0)];
  const single = Uint32Array.of(2 | 1 << 24, ...mask, 1, 2),
        blocks = Uint32Array.of(2 | 30 << 16, ...mask, 1, 2, 3, 4);
  accepts("a page of single colors", () => decodePage(single));
  accepts("a page of blocks", () => decodePage(blocks));
  accepts("a page without cells", () => decodePage(Uint32Array.of(0)));
  for (const [what, at, value] of [
           ["no cells", 0, 1 << 24],
           ["other cells", 0, 3 | 1 << 24],
           ["513 cells", 0, 513 | 1 << 24],
           ["a reserved bit", 0, 2 | 3 << 24],
           ["a skip", 0, 2 | 1 << 16 | 1 << 24],
           ["blocks", 0, 2],
           ["another mask", 3, 1],
  ])
    refuses(`a page: ${what}`, () => decodePage(edited(single, at, value)));
  refuses("a page: a second block", () => decodePage(edited(blocks, 0, 2 | 31 << 16)));
  for (const page of [single, blocks])
    for (const length of [0, 1, 17, page.length - 1, page.length + 1])
      refuses(`a page of ${length} words`, () => decodePage(cut(page, length)));

  const batch = Uint32Array.of(8, 1, 2, 4, 3);
  accepts("a batch", () => splitBatch(batch.buffer, 2));
  for (const [what, words] of [
           ["no second tile", [8, 1, 2]], ["a cut tile", [8, 1, 2, 8, 3]],
           ["bytes after it", [8, 1, 2, 4, 3, 0]], ["a length of 6", [6, 1, 2, 4, 3]],
           ["a huge length", [0xfffffffc, 1, 2, 4, 3]], ["nothing", []]])
    refuses(`a batch: ${what}`, () => splitBatch(Uint32Array.from(words).buffer, 2));
  refuses("a batch that ends within a word", () => splitBatch(batch.buffer.slice(0, 18), 2));

  const manifest = {
    digest: "d",
    resolution: 2048,
    levels: 11,
    tile_levels: 3,
    batch_max: 64,
    voxels: "7",
    root: {level: 0, offset: 0},
    colors: {levels: 11, batch_max: 256}
  };
  const itsFetch = window.fetch;
  const take = async (text) => {
    window.fetch = async () => new Response(text);
    try {
      return await new TileSource({base: ""}).manifest() && null;
    } catch (error) {
      return error instanceof TileError ? "refused" : String(error);
    } finally {
      window.fetch = itsFetch;
    }
  };
  if (await take(JSON.stringify(manifest))) wrong.push("refused: a manifest");
  if (await take(JSON.stringify({...manifest, voxels: undefined, colors: undefined})))
    wrong.push("refused: a running job's manifest");
  for (const edit
           of [{levels: 21},
               {levels: "11"},
               {tile_levels: 0},
               {tile_levels: 200},
               {tile_levels: null},
               {resolution: 4096},
               {batch_max: 0},
               {digest: ""},
               {digest: 7},
               {voxels: "many"},
               {voxels: undefined},
               {root: {level: 1, offset: 0}},
               {root: {level: 0, offset: 2 ** 40}},
               {levels: 2, resolution: 4},
               {levels: 2, resolution: 4, root_brick: [1, 2 ** 32]},
               {colors: {levels: 12, batch_max: 256}},
               {colors: {levels: 11, batch_max: 0.5}},
  ])
    if (await take(JSON.stringify({...manifest, ...edit})) !== "refused")
      wrong.push(`accepted: a manifest with ${JSON.stringify(edit)}`);
  for (const text of ["", "null", "[]", "<html>"])
    if (await take(text) !== "refused") wrong.push(`accepted: the manifest ${text}`);
  return wrong;
}"""


def check_bad_input(visitor):
    """Invalid tiles, pages, batches and manifests are refused; valid ones are accepted."""
    wrong = visitor.page.evaluate(BAD_INPUT)
    assert not wrong, wrong


# Runs several loaders of color pages concurrently, each with a separate simulated service and
# without a picture. Each page consists of one word, its number.
TRIALS = """async (bad) => {
  const {TileSource} = await import("/viewer/tile_source.js");
  const {ColorLoader} = await import("/viewer/colors/color_loader.js");
  const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const services = new Map(), plainFetch = window.fetch;
  window.fetch = (url, options) => {
    const service = services.get(url.split("/")[1]);
    return service ? service(new URL(url, location), options) : plainFetch(url, options);
  };
  const bytesOf = (pages) =>
      new Uint8Array(Uint32Array.from(pages.flatMap((page) => [4, page])).buffer);
  const all = (pages) => new Response(bytesOf(pages));
  const problem = (status, code, headers = {}) =>
      new Response(JSON.stringify({code, detail: `it is ${code}`}), {status, headers});
  const here = () => new Response('{"digest": "d"}'), gone = () => problem(404, "not_found");
  const silence = (signal) => new Promise(
      (_, reject) => signal.addEventListener("abort", () => reject(new Error("aborted"))));
  const unless = (isBad, answer) => (pages) => isBad(pages) ? answer(pages) : all(pages);
  const hasBad = (pages) => pages.includes(bad);

  // `answer(pages, asked, signal)` is the service; the check waits at most `ms` for the end.
  const run = async (name, {answer, manifest = here, count = 300, ms = 20000}) => {
    const asked = [], base = name.replaceAll(" ", "-"), signals = [], beginMs = performance.now();
    services.set(base, async (url, options) => {
      const pages =
          url.searchParams.get("pages")?.split(",").map((page) => Number(page.split(".")[1]));
      asked.push({ms: performance.now() - beginMs, pages: pages ?? [], cache: options.cache});
      signals.push(options.signal);
      return pages ? answer(pages, asked, options.signal) : manifest();
    });
    const source = new TileSource({base: `/${base}`}), pages = new Map(), said = new Set();
    source.info = {digest: "d", colors: {batch_max: 256}};
    source.timeoutMs = 400;
    const add = ({key}, words) => {
      if (words.length !== 1 || words[0] !== key) throw new Error("another page");
      return Boolean(pages.set(key, true));
    };
    const loader = new ColorLoader(source, {pages, rounds: 0, add}, () => {}), wanted = new Map();
    for (let key = 0; key < count; ++key)
      wanted.set(key, {key, level: 9, position: [key, 0, 0], priority: 1});
    let isOver = false;
    for (const endMs = beginMs + ms; !isOver && performance.now() < endMs; await sleep(30)) {
      loader.demand(wanted, performance.now());
      if (loader.problem) said.add(loader.problem.code);
      isOver = loader.isIdle && !loader.awaitsRetry;
    }
    const before = asked.length;
    loader.demand(wanted, performance.now());
    loader.dispose();
    return {
      isOver,
      ms: performance.now() - beginMs,
      pages: pages.size,
      lacks: count - pages.size,
      requests: asked.length,
      after: asked.length - before,
      alone: asked.filter((each) => each.pages.length === 1 && each.pages[0] === bad)
                 .map((each) => each.cache ?? "default"),
      manifests: asked.filter((each) => each.pages.length === 0).length,
      times: asked.map((each) => each.ms),
      said: [...said],
      problem: loader.problem?.code ?? null,
      aborted: signals.filter((signal) => signal.aborted).length
    };
  };

  const trials = {
    "corrupt page": {answer: unless(hasBad, () => problem(500, "corrupt"))},
    "failing page": {answer: unless(hasBad, () => problem(500, "internal")), count: 100},
    "missing page": {answer: unless(hasBad, gone)},
    "malformed page": {
      answer: (pages) => new Response(
          bytesOf(pages).map((byte, i) => pages[i >> 3] === bad && (i & 7) > 3 ? 99 : byte))
    },
    "malformed batch": {
      answer: (pages) => new Response(hasBad(pages) ? bytesOf(pages).slice(4) : bytesOf(pages)),
      count: 100
    },
    "removed file": {answer: gone, manifest: gone},
    "file of another digest": {answer: gone, manifest: () => new Response('{"digest": "e"}')},
    "replaced file": {answer: () => problem(410, "gone")},
    "busy service": {
      answer: (pages, asked) =>
          asked.length <= 2 ? problem(503, "busy", {"Retry-After": "1"}) : all(pages)
    },
    "service that is away": {
      answer: (pages, asked) => {
        if (asked.at(-1).ms < 2500) throw new TypeError("refused");
        return all(pages);
      }
    },
    "slow link": {
      answer: (pages, asked, signal) => {
        const bytes = bytesOf(pages);
        let at = 0;
        return new Response(new ReadableStream({
          async pull(stream) {
            await Promise.race([sleep(100), silence(signal)]);
            stream.enqueue(bytes.slice(at, at += 64));
            if (at >= bytes.length) stream.close();
          }
        }));
      }
    },
    "slow service": {
      answer: (pages, asked, signal) =>
          Promise.race([sleep(10 * pages.length).then(() => all(pages)), silence(signal)])
    },
    "no answer at all": {answer: (pages, asked, signal) => silence(signal), ms: 150},
  };
  const results = await Promise.all(
      Object.entries(trials).map(async ([name, trial]) => [name, await run(name, trial)]));
  window.fetch = plainFetch;
  return Object.fromEntries(results);
}"""

# Requests three wake-ups from a loader, after 50, 400 and 200 ms. Returns the times at which the
# loader wakes the renderer: at the earliest and at the latest of the three.
WAKES = """async () => {
  const {ColorLoader} = await import("/viewer/colors/color_loader.js");
  const beginMs = performance.now(), wakes = [];
  const source = {info: {colors: {batch_max: 1}}, ended: null},
        store = {pages: new Map(), rounds: 0};
  const loader = new ColorLoader(source, store, () => wakes.push(performance.now() - beginMs));
  for (const afterMs of [50, 400, 200]) loader.wakeAt(beginMs + afterMs, beginMs);
  await new Promise((resolve) => setTimeout(resolve, 900));
  loader.dispose();
  return wakes;
}"""


def check_trials(visitor):
    """Halving isolates a bad page, all others arrive, and a busy service gets few requests."""
    page = visitor.page
    page.evaluate(
        "window.itsWarn = console.warn, window.warnings = [],"
        " console.warn = (text) => warnings.push(String(text))"
    )
    trials = page.evaluate(TRIALS, BAD_PAGE)
    for name, trial in trials.items():
        print(
            f"  {name}: {trial['pages']} pages, {trial['requests']} requests, "
            f"{trial['ms']:.0f} ms, "
            f"said {trial['said']}"
        )
    for name, problem, tries in (
        ("corrupt page", "damaged", 1),
        ("missing page", "damaged", 1),
        ("failing page", "refused", 3),
        ("malformed page", "damaged", 2),
        ("malformed batch", "damaged", 3),
    ):
        trial = trials[name]
        assert trial["isOver"] and trial["lacks"] == 1 and trial["problem"] == problem, (
            name,
            trial,
        )
        assert len(trial["alone"]) == tries and trial["after"] == 0 and trial["requests"] <= 30, (
            name,
            trial,
        )
        assert set(trial["alone"]) == {"reload"}, (name, trial)
    assert trials["missing page"]["manifests"] == 1, trials["missing page"]
    for name, problem in (
        ("removed file", "removed"),
        ("file of another digest", "replaced"),
        ("replaced file", "replaced"),
    ):
        trial = trials[name]
        assert trial["isOver"] and trial["problem"] == problem and trial["said"] == [problem], (
            name,
            trial,
        )
        assert trial["requests"] <= 4 and trial["after"] == 0, (name, trial)
    busy = trials["busy service"]
    assert busy["lacks"] == 0 and busy["said"] == [], busy
    assert busy["times"][2] >= busy["times"][0] + 1000 and busy["requests"] <= 8, busy
    away = trials["service that is away"]
    assert away["lacks"] == 0 and away["said"] == ["unreachable"] and away["problem"] is None, away
    assert sum(time < 2500 for time in away["times"]) <= 10, away
    slow = trials["slow link"]
    assert slow["lacks"] == 0 and slow["said"] == [], slow
    slow = trials["slow service"]
    assert slow["lacks"] == 0 and slow["problem"] is None, slow
    left = trials["no answer at all"]
    assert left["aborted"] == left["requests"] > 0, left
    names = [
        warning
        for warning in page.evaluate("warnings")
        if f"color page 9/{BAD_PAGE}/0/0" in warning
    ]
    assert len(names) >= 5, page.evaluate("warnings")
    page.evaluate("console.warn = itsWarn")
    wakes = page.evaluate(WAKES)
    assert len(wakes) == 3 and all(
        -1 <= wake - due < 150 for wake, due in zip(wakes, (50, 200, 400))
    ), wakes
