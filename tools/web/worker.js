// Reads files, chooses nodes and builds tiles outside the page's thread.
// The page sends 'module', 'first', 'open', 'close', 'end', 'view', 'probe', 'positions', 'reach', 'hit' and 'section'. It receives 'opened', 'located', 'tiles', 'loaded',
// 'probed', 'positions', 'section', 'idle' and 'failed'. Several files may be open: the member `file` of each message, 0 by default, names the file.
import { Queries, positionsOf, sectionOf } from './queries.js';
import { reachOf } from './reach.js';
import { Cut } from './cut.js';
import { fetchAfter, takeFirst } from './first_response.js';
import { addLevels, growForView } from './grow.js';
import { HEAD_BYTES, openModel } from './model_file.js';
import { viewModule } from './ebpo/view.js'; // workers have no import maps
import { UrlSource, sourceOf } from './source.js';
import { CAPS, KEY, Surface, capsTile } from './surface.js';
import { Tree } from './tree.js';

const LINE_MS = 250;                      // interval between reports of progress to the page
const TIMEOUT_MS = 20000;                 // longest time without a byte
const FIRST_LEVELS = 5;                   // normally contained in the response to the first request
const LARGE_FILE = 2 * 1024 * 1024;       // the first response of larger files is ended early: if their surface is drawn, most of it would be unused envelopes
const SMALL_FILE = 8 * 1024 * 1024;       // files of fewer bytes are small
const MESH_BYTES_A_VIEW = 16 * 1024 * 1024; // for larger meshes: limit of fetched bytes until the camera moves
const SUBTREE_BYTES_A_VIEW = 1.5 * 1024 * 1024; // the same limit for files with subtrees, where few fetched bytes are unused

// The open files by their member `file`: { number, current (an OpenFile), view, want, sections, silent }.
const slots = new Map();
const slotOf = (number = 0) => slots.get(number) ?? slots.set(number, { number, sections: 0, silent: true }).get(number);
let module, moduleCame; // a promise of the compiled module for drawing, which the page loads; undefined: model_file.js loads it

const post = (slot, message, transfer = []) => self.postMessage({ file: slot.number, ...message }, transfer);

const describe = (error) => ({ code: error.code ?? 'FAULT', message: error.message ?? String(error) });

class OpenFile {
  constructor(slot, number) {
    this.slot = slot;
    this.number = number;
    this.began = performance.now();
    this.timeline = []; // { level, ms, bytes, requests }
    this.busy = { level: undefined, nodes: false, mesh: false };
    this.running = this.again = false;
    this.probes = 0;
    this.rooted = new Promise((done) => (this.root = done)); // resolves when queries can be evaluated
  }

  close() {
    this.source?.close?.();
    this.queries?.close();
    this.file?.close();
  }

  get ended() {
    return this.slot.current !== this;
  }

  async open(what, ahead, cacheBytes) {
    const enoughOf = (size) => (size > LARGE_FILE ? HEAD_BYTES : Infinity);
    const fetch = fetchAfter(() => post(this.slot, { type: 'forget' }));
    this.source = typeof what === 'string' ? new UrlSource(what, { ahead, enoughOf, timeout: TIMEOUT_MS, patient: true, fetch }) : sourceOf(what);
    this.file = await openModel(this.source, { ...(module && { module }), ...(cacheBytes && { cacheBytes }) });
    const { info, source } = this.file;
    if (!this.#drawsSurface())
      source.extend?.(ahead);
    this.tree = new Tree(info);
    this.queries = new Queries(this.file);
    this.cut = new Cut(this.tree, { small: source.size < SMALL_FILE });
    post(this.slot, { type: 'opened', opening: this.number, name: source.name, size: source.size, info, scene: this.cut.scene, coloured: this.file.coloured || info.parts.has('colours'),
      bytesTo: this.file.levelBytes, traffic: this.file.traffic, ms: performance.now() - this.began });
    this.file.sums?.catch((error) => this.ended || post(this.slot, { type: 'failed', opening: this.number, error: describe(error), late: true }));
    await this.load(Math.min(FIRST_LEVELS, info.level_count) - 1);
    this.root();
    await this.file.locate();
    if (!this.ended)
      post(this.slot, { type: 'located', opening: this.number, bytesTo: this.file.levelBytes, traffic: this.file.traffic });
  }

  /** Loads levels up to `last` into the tree. Concurrent calls for the same level share the work. */
  async load(last) {
    while (this.tree.depth < last) {
      this.busy.level ??= this.#loadNext(last).finally(() => (this.busy.level = undefined));
      await this.busy.level;
    }
  }

  async #loadNext(last) {
    await addLevels(this.file, this.tree, Array.from({ length: last - this.tree.depth }, (_, i) => this.tree.depth + 1 + i));
    if (!this.ended)
      this.#loaded();
  }

