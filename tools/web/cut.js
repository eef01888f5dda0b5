// Selects the nodes to draw: a cut through the tree with the detail that the camera needs. Draws the nodes as a few hundred pieces of geometry
// ("tiles"), and builds only changed tiles again. Uses neither DOM nor WebGL: runs in the worker, and under node in the tests.
//
// Coordinates of the scene: the model's box is centred on the origin and scaled so that half its diagonal is 1. They are computed in double precision and then rounded.
import { Field } from './field.js';
import { Heap } from './heap.js';
import { Hidden } from './hidden.js';
import { MeshStore } from './mesh.js';
import { BLACK, GRAY, LEAF, WHITE } from './tree.js';
import { TileMaker, planeVector } from './tile.js';
import { CellFaces } from './cell_faces.js';

const TILE_NODES = 300;        // most nodes of a tile: large tiles need fewer draw calls, small tiles are rebuilt faster
const NODES_A_PASS = 2400;     // most new nodes of a pass, so that a picture appears early and improves; the first passes create even fewer
const POLYTOPES_KEPT = 40000;  // in addition to the polytopes of the cut; about 1.3 kB each
const PRUNE_PASSES = 64;
const MESH_LEAVES = 1000;      // whose faces are requested together, approximately
const MESH_SUBTREES = 16;      // the same for files with subtrees
const FACE_PIXELS = 10;        // a subtree's faces are fetched when it fills so many pixels per face, at a detail of 16 pixels
const NEARER_LEVELS = 2;       // nodes that lack so many levels more than other nodes are fetched first
const NODES_MISSING = 1 << 14; // most missing nodes reported in one pass
const LEAF_SHARE = 4;          // in small files, faces of a leaf are used even when the leaf is so many times smaller than the smallest refined gray node
const GROUP_LEVELS = 3;        // leaves with a common ancestor so many levels above have faces near each other in the file
const GROUP_LEAVES = 12;       // groups with fewer leaves are not fetched, unless the leaves are large
const LARGE_LEAF = 6;
const WHOLE_FACES = 1 << 18;   // small files with at most so many faces are drawn with faces instead of envelopes
const WHOLE_PIXELS = 16;       // unless larger cells are requested
const FACES_KEPT = 1.5e6;      // in addition to the faces of the cut

/** Returns the transformation from the model's to the scene's coordinates: scene = (model - center) * scale. */
export function sceneOf(info) {
  const center = info.box_origin.map((o, k) => o + info.box_size[k] / 2);
  return { center, scale: 2 / Math.hypot(...info.box_size) };
}

