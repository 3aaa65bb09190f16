"""Memory that the page keeps for evicted tiles."""

# A loader and a store without a picture, on a GPU that stores nothing. Most of the many tiles are
# evicted again. The service reports every 29th tile as damaged. Each tile has a root, two nodes and
# eight cut-off nodes with different tiles. Returns the number of retained objects after the first
# part of the tiles and at the end.
MANY_TILES = """async ([budgetBytes, maxFailures, first, all]) => {
  const {TileLoader} = await import("/viewer/tiles/tile_loader.js");
  const {TilePool} = await import("/viewer/tiles/tile_pool.js");
  const {TileStore} = await import("/viewer/tiles/tile_store.js");
  const {TileError} = await import("/viewer/tile_source.js");
  const info = {levels: 20, tile_levels: 3, batch_max: 64}, bad = 29;
  const gl = new Proxy({}, {
    get: (_, name) => name === "getParameter" ? () => 16384 :
        name === "getError"                   ? () => 0 :
        name === name.toUpperCase()           ? 0 :
                                                () => ({})
  });
  let next = 1;
  const tile = (level) => {
    const leaves = [];
    for (let i = 0; i < 8; ++i) leaves.push(next++, 0, 1, 0);
    return Uint32Array.of(
        0x31544456, level | 3 << 8, 13, 8, 1, 2, 1, 4, 255, 0, 1, 2, 3, 4, 5, 6, 7, ...leaves);
  };
  const source = {
    info,
    batchMax: 64,
    ended: null,
    damage: {code: "damaged", message: ""},
    timeoutMs: 1000,
    fetchTiles: async (nodes) => {
      if (nodes.some(({offset}) => offset % bad === 0))
        throw new TileError(500, "it is damaged", {code: "corrupt"});
      return nodes.map(({level}) => tile(level));
    }
  };
  // Counts everything reachable: the members of objects and maps, and the elements of arrays. 64
  // bytes of a typed array count as one.
  const count = (root) => {
    const seen = new Set([root]), todo = [root];
    let things = 0;
    const add = (value) => {
      ++things;
      if (typeof value !== "object" || value === null || seen.has(value)) return;
      seen.add(value);
      todo.push(value);
    };
    while (todo.length > 0) {
      const value = todo.pop();
      if (value === source || value === gl) continue;
      if (ArrayBuffer.isView(value)) things += value.buffer.byteLength / 64;
      else if (value instanceof Map)
        for (const [key, each] of value) {
          add(key);
          add(each);
        }
      else if (value instanceof Set || Array.isArray(value)) value.forEach(add);
      else
        for (const name of Object.keys(value)) add(value[name]);
    }
    return things;
  };

  const plainWarn = console.warn;
  console.warn = () => {};
  const store = new TileStore(new TilePool(gl, budgetBytes), info),
        loader = new TileLoader(source, store, () => {});
  loader.maxFailures = maxFailures;
  store.add(0, 0, tile(0), 0);
  store.setRoot(0, 0);
  let came = 0, random = 1;
  const look = () => ({
    came,
    evicted: store.evicted,
    tiles: store.tiles.size,
    things: count([store, loader]),
    failures: loader.failures.size,
    failed: loader.failedTotal
  });
  const looks = [], isDone = () => loader.isIdle && loader.loading.size === 0;
  for (let view = 1; came < all; ++view) {
    store.beginEpoch();
    loader.beginEpoch();
    // The demand of a view: some loaded tiles, and the tiles below them.
    for (let round = 0; round < 6; ++round) {
      const wanted = new Map(), level = view % 4 * 3;
      let parents =
          [...store.tiles.values()].filter((each) => each.level === level && each.addresses);
      if (parents.length === 0) parents = [store.root];
      for (let i = 0; i < 24; ++i) {
        random = (random * 48271) % 0x7fffffff;
        const parent = parents[random % parents.length];
        store.mark(parent.slot, store.epoch, performance.now());
        const node = store.leaf(parent, (random >> 12) % 8);
        wanted.set(node.texel, 1);
      }
      store.rounds = 4;  // the unneeded tiles are known
      const before = store.tiles.size + store.evicted;
      loader.demand(wanted, performance.now());
      while (!isDone()) await new Promise((resolve) => setTimeout(resolve));
      came += store.tiles.size + store.evicted - before;
    }
    if (looks.length === 0 && came >= first) looks.push(look());
  }
  looks.push(look());
  loader.dispose();
  console.warn = plainWarn;
  return looks;
}"""


BUDGET, MAX_FAILURES, FIRST, ALL = 1 << 18, 32, 3000, 12000


def check_many_tiles(visitor):
    """Retained memory does not depend on the number of evicted or damaged tiles."""
    first, last = visitor.page.evaluate(MANY_TILES, [BUDGET, MAX_FAILURES, FIRST, ALL])
    print(
        f"  {first['came']} tiles, then {last['came']}: "
        f"{first['evicted']} and {last['evicted']} have left, "
        f"{first['things']:.0f} and {last['things']:.0f} things stay"
    )
    assert last["evicted"] > ALL / 2 and last["failed"] > 4 * MAX_FAILURES, (
        f"the check sees nothing: {last}"
    )
    assert last["things"] < 1.2 * first["things"], (first, last)
    assert last["failures"] <= MAX_FAILURES, last
