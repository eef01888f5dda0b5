// What to draw: a cut through the tree that fits the camera, as a few hundred pieces of geometry ("tiles") of which only the changed ones are made
// again. No DOM and no WebGL here: runs in the worker, and under node in the tests.
//
// Coordinates of the scene: the model's box is centred on the origin and scaled so that half its diagonal is 1. Done in doubles, then rounded.
import { BLACK, GRAY, LEAF, WHITE } from './reader/index.js';

const TILE_NODES = 300;        // a tile's most: fewer tiles are fewer draw calls, smaller ones are made again faster
const NODES_A_PASS = 2400;     // newly made in one pass, so that a picture comes early and improves; the first passes make fewer yet
const POLYTOPES_KEPT = 40000;  // of about 1.3 KB, besides those of the cut itself
const PRUNE_PASSES = 64;
const MESH_LEAVES = 1000;      // whose faces are asked for at once, about
const MESH_SUBTREES = 24;      // the same where the file has subtrees
const FACE_PIXELS = 10;        // of the picture for each face of a subtree, from which on its faces are fetched, at a detail of 16 pixels
const NODES_MISSING = 1 << 14; // told of in one pass
const LEAF_SHARE = 4;          // in small files leaves' faces are taken even when so many times smaller than a gray node may be
const GROUP_LEVELS = 3;        // leaves below one node so many levels above have neighbouring faces in the file
const GROUP_LEAVES = 12;       // fewer wanted ones are not worth their chunks, unless they are large
const LARGE_LEAF = 6;
const REAL_FACE = 4;           // in a vertex's tag, beside the node's type: [level, type, normal, normal]

/** How the scene's coordinates come from the model's: scene = (model - center) * scale. */
export function sceneOf(info) {
  const center = info.box_origin.map((o, k) => o + info.box_size[k] / 2);
  return { center, scale: 2 / Math.hypot(...info.box_size) };
}

// Largest first.
class Heap {
  constructor() {
    this.items = [];
  }

  push(item) {
    const a = this.items;
    let i = a.push(item) - 1;
    for (let up; i > 0 && a[up = (i - 1) >> 1].px < item.px; i = up)
      a[i] = a[up];
    a[i] = item;
  }

  pop() {
    const a = this.items, top = a[0], last = a.pop();
    if (a.length) {
      let i = 0;
      for (let c; (c = 2 * i + 1) < a.length; i = c) {
        if (c + 1 < a.length && a[c + 1].px > a[c].px)
          c++;
        if (a[c].px <= last.px)
          break;
        a[i] = a[c];
      }
      a[i] = last;
    }
    return top;
  }
}

export class Cut {
  /** `small`: fetching all of the mesh would not matter. */
  constructor(tree, { small = true } = {}) {
    this.tree = tree;
    this.small = small;
    this.scene = sceneOf(tree.info);
    this.tiles = new Map(); // key: { signature, nodes, triangles, meshTriangles }
    this.pass = 0;
    this.size = 0; // nodes of the last cut
    this.ids = 0;
    this.made = 0; // polytopes kept with their nodes, about
    this.half = Array.from({ length: 21 }, (_, l) => tree.info.box_size.map((s) => s / 2 ** l / 2 * this.scene.scale));
    this.low = tree.info.box_size.map((s) => -s / 2 * this.scene.scale);
  }