export class Cut {
  /** `small`: the whole mesh is small enough to be fetched. */
  constructor(tree, { small = true } = {}) {
    this.tree = tree;
    this.small = small;
    this.scene = sceneOf(tree.info);
    this.tiles = new Map(); // key: { signature, pass, nodes, triangles, meshTriangles, cellFaceTriangles }
    this.nodes = [];        // nodes of the last cut
    this.mesh = new MeshStore();
    this.field = new Field();
    this.pass = 0;
    this.size = 0; // number of nodes of the last cut
    this.ids = 0;
    this.made = 0; // approximate number of polytopes that are kept with their nodes
    this.half = Array.from({ length: 21 }, (_, l) => tree.info.box_size.map((s) => s / 2 ** l / 2 * this.scene.scale));
    this.low = tree.info.box_size.map((s) => -s / 2 * this.scene.scale);
    const colour = tree.info.parts.has('colours') ? (node) => tree.colour(node) : undefined;
    this.maker = new TileMaker({ place: (node) => this.#place(node), polytope: (node) => tree.polytope(node), colour, field: this.field, mesh: this.mesh });
    this.cellFaces = new CellFaces(tree, (node) => node.drawn === this.pass, (node) => (node.useMesh ? undefined : tree.polytope(node)));
  }

  #place(node) {
    const h = this.half[node.level];
    return { low: this.low.map((l, k) => l + 2 * node.at[k] * h[k]), size: h.map((x) => 2 * x) };
  }

  // Returns the projected size of the node's cell in pixels, the largest of all views. Sets `unseen` when the cell is out of sight in every view.
  #pixels(node, view) {
    let px = this.#pixelsOf(node, view), { unseen } = this;
    for (const other of view.also ?? []) {
      px = Math.max(px, this.#pixelsOf(node, other));
      unseen &&= this.unseen;
    }
    this.unseen = unseen;
    return px;
  }

  // Returns the size in one view; a tenth of the size when the node is out of sight.
  #pixelsOf(node, view) {
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
   * Performs one pass.
   *
   * `view`: { eye, planes, pixels, also } in scene coordinates. `pixels` is the size in pixels of a length of 1 at a distance of 1. `also` lists further views of
   * the same kind, when the picture has several instances of the model.
   *
   * `want`: { level (deepest), mesh (draw real faces in leaves), pixels (cells are refined until they are smaller), triangles (approximate limit), black (draw
   * black nodes), lines, cells }.
   *
   * Returns { set: [tile], removed: [key], more, deeper, missing, leaves, stats }. `more`: another pass would refine further. `deeper`: the descendants of some
   * nodes are missing. `missing`: these nodes, [{ node, levels }], with the number of missing levels, most important first. `leaves`: leaves whose faces are
   * missing, in the same order.
   */
  update(view, want) {
    this.pass++;
    const chosen = this.#choose(view, want), tiles = this.#tilesOf(chosen.nodes);
    this.#enter(chosen.nodes);
    const flags = (want.lines ? 1 : 0) + (want.cells ? 2 : 0) + (want.black ? 4 : 0), set = [], removed = [], cellFaces = want.black ? undefined : this.cellFaces; // a section shows every cell face
    for (const [root, nodes] of tiles) {
      const key = root.id ??= ++this.ids, signature = signatureOf(nodes, flags), old = this.tiles.get(key);
      if (old?.signature === signature && (want.black || nodes.every((node) => this.field.changedAt(node) <= old.pass)))
        continue;
      const tile = this.maker.make(key, nodes, want, cellFaces);
      set.push(tile);
      this.tiles.set(key, { signature, pass: this.pass, nodes: nodes.length, triangles: tile.triangles, meshTriangles: tile.meshTriangles, cellFaceTriangles: tile.cellFaceTriangles });
    }
    const now = new Set([...tiles.keys()].map((root) => root.id));
    for (const key of this.tiles.keys())
      if (!now.has(key)) {
        removed.push(key);
        this.tiles.delete(key);
      }
    this.#tidy();
    return { set, removed, more: chosen.more, deeper: chosen.missing.length > 0, missing: chosen.missing, leaves: chosen.leaves, stats: { ...this.#stats(), levels: chosen.levels } };
  }

  // Groups neighbouring nodes: each tile is a subtree with at most TILE_NODES nodes of the cut.
  #tilesOf(nodes) {
    const tiles = new Map();
    for (const node of nodes) // counts the nodes of the cut below each node
      for (let n = node; n; n = n.parent) {
        n.below = n.counted === this.pass ? n.below + 1 : 1;
        n.counted = this.pass;
      }
    for (const node of nodes) {
      let root = node;
      while (root.parent && root.parent.below <= TILE_NODES)
        root = root.parent;
      const tile = tiles.get(root);
      if (tile)
        tile.push(node);
      else
        tiles.set(root, [node]);
    }
    return tiles;
  }

  // Updates new and changed nodes: assigns faces to the nodes that draw them, and updates the normals that light envelopes.
  #enter(nodes) {
    const { pass } = this, entering = [], leaves = nodes.filter((node) => node.useMesh);
    for (const node of nodes) {
      if (node.drawn !== pass - 1 || node.drawnMesh !== node.useMesh)
        entering.push(node);
      node.drawn = pass;
    }
    const leaving = this.nodes.filter((node) => node.drawn !== pass || node.drawnMesh !== node.useMesh);
    for (const node of entering)
      node.drawnMesh = node.useMesh;
    this.field.update(nodes, entering, leaving, pass, (node) => (node.useMesh ? node.vector : this.#vectorOf(node)));
    if (entering.length || leaving.length)
      this.mesh.share(leaves);
    this.nodes = nodes;
    this.size = nodes.length;
    this.leaves = leaves;
  }

  #vectorOf(node) {
    this.made += node.polytope ? 0 : 1.4; // the excess is for ancestors, which get polytopes too
    return planeVector(this.tree.polytope(node), this.half[node.level]);
  }

  /** Removes all tiles, because something else is drawn instead. Returns their keys. */
  clear() {
    const keys = [...this.tiles.keys()];
    this.tiles.clear();
    return keys;
  }

  #stats() {
    const s = { nodes: 0, triangles: 0, meshTriangles: 0, cellFaceTriangles: 0, tiles: this.tiles.size };
    for (const t of this.tiles.values()) {
      s.nodes += t.nodes;
      s.triangles += t.triangles;
      s.meshTriangles += t.meshTriangles;
      s.cellFaceTriangles += t.cellFaceTriangles;
    }
    return s;
  }

  #choose(view, want) {
    const heap = new Heap(), out = { nodes: [], more: false, missing: [], leaves: [], levels: [] };
    const groups = new Map(), share = this.small ? LEAF_SHARE : 1, whole = this.#takesWhole(want) ? this.#wholeMesh() : undefined;
    if (whole?.nodes)
      return whole;
    let estimate = 0, fresh = Math.max(Math.min(NODES_A_PASS, 4 * 4 ** this.pass), this.size / 2);
    const add = (node, px, unseen) => {
      node.id ??= ++this.ids;
      node.useMesh = false;
      if (node.type === LEAF && want.mesh) {
        node.useMesh = node.mesh !== undefined;
        if (!node.mesh && (this.small || !unseen) && this.tree.info.parts.has('mesh'))
          this.#group(groups, node, px, px > want.pixels / share);
      }
      estimate += node.useMesh ? node.mesh.length / 2 : 16; // approximate, because several leaves list the same face
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
    out.levels = Array.from(out.levels, (n) => n ?? 0);
    if (!this.small && !out.more && want.pixels > 0 && !view.also?.length && (out.missing.length || groups.size))
      this.#leaveHidden(view, out, groups);
    return Object.assign(out, whole ?? { leaves: this.#leavesToFetch(groups, want) });
  }

  // Omits hidden nodes from the nodes to fetch, in large files.
  #leaveHidden(view, out, groups) {
    const hidden = new Hidden(view, out.nodes, (node) => {
      const { low, size } = this.#place(node);
      return { center: low.map((l, k) => l + size[k] / 2), radius: Math.hypot(...size) / 2 };
    });
    const nearest = Math.max(...out.missing.map(({ levels }) => levels)) - NEARER_LEVELS; // the other nodes are fetched when these have arrived
    out.missing = out.missing.filter(({ node, levels }) => levels >= nearest && !hidden.has(node));
    for (const [root, group] of groups) {
      group.leaves = hidden.has(root) ? [] : group.leaves;
      if (!group.leaves.some((leaf) => !hidden.has(leaf)))
        groups.delete(root);
    }
  }

  // Returns the number of levels to fetch together below a node, until cells are as small as wanted.
  #levelsWanted(node, px, want) {
    return Math.max(1, Math.min(want.level - node.level, want.pixels > 0 ? Math.ceil(Math.log2(px / want.pixels)) : Infinity));
  }

  #group(groups, leaf, px, isLarge) {
    let node = leaf;
    for (let i = 0; node.parent && (leaf.subtree === undefined ? i < GROUP_LEVELS : node.subtree !== undefined); i++)
      node = node.parent;
    const group = groups.get(node) ?? { leaves: [], area: 0, most: 0, large: 0 };
    groups.set(node, group);
    group.leaves.push(leaf);
    group.large += isLarge ? 1 : 0;
    group.area += isLarge ? px * px : 0;
    group.most = Math.max(group.most, px);
  }