  #loaded() {
    for (let level = this.timeline.length; level <= this.tree.depth; level++)
      this.timeline.push({ level, ms: performance.now() - this.began, ...this.file.traffic });
    post(this.slot, { type: 'loaded', opening: this.number, depth: this.tree.depth, timeline: this.timeline, traffic: this.file.traffic });
  }

  async pump() {
    if (this.running) {
      this.again = true;
      return;
    }
    this.running = true;
    try {
      do
        await this.#refine();
      while (this.again && !this.ended); // pump() was called between the end of #refine() and here
    } finally {
      this.running = false; // also after an error, so that the next view tries again
    }
  }

  // Draws or removes the caps of a surface with holes.
  #showCaps() {
    const wanted = Boolean(this.slot.want?.caps) && this.file.info.parts.has('border') && !this.file.info.parts.has('pruned');
    if (wanted === Boolean(this.caps))
      return;
    const caps = this.caps = wanted ? { loading: true } : undefined, isOld = () => this.ended || this.caps !== caps;
    if (!wanted) {
      this.#send({ set: [], removed: [CAPS], stats: this.stats });
      return;
    }
    this.#later(this.file.caps(this.cut.scene).then((mesh) => {
      caps.loading = false;
      if (!isOld())
        this.#send({ set: [capsTile(mesh)], removed: [], stats: this.stats });
    }, (error) => {
      if (isOld())
        return;
      caps.loading = false;
      if (error.code === 'NETWORK')
        this.caps = undefined; // the next view tries again
      throw error;
    }));
  }

  async #refine() {
    let result;
    do {
      this.again = false;
      this.#showCaps();
      if (this.#drawsSurface()) {
        result = await this.#refineSurface();
        continue;
      }
      this.#dropSurface();
      result = this.cut.update(this.slot.view, this.slot.want);
      this.#send(result);
      if (result.deeper && !this.busy.nodes && !this.busy.level)
        this.#later(this.#loadNodes(result.missing));
      if (result.leaves.length && !this.busy.mesh && !result.more && !result.deeper && this.#meshAllowed())
        this.#later(this.#loadMesh(result.leaves));
      await new Promise((done) => setTimeout(done)); // handles a newer view first
    } while (!this.ended && (this.again || result.more));
    if (!this.ended && !this.busy.level && !this.busy.nodes && !this.busy.mesh && !this.caps?.loading)
      post(this.slot, { type: 'idle', opening: this.number, want: this.slot.want.number, traffic: this.file.traffic, deeper: result.deeper });
  }

  #drawsSurface() {
    return Boolean(this.slot.want?.surface) && this.file.info.parts.has('surface');
  }

  // Draws the simplified surface instead of envelopes. Returns { more } as Cut.update() does.
  async #refineSurface() {
    const { view, want } = this.slot;
    if (this.drawn === undefined && !this.cut.tiles.size && this.file.info.parts.has('planes')) // the first picture: envelopes that have already come
      this.#send(this.cut.update(view, { ...want, level: this.tree.depth, mesh: false }));
    this.busy.mesh = true; // what the page reports while it waits
    try {
      this.surface ??= new Surface(this.file.info, this.cut.scene, await this.file.patches(), this.cut.small);
      const next = this.surface.next(view, want), name = `${next.name} ${want.lines}`;
      if (name !== this.drawn) {
        const mesh = await this.file.surface(next.chosen, this.cut.scene), tile = this.surface.tileOf(mesh, want.lines);
        if (this.ended)
          return { more: false };
        this.surface.read(next);
        this.drawn = name;
        const stats = { nodes: next.chosen.length, triangles: tile.triangles, meshTriangles: tile.meshTriangles, cellFaceTriangles: 0, tiles: 1, levels: [] };
        this.#send({ set: [tile], removed: this.cut.clear(), stats: { ...stats, surface: { pixels: next.pixels, error: next.error } } });
      }
      return { more: !next.last };
    } finally {
      this.busy.mesh = false;
    }
  }

  // Removes the surface's tile, if it is drawn, before envelopes are drawn.
  #dropSurface() {
    if (this.drawn === undefined)
      return;
    this.drawn = undefined;
    this.leaving = true;
  }

  #meshAllowed() {
    const { want } = this.slot;
    if (this.viewNumber !== want.number) {
      this.viewNumber = want.number;
      this.meshBytes = 0;
    }
    return this.cut.small || want.pixels === 0 || this.meshBytes < (this.tree.info.subtree_level === undefined ? MESH_BYTES_A_VIEW : SUBTREE_BYTES_A_VIEW);
  }

  #later(work) {
    work.then(() => this.ended || this.pump()).catch((error) => this.ended || post(this.slot, { type: 'failed', opening: this.number, error: describe(error), late: true }));
  }

  async #loadNodes(missing) {
    this.busy.nodes = true;
    try {
      const { depth } = this.tree;
      await growForView(this.file, this.tree, missing);
      if (!this.ended && this.tree.depth > depth)
        this.#loaded();
    } finally {
      this.busy.nodes = false;
    }
  }

  async #loadMesh(leaves) {
    this.busy.mesh = true;
    const before = this.file.traffic.bytes;
    try {
      const lists = await this.file.leafFaces(leaves);
      leaves.forEach((leaf, i) => this.cut.addMesh(leaf, lists[i]));
    } finally {
      this.busy.mesh = false;
      this.meshBytes += this.file.traffic.bytes - before;
    }
  }

  #send({ set, removed, stats }) {
    if (this.leaving) // the surface's tile goes with the first envelopes
      removed = [...removed, KEY];
    this.leaving = false;
    this.stats = stats;
    const transfer = set.flatMap((t) => [t.position.buffer, t.tag.buffer, t.normal.buffer, t.hue?.buffer, t.index.buffer, t.lines?.buffer, t.cells?.buffer]).filter(Boolean);
    post(this.slot, { type: 'tiles', opening: this.number, set, removed, stats, traffic: this.file.traffic, ms: performance.now() - this.began, want: this.slot.want.number }, transfer);
  }

  /**
   * Queries a point: first by the loaded levels, then exactly. `ray`: origin and direction of a click, whose first point on the faces replaces `point`.
   */
  async probe(point, ray) {
    const number = ++this.probes, { tree, file, queries } = this, { solid, parts } = file.info, mesh = parts.has('mesh');
    const reply = (more) => this.ended || number !== this.probes || post(this.slot, { type: 'probed', opening: this.number, point, solid, traffic: file.traffic, ...more });
    if (ray && mesh)
      point = await queries.hit(ray) ?? point;
    const coarse = { depth: tree.depth, ...await queries.coarse(point, tree.depth), point };
    reply({ ...coarse, exact: false, done: !mesh });
    if (!mesh)
      return;
    try {
      reply({ ...coarse, ...await queries.exact(point), exact: true, done: true });
    } catch (error) {
      if (error.code !== 'ABSENT') // the file is a subset without data here
        throw error;
      reply({ ...coarse, exact: false, done: true });
    }
  }
}