  // Projected size of the node's cell in pixels; what is out of sight counts a tenth, and `unseen` says that it was.
  #pixels(node, view) {
    this.unseen = false;
    const h = this.half[node.level];
    let near = 0, c, d;
    const center = this.center ??= [0, 0, 0];
    for (let k = 0; k < 3; k++) {
      c = center[k] = this.low[k] + (2 * node.at[k] + 1) * h[k];
      d = Math.max(Math.abs(c - view.eye[k]) - h[k], 0);
      near += d * d;
    }
    const diagonal = 2 * Math.hypot(h[0], h[1], h[2]);
    let px = diagonal / Math.max(Math.sqrt(near), diagonal * 0.05) * view.pixels;
    for (const [x, y, z, w] of view.planes)
      if (x * center[0] + y * center[1] + z * center[2] + w < -(Math.abs(x) * h[0] + Math.abs(y) * h[1] + Math.abs(z) * h[2])) {
        px *= 0.1;
        this.unseen = true;
        break;
      }
    return px;
  }

  /**
   * One pass. `view`: { eye, planes, pixels } in scene coordinates, `pixels` those of a length 1 at distance 1. `want`: { level (deepest), mesh
   * (real faces in leaves), pixels (cells are refined until they are smaller), triangles (at most about), black (draw black nodes), lines, cells }.
   * Returns { set: [tile], removed: [key], more, deeper, missing, leaves, stats }: `more`: another pass would refine further; `deeper`: nodes are
   * missing: those below `missing`, [{ node, levels }], most important first, so many levels of them; `leaves`: leaves whose faces are missing, likewise.
   */
  update(view, want) {
    const chosen = this.#choose(view, want), tiles = new Map();
    for (const node of chosen.nodes) // how many are below each node
      for (let n = node; n; n = n.parent) {
        n.below = n.counted === this.pass ? n.below + 1 : 1;
        n.counted = this.pass;
      }
    for (const node of chosen.nodes) {
      let root = node;
      while (root.parent && root.parent.below <= TILE_NODES)
        root = root.parent;
      const tile = tiles.get(root);
      if (tile)
        tile.push(node);
      else
        tiles.set(root, [node]);
    }
    const flags = (want.lines ? 1 : 0) + (want.cells ? 2 : 0), set = [], removed = [];
    for (const [root, nodes] of tiles) {
      const key = root.id ??= ++this.ids;
      nodes.sort((a, b) => a.id - b.id);
      let signature = nodes.length * 4 + flags;
      for (const n of nodes)
        signature = (Math.imul(signature, 16777619) ^ (2 * n.id + (n.useMesh ? 1 : 0))) | 0;
      if (this.tiles.get(key)?.signature === signature)
        continue;
      const tile = this.#build(key, nodes, want);
      set.push(tile);
      this.tiles.set(key, { signature, nodes: nodes.length, triangles: tile.triangles, meshTriangles: tile.meshTriangles, wallTriangles: tile.wallTriangles });
    }
    const now = new Set([...tiles.keys()].map((root) => root.id));
    for (const key of this.tiles.keys())
      if (!now.has(key)) {
        removed.push(key);
        this.tiles.delete(key);
      }
    this.size = chosen.nodes.length;
    this.#tidy();
    return { set, removed, more: chosen.more, deeper: chosen.missing.length > 0, missing: chosen.missing, leaves: chosen.leaves, stats: { ...this.#stats(), levels: chosen.levels } };
  }

  #stats() {
    const s = { nodes: 0, triangles: 0, meshTriangles: 0, wallTriangles: 0, tiles: this.tiles.size };
    for (const t of this.tiles.values()) {
      s.nodes += t.nodes;
      s.triangles += t.triangles;
      s.meshTriangles += t.meshTriangles;
      s.wallTriangles += t.wallTriangles;
    }
    return s;
  }

  #choose(view, want) {
    const heap = new Heap(), out = { nodes: [], more: false, missing: [], leaves: [], levels: [] };
    const groups = new Map(), share = this.small ? LEAF_SHARE : 1;
    let estimate = 0, fresh = Math.max(Math.min(NODES_A_PASS, 16 * 4 ** this.pass++), this.size / 2);
    const add = (node, px, unseen) => {
      node.id ??= ++this.ids;
      node.useMesh = false;
      if (node.type === LEAF && want.mesh) {
        node.useMesh = node.mesh !== undefined;
        if (!node.mesh && px > want.pixels / share && (this.small || !unseen) && this.tree.info.parts.has('mesh'))
          this.#group(groups, node, px);
      }
      estimate += node.useMesh ? node.mesh.length / 9 : node.triangles ?? 24;
      out.nodes.push(node);
      out.levels[node.level] = (out.levels[node.level] ?? 0) + 1;
    };
    const offer = (node) => {
      const px = this.#pixels(node, view);
      if (node.type === GRAY || (node.type === LEAF && want.mesh))
        heap.push({ node, px, unseen: this.unseen });
      else
        add(node, px, this.unseen);
    };
    if (this.tree.root.type !== WHITE)
      offer(this.tree.root);
    while (heap.items.length) {
      const { node, px, unseen } = heap.pop();
      const full = estimate + 24 * heap.items.length > want.triangles;
      if (node.type !== GRAY || node.level >= want.level || px <= want.pixels || full || this.tree.isPruned(node)) {
        add(node, px, unseen);
        continue;
      }
      const known = node.pass === this.pass - 1;
      const children = known || fresh > 0 ? this.tree.children(node) : undefined;
      if (!children) {
        if (!known && fresh <= 0)
          out.more = true;
        else if (!this.tree.isPruned(node) && (this.small || !unseen) && out.missing.length < NODES_MISSING)
          out.missing.push({ node, levels: this.#levelsWanted(node, px, want) });
        add(node, px, unseen);
        continue;
      }
      node.pass = this.pass;
      fresh -= known ? 0 : 4;
      for (const child of children)
        if (child.type === GRAY || child.type === LEAF || (child.type === BLACK && want.black))
          offer(child);
    }
    out.leaves = this.#leavesToFetch(groups, want);
    out.levels = Array.from(out.levels, (n) => n ?? 0);
    return out;
  }

  // How many levels below a node are worth having at once: until cells are as small as is wanted.
  #levelsWanted(node, px, want) {
    return Math.max(1, Math.min(want.level - node.level, want.pixels > 0 ? Math.ceil(Math.log2(px / want.pixels)) : Infinity));
  }

  #group(groups, leaf, px) {
    let node = leaf;
    for (let i = 0; node.parent && (leaf.subtree === undefined ? i < GROUP_LEVELS : node.subtree !== undefined); i++)
      node = node.parent;
    const group = groups.get(node) ?? { leaves: [], sum: 0, area: 0, most: 0 };
    groups.set(node, group);
    group.leaves.push(leaf);
    group.sum += px;
    group.area += px * px;
    group.most = Math.max(group.most, px);
  }

  // Neighbours together, the groups that are seen most first; scattered leaves would cost a chunk of 64 KB each, or the faces of a subtree.
  #leavesToFetch(groups, want) {
    const out = [], { info } = this.tree, C = info.subtree_level;
    const worth = C === undefined || this.small ? 0 : FACE_PIXELS * (want.pixels / 16) ** 2 * info.face_count / info.levels[C].gray;
    let subtrees = 0;
    for (const [node, { leaves, area, most }] of [...groups].sort((a, b) => b[1].area - a[1].area))
      if (C !== undefined) { // its faces and vertices lie together
        if (area >= worth && subtrees++ < MESH_SUBTREES)
          out.push(...leaves);
      } else if (out.length < MESH_LEAVES && (this.small || leaves.length >= GROUP_LEAVES || most > LARGE_LEAF * want.pixels))
        out.push(...leaves);
    return out;
  }

  // A tile's geometry: plane triangles and faces first, then those on cell walls, so that walls can be left out by drawing less.
  #build(key, nodes, want) {
    let vertices = 0, triangles = 0, wallTriangles = 0, meshTriangles = 0, edges = 0;
    const polytopes = nodes.map((node) => {
      if (node.useMesh) {
        vertices += node.mesh.length / 3;
        triangles += node.mesh.length / 9;
        meshTriangles += node.mesh.length / 9;
        edges += node.mesh.length / 3;
        return undefined;
      }
      this.made += node.polytope ? 0 : 1.4; // and of nodes above
      const p = this.tree.polytope(node), own = p.corner.length - 2 * p.faces;
      vertices += p.vertices + this.#wallVertices(p);
      for (let f = 0; f < p.faces; f++)
        wallTriangles += p.wall[f] ? p.first[f + 1] - p.first[f] - 2 : 0;
      edges += p.corner.length / 2;
      node.triangles = own;
      triangles += own;
      return p;
    });
    const position = new Float32Array(3 * vertices), tag = new Uint8Array(4 * vertices), index = new Uint32Array(3 * triangles);
    const lines = want.lines ? new Uint32Array(2 * Math.ceil(edges)) : undefined;
    const out = { vertex: 0, inner: 0, wall: 3 * (triangles - wallTriangles), line: 0, position, tag, index, lines };
    nodes.forEach((node, i) => (polytopes[i] ? this.#addPolytope(out, node, polytopes[i]) : this.#addFaces(out, node)));
    const cells = want.cells ? this.#cells(nodes) : undefined;
    return { key, position, tag, index, inner: triangles - wallTriangles, lines: lines?.subarray(0, out.line), cells, triangles, meshTriangles, wallTriangles };
  }

  // Vertices of polygons on walls come twice: there they have another normal. Their numbers among the second ones go to `this.second`.
  #wallVertices(p) {
    const second = this.second ??= new Int16Array(256);
    second.fill(-1, 0, p.vertices);
    let count = 0;
    for (let f = 0; f < p.faces; f++)
      for (let i = p.first[f]; p.wall[f] && i < p.first[f + 1]; i++)
        if (second[p.corner[i]] < 0)
          second[p.corner[i]] = count++;
    return count;
  }

  // The mean normal of a node's planes, octahedral in two bytes 1 .. 255; [0, 0] where there is none. Walls are lit by it, so that the small steps
  // between neighbouring envelopes do not look like edges of the model.
  #meanNormal(p, h) {
    const n = [0, 0, 0], at = (v, k) => p.x[3 * v + k] * h[k];
    for (let f = 0; f < p.faces; f++)
      for (let i = p.first[f] + 1; !p.wall[f] && i + 1 < p.first[f + 1]; i++) {
        const a = p.corner[p.first[f]], b = p.corner[i], c = p.corner[i + 1];
        for (let k = 0; k < 3; k++) {
          const u = (k + 1) % 3, v = (k + 2) % 3;
          n[k] += (at(b, u) - at(a, u)) * (at(c, v) - at(a, v)) - (at(b, v) - at(a, v)) * (at(c, u) - at(a, u));
        }
      }
    const sum = Math.abs(n[0]) + Math.abs(n[1]) + Math.abs(n[2]);
    if (!(sum > 0))
      return [0, 0];
    let [x, y] = [n[0] / sum, n[1] / sum];
    if (n[2] < 0)
      [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
    return [128 + Math.round(127 * x), 128 + Math.round(127 * y)];
  }

  #addPolytope(out, node, p) {
    const h = this.half[node.level], low = this.low.map((l, k) => l + 2 * node.at[k] * h[k]), first = out.vertex;
    for (let i = 0; i < p.x.length; i++)
      out.position[3 * first + i] = low[i % 3] + p.x[i] * 2 * h[i % 3];
    for (let v = first; v < first + p.vertices; v++) {
      out.tag[4 * v] = node.level;
      out.tag[4 * v + 1] = node.type;
    }
    const again = first + p.vertices, count = this.#wallVertices(p), [u, w] = this.#meanNormal(p, h), { second } = this;
    for (let v = 0; v < p.vertices; v++)
      if (second[v] >= 0) {
        const to = again + second[v];
        out.position.copyWithin(3 * to, 3 * (first + v), 3 * (first + v + 1));
        out.tag.set([node.level, node.type, u, w], 4 * to);
      }
    out.vertex += p.vertices + count;
    for (let f = 0; f < p.faces; f++) {
      const from = p.first[f], to = p.first[f + 1];
      let at = p.wall[f] ? out.wall : out.inner;
      const number = p.wall[f] ? (v) => again + second[v] : (v) => first + v;
      for (let i = from + 1; i + 1 < to; i++) {
        out.index[at++] = number(p.corner[from]);
        out.index[at++] = number(p.corner[i]);
        out.index[at++] = number(p.corner[i + 1]);
      }
      if (p.wall[f])
        out.wall = at;
      else
        out.inner = at;
      for (let i = from; out.lines && i < to; i++) {
        const a = p.corner[i], b = p.corner[i + 1 < to ? i + 1 : from];
        if (a < b && out.line + 1 < out.lines.length) {
          out.lines[out.line++] = first + a;
          out.lines[out.line++] = first + b;
        }
      }
    }
  }

  #addFaces(out, node) {
    const first = out.vertex, n = node.mesh.length / 3;
    out.position.set(node.mesh, 3 * first);
    for (let i = 0; i < n; i++) {
      out.tag[4 * (first + i)] = node.level;
      out.tag[4 * (first + i) + 1] = node.type | REAL_FACE;
      out.index[out.inner++] = first + i;
      if (out.lines) {
        out.lines[out.line++] = first + i;
        out.lines[out.line++] = first + (i % 3 === 2 ? i - 2 : i + 1);
      }
    }
    out.vertex += n;
  }

  #cells(nodes) {
    const position = new Float32Array(24 * 3 * nodes.length);
    let at = 0;
    for (const node of nodes) {
      const h = this.half[node.level];
      for (let axis = 0; axis < 3; axis++)
        for (let i = 0; i < 8; i++) { // four edges along each axis, two ends each
          const end = i & 1, u = i >> 1 & 1, v = i >> 2, bit = [0, 0, 0];
          bit[axis] = end;
          bit[(axis + 1) % 3] = u;
          bit[(axis + 2) % 3] = v;
          for (let k = 0; k < 3; k++)
            position[at++] = this.low[k] + 2 * (node.at[k] + bit[k]) * h[k];
        }
    }
    return position;
  }

  /** Takes a leaf's faces (nine numbers each, the model's coordinates). */
  addMesh(leaf, faces) {
    const { center, scale } = this.scene;
    leaf.mesh = Float32Array.from(faces, (x, i) => (x - center[i % 3]) * scale);
  }

  // Nodes that were not refined for long lose what is below them; polytopes of others than the cut's go when they are too many.
  #tidy() {
    const full = this.made > POLYTOPES_KEPT + this.size;
    if (this.pass % PRUNE_PASSES && !full)
      return;
    this.made = 0;
    const walk = (node) => {
      if (node.polytope && node.counted !== this.pass)
        node.polytope = undefined;
      this.made += node.polytope ? 1 : 0;
      if (node.children && (node.pass ?? 0) < this.pass - PRUNE_PASSES)
        node.children = undefined;
      node.children?.forEach(walk);
    };
    walk(this.tree.root);
  }
}
