// Chooses patches of the simplified surface (the file's part `surface`) for a view, and makes their tile. Uses neither DOM nor WebGL.
import { Heap } from './heap.js';
import { Hidden } from './hidden.js';
import { REAL_FACE } from './tile.js';
import { LEAF } from './tree.js';

export const KEY = 'surface';      // key of the tile
export const CAPS = 'caps';        // key of the tile with the caps
const CAP_COLOUR = [214, 64, 51, 64]; // its last component shows it in every colouring
const CELL_PIXELS = 16;            // normal detail
const ERROR = 2;                   // allowed error in pixels at normal detail; most of a patch is much closer to the model
const TRIANGLES = 150_000;         // most triangles at this detail; twice as many at half of the pixels, which fast machines draw
const EVERYTHING = 2_000_000;      // most triangles at all
const WHOLE_FACES = 1 << 18;       // small files with at most so many faces are drawn with all faces
const KEPT = 0.6;                  // a replaced patch returns when its error is smaller than this share of the allowed error
const FACE_PIXELS = 1.5;           // the model's faces are drawn where a face covers at least so many pixels at normal detail
const STAGES = [32, 4];            // the first picture is drawn with errors that are so many times greater, the first of them if there are no envelopes to draw before
const FEW = 24;                    // unless so few patches are missing
const COVERS = 1024;               // at most so many patches, as fine as possible, are compared to find hidden ones
const HIDDEN = 4;                  // factor of the allowed error of hidden patches
const BLOCK = 26_000;              // triangles of successive patches that are read together: half of the largest chunk, which has 32,768 normals

const nameOf = ({ patch, faces }) => (faces ? `${patch}f` : `${patch}`);

export class Surface {
  /** `scene`: by sceneOf(); `patches`: by View.patches(); `small`: the whole mesh is small enough to be fetched. */
  constructor(info, scene, patches, small) {
    Object.assign(this, { info, scene, patches });
    this.mesh = info.parts.has('mesh');
    this.whole = small && this.mesh && info.face_count <= WHOLE_FACES;
    this.low = info.box_size.map((s) => -s / 2 * scene.scale);
    this.stages = info.parts.has('planes') ? STAGES.slice(1) : STAGES;
    this.known = new Set(); // patches that were read
    this.opened = new Set(); // patches that are replaced in the last choice
    let triangles = 0;
    const before = patches.map((p) => (triangles += p.triangles) - p.triangles);
    this.block = patches.map((p) => (p.child < p.end ? Math.floor(before[p.child] / BLOCK) : undefined)); // the block of a patch's children
    const cutAt = (level) => patches.filter((p) => p.level === level || (p.level < level && p.child === p.end));
    this.covers = cutAt(0);
    for (let level = 1; level <= patches.at(-1).level && cutAt(level).length <= COVERS; level++)
      this.covers = cutAt(level);
  }