  // Returns true when the whole mesh is drawn. Few faces are cheaper to draw than envelopes, and look better.
  #takesWhole(want) {
    const { info } = this.tree;
    return want.mesh && this.small && want.pixels <= WHOLE_PIXELS && info.parts.has('mesh') && info.face_count <= WHOLE_FACES;
  }

  // Returns all leaves as a cut when their faces have been loaded. Otherwise returns the missing nodes and leaves; meanwhile the normal cut is drawn.
  #wholeMesh() {
    const nodes = [], missing = [], levels = [], walk = (node) => {
      if (node.type === LEAF) {
        nodes.push(node);
        node.id ??= ++this.ids;
        levels[node.level] = (levels[node.level] ?? 0) + 1;
      } else if (node.type === GRAY && !this.tree.isPruned(node)) {
        node.kept = this.pass; // #tidy() keeps this node's children
        const children = this.tree.children(node);
        if (!children && !this.tree.isPruned(node))
          missing.push({ node, levels: 99 });
        children?.forEach(walk);
      } else if (node.type === GRAY) {
        nodes.push(node); // pruned in a subset: its envelope is drawn
        node.id ??= ++this.ids;
      }
    };
    walk(this.tree.root);
    const leaves = missing.length ? [] : nodes.filter((node) => node.type === LEAF && !node.mesh);
    if (missing.length || leaves.length)
      return { missing: missing.slice(0, NODES_MISSING), leaves };
    for (const node of nodes)
      node.useMesh = node.type === LEAF;
    return { nodes, more: false, missing, leaves, levels: Array.from(levels, (n) => n ?? 0) };
  }

  // Returns the leaves whose faces are fetched next: groups of neighbouring leaves, the group with the largest visible area first. A scattered leaf would need a
  // separate chunk of 64 kB, or the faces of a whole subtree. All leaves of a group are fetched, because single envelopes among real faces would be conspicuous.
  #leavesToFetch(groups, want) {
    const out = [], { info } = this.tree, C = info.subtree_level;
    const worth = C === undefined || this.small ? 0 : FACE_PIXELS * (want.pixels / 16) ** 2 * info.face_count / info.levels[C].gray;
    let subtrees = 0;
    for (const { leaves, area, most, large } of [...groups.values()].filter((g) => g.large).sort((a, b) => b.area - a.area))
      if (C !== undefined) { // faces and vertices of a subtree are stored together
        if (area >= worth && subtrees++ < MESH_SUBTREES)
          out.push(...leaves);
      } else if (out.length < MESH_LEAVES && (this.small || large >= GROUP_LEAVES || most > LARGE_LEAF * want.pixels))
        out.push(...leaves);
    return out;
  }

  /** Adds a leaf's faces: numbers, corners (nine numbers each, in the model's coordinates) and colours. */
  addMesh(leaf, { numbers, corners, colours }) {
    const { center, scale } = this.scene;
    this.mesh.add(leaf, Float32Array.from(corners, (x, i) => (x - center[i % 3]) * scale), numbers, colours);
  }

  // Frees memory: removes the descendants of nodes that were not refined for PRUNE_PASSES passes. Frees polytopes and faces outside the cut when there are too many.
  #tidy() {
    if (this.mesh.faces > FACES_KEPT + 2 * this.leaves.reduce((sum, leaf) => sum + leaf.owned, 0)) {
      this.#forgetMeshes(this.tree.root);
      this.mesh.keep(this.leaves);
      this.mesh.share(this.leaves);
    }
    const full = this.made > POLYTOPES_KEPT + this.size;
    if (this.pass % PRUNE_PASSES && !full)
      return;
    this.made = 0;
    const walk = (node) => {
      if (node.polytope && node.counted !== this.pass)
        node.polytope = undefined;
      this.made += node.polytope ? 1 : 0;
      if (node.children && Math.max(node.pass ?? 0, node.kept ?? 0) < this.pass - PRUNE_PASSES)
        node.children = undefined;
      node.children?.forEach(walk);
    };
    walk(this.tree.root);
  }

  #forgetMeshes(node) {
    if (!node.useMesh || node.drawn !== this.pass)
      node.mesh = undefined;
    node.children?.forEach((child) => this.#forgetMeshes(child));
  }
}

// Returns a hash of a tile's content. The tile is rebuilt when it changes; changes of neighbouring nodes are not included.
function signatureOf(nodes, flags) {
  nodes.sort((a, b) => a.id - b.id);
  let signature = nodes.length * 8 + flags;
  const mix = (x) => (signature = (Math.imul(signature, 16777619) ^ x) | 0);
  for (const n of nodes) {
    mix(2 * n.id + (n.useMesh ? 1 : 0));
    if (n.useMesh) {
      mix(n.ownedHash);
      mix(n.stamp);
    }
  }
  return signature;
}