const RESULTS = { positions: positionsOf, reach: reachOf, hit: async (queries, [ray]) => [await queries.hit(ray)] };

// Evaluates longer queries one after the other. A newer section query cancels an older one.
async function runQuery(data, slot, mine) {
  if (data.type === 'section') {
    const number = ++slot.sections, over = () => mine.ended || number !== slot.sections;
    const emit = (news) => over() || post(slot, { type: 'section', opening: mine.number, axis: data.axis, at: data.at, traffic: mine.file.traffic, ...news });
    await sectionOf(mine.queries, data.axis, data.at, emit, over);
    return;
  }
  const emit = (news) => mine.ended || post(slot, { type: 'positions', opening: mine.number, id: data.id, ...news });
  try {
    emit({ positions: await RESULTS[data.type](mine.queries, data.points) });
  } catch (error) {
    emit({ error: describe(error) });
  }
}

// Reports progress to the page, and reports once when all requests have ended.
function reportProgress(slot) {
  const { current } = slot, underway = current?.source?.underway?.() ?? [];
  if (!underway.length && slot.silent)
    return;
  slot.silent = !underway.length;
  const sum = (of) => underway.reduce((total, t) => total + of(t), 0), { busy, source } = current ?? {};
  const what = !current?.tree?.root ? 'the first levels' : busy.mesh && !busy.nodes ? 'faces' : 'finer levels';
  post(slot, { type: 'line', opening: current?.number, got: sum((t) => t.got), want: sum((t) => t.to - t.from), quiet: underway.length ? Math.min(...underway.map((t) => t.quiet)) : 0,
    what, trouble: source?.trouble?.message });
}
setInterval(() => slots.forEach(reportProgress), LINE_MS);
const retry = ({ current }) => current?.source?.retry?.();
self.addEventListener('online', () => slots.forEach(retry));

function end(slot) {
  slot.current?.close();
  slot.current = undefined;
}

async function handle(data, slot) {
  const { current } = slot, ready = current?.tree?.root;
  if (data.type === 'module') {
    if (data.loaded)
      moduleCame(data.module ?? viewModule());
    else
      module = new Promise((done) => (moduleCame = done));
  } else if (data.type === 'first') {
    takeFirst(data);
  } else if (data.type === 'open') {
    end(slot);
    const mine = slot.current = new OpenFile(slot, data.opening);
    await mine.open(data.what, data.ahead, data.cacheBytes);
    if (!mine.ended && slot.view)
      await mine.pump();
  } else if (data.type === 'retry') {
    retry(slot);
  } else if (data.type === 'close') {
    end(slot);
  } else if (data.type === 'end') { // no more messages will follow
    end(slot);
    slots.delete(slot.number);
  } else if (data.type === 'view') {
    Object.assign(slot, { view: data.view, want: data.want });
    if (ready)
      await current.pump();
  } else if (['probe', 'positions', 'reach', 'hit', 'section'].includes(data.type) && data.opening === current?.number) {
    await current.rooted; // queries may arrive before the first levels are loaded
    if (current.ended)
      return;
    await (data.type === 'probe' ? current.probe(data.point, data.ray) : runQuery(data, slot, current));
  }
}

self.onmessage = async ({ data }) => {
  const slot = slotOf(data.file);
  try {
    await handle(data, slot);
  } catch (error) {
    post(slot, { type: 'failed', opening: data.opening ?? slot.current?.number, error: describe(error) });
  }
};