  // Returns the low corner and half of the size of a patch's cell.
  #cellOf({ level, at }) {
    const half = this.info.box_size.map((s) => s / 2 ** level / 2 * this.scene.scale);
    return { half, center: half.map((h, k) => this.low[k] + (2 * at[k] + 1) * h) };
  }

  // Estimates which patches are hidden behind others in a view: none if a part is cut away (`black`).
  #hiddenIn(view, { black }) {
    return black || view.also?.length ? undefined : new Hidden(view, this.covers, (patch) => {
      const { half, center } = this.#cellOf(patch);
      return { center, radius: Math.hypot(...half) };
    });
  }

  // Returns the size in pixels of a length of 1 at the patch's cell, the largest of all views; 0 when the cell is out of sight.
  #pixelsAt(patch, view) {
    return Math.max(this.#pixelsIn(patch, view), ...(view.also ?? []).map((other) => this.#pixelsIn(patch, other)));
  }

  #pixelsIn(patch, { eye, planes, pixels }) {
    const { half: h, center: c } = this.#cellOf(patch);
    for (const [x, y, z, w] of planes)
      if (x * c[0] + y * c[1] + z * c[2] + w < -(Math.abs(x) * h[0] + Math.abs(y) * h[1] + Math.abs(z) * h[2]))
        return 0;
    const near = Math.hypot(...c.map((x, k) => Math.max(Math.abs(x - eye[k]) - h[k], 0)));
    return pixels / Math.max(near, 0.05 * 2 * Math.hypot(...h));
  }

  // Returns true when the model's faces are large enough in the picture to be drawn instead of a patch. Few faces in a cell can be small faces in its corner.
  // Therefore the faces of the parent must be large, too.
  #showsFaces(patch, parent, scale, share) {
    return this.mesh && [patch, parent ?? patch].every((p) => this.#hasLargeFaces(p, scale, share));
  }

  #hasLargeFaces({ level, faces }, scale, share) {
    const cell = Math.max(...this.info.box_size) / 2 ** level * this.scene.scale * scale;
    return cell * cell >= FACE_PIXELS * share * share * faces;
  }

  /**
   * Chooses patches: [{ patch, faces }], ascending. `view`: as for Cut.update(); `want`: { pixels, triangles, black }; `coarser`: a factor of the allowed error. Also returns the
   * number of triangles, the greatest error of a visible patch in pixels, and the greatest error of all in the model's unit.
   */
  choose(view, want, coarser = 1) {
    const { patches } = this, whole = want.pixels === 0 ? this.mesh && this.info.face_count <= EVERYTHING : this.whole && coarser === 1 && want.pixels <= CELL_PIXELS;
    const share = want.pixels / CELL_PIXELS, allowed = coarser * share * ERROR, most = Math.min(want.triangles, EVERYTHING, TRIANGLES / share);
    const heap = new Heap(), chosen = [], opened = new Set(), hidden = whole ? undefined : this.#hiddenIn(view, want);
    let triangles = 0;
    // The limit of triangles may be reached before all errors are small enough. Errors are compared by powers of 4. Of similar errors, those of the block with the
    // greatest sum are first, because scattered patches would need most chunks of the file.
    const seen = new Map(), sums = new Map(), see = (patch) => {
      const p = patches[patch], scale = this.#pixelsAt(p, view), error = p.error * this.scene.scale * scale, size = error / (hidden?.has(p) ? HIDDEN : 1), block = this.block[patch];
      seen.set(patch, { scale, error, size });
      if (size > allowed)
        sums.set(block, (sums.get(block) ?? 0) + size);
      for (let child = p.child; child < p.end && (whole || size > KEPT * allowed); child++)
        see(child);
    };
    see(0);
    const fraction = (size) => size / (1 + size); // from 0 to 1, in the order of sizes
    const power = (size) => Math.max(0, Math.floor(Math.log2(size / (allowed || 1)) / 2));
    const urgency = (size, block) => (size > allowed ? 1 + power(size) + fraction(block === undefined ? size : sums.get(block)) : fraction(size));
    const offer = (patch, parent) => {
      const found = seen.get(patch);
      heap.push({ ...found, patch, parent, px: urgency(found.size, this.block[patch]) });
      triangles += patches[patch].triangles;
    };
    offer(0);
    while (heap.items.length) {
      const { patch, parent, scale, error, size } = heap.pop(), p = patches[patch], leaf = p.end === p.child;
      const more = (leaf ? p.faces : patches.slice(p.child, p.end).reduce((sum, c) => sum + c.triangles, 0)) - p.triangles;
      const allow = this.opened.has(patch) ? KEPT * allowed : allowed;
      if (!whole && (size <= allow || triangles + more > most || (leaf && !this.#showsFaces(p, parent, scale, share)))) {
        chosen.push({ patch, faces: false, px: error });
        continue;
      }
      opened.add(patch);
      if (leaf) {
        chosen.push({ patch, faces: true, px: 0 });
        triangles += more;
      } else {
        triangles -= p.triangles;
        for (let child = p.child; child < p.end; child++)
          offer(child, p);
      }
    }
    if (coarser === 1)
      this.opened = opened;
    chosen.sort((a, b) => a.patch - b.patch);
    return { chosen, triangles, pixels: Math.max(0, ...chosen.map((c) => c.px)), error: chosen.reduce((e, c) => (c.faces ? e : Math.max(e, patches[c.patch].error)), 0) };
  }

  /** Returns the next choice to draw for a view, until one is `last`: the first picture of a file is drawn in stages. `name` identifies what is drawn. */
  next(view, want) {
    const missing = ({ chosen }) => chosen.filter((c) => !this.known.has(nameOf(c))).length;
    let made = this.choose(view, want);
    const staged = !this.complete && missing(made) > FEW && this.stages.map((coarser) => this.choose(view, want, coarser)).find((c) => missing(c) > 0);
    made = staged || made;
    return { ...made, last: !staged, name: made.chosen.map(nameOf).join() };
  }

  /** Notes that a choice was read. */
  read({ chosen, last }) {
    chosen.forEach((c) => this.known.add(nameOf(c)));
    this.complete ||= last;
  }

  /** Makes the tile of a mesh by View.surface(), as the tiles of tile.js. `lines`: with the edges of triangles. */
  tileOf(mesh, lines) {
    return tileOf(KEY, mesh, lines);
  }
}

function tileOf(key, { position, normal, hue, index, triangles, faces }, lines) {
  const count = position.length / 3, tag = new Uint8Array(4 * count);
  for (let i = 0; i < tag.length; i += 4) {
    tag[i + 1] = LEAF | REAL_FACE;
    tag[i + 2] = 255;
  }
  return { key, position, tag, normal, hue, index, inner: triangles, lines: lines ? edgesOf(index) : undefined, triangles, meshTriangles: faces, cellFaceTriangles: 0 };
}

/** Makes the tile of a mesh by View.caps(). */
export function capsTile(mesh) {
  const hue = new Uint8Array(4 * mesh.position.length / 3);
  for (let i = 0; i < hue.length; i += 4)
    hue.set(CAP_COLOUR, i);
  return tileOf(CAPS, { ...mesh, hue });
}

// Returns each edge of triangles once, except edges with one triangle, of which half may be missing.
function edgesOf(index) {
  const out = new Uint32Array(2 * index.length);
  let to = 0;
  for (let i = 0; i < index.length; i++) {
    const a = index[i], b = index[i % 3 === 2 ? i - 2 : i + 1];
    if (a < b) {
      out[to++] = a;
      out[to++] = b;
    }
  }
  return out.slice(0, to);
}
