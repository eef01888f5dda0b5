// Computes a smooth field of normals for envelopes: at each corner of a drawn cell, the mean normal of the nodes around the corner, weighted by area.
// Neighbouring nodes have the same normals at common corners, so that the steps between envelopes do not look like edges of the model. The field also
// detects changes of a node's neighbours.
const DEEPEST = 20;
const NONE = 0xffffffff;

export class Field {
  constructor() {
    this.clear(1 << 14);
  }

  clear(length) {
    this.count = 0;
    this.xy = new Float64Array(length);  // x and y of a corner, in cells of the deepest level
    this.z = new Uint32Array(length);
    this.sum = new Float64Array(4 * length); // sum of the nodes' vectors, and sum of their lengths
    this.changed = new Uint32Array(length);
    this.table = new Uint32Array(2 * length).fill(NONE);
  }

  #slot(x, y, z) {
    const xy = x * 2097152 + y, mask = this.table.length - 1, hash = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca6b) ^ Math.imul(z, 0xc2b2ae35);
    let at = (hash ^ hash >>> 15) & mask;
    for (; this.table[at] !== NONE; at = (at + 1) & mask) {
      const i = this.table[at];
      if (this.xy[i] === xy && this.z[i] === z)
        return i;
    }
    this.table[at] = this.count;
    this.xy[this.count] = xy;
    this.z[this.count] = z;
    return this.count++;
  }

  #corners(node) {
    const size = 2 ** (DEEPEST - node.level), slots = new Uint32Array(8);
    for (let c = 0; c < 8; c++)
      slots[c] = this.#slot((node.at[0] + (c & 1)) * size, (node.at[1] + (c >> 1 & 1)) * size, (node.at[2] + (c >> 2)) * size);
    return slots;
  }

  /** Replaces the nodes of the last cut. `vector(node)` returns [x, y, z, sum of lengths]. Sets the member `slots` of a node: the indices of its corners in the field. */
  update(nodes, entering, leaving, pass, vector) {
    if (this.count + 8 * entering.length > this.xy.length) {
      this.clear(2 ** Math.ceil(Math.log2(16 * nodes.length + 1024)));
      for (const node of nodes) {
        node.slots = this.#corners(node);
        this.#add(node, node.inField = vector(node), 1, pass);
      }
      return;
    }
    for (const node of leaving)
      this.#add(node, node.inField, -1, pass);
    for (const node of entering) {
      node.slots = this.#corners(node);
      this.#add(node, node.inField = vector(node), 1, pass);
    }
  }

  #add({ slots }, vector, sign, pass) {
    for (const i of slots) {
      for (let k = 0; k < 4; k++)
        this.sum[4 * i + k] += sign * vector[k];
      this.changed[i] = pass;
    }
  }

  /** Returns the last pass in which the field at a node's corners changed. */
  changedAt({ slots }) {
    let last = 0;
    for (const i of slots)
      last = Math.max(last, this.changed[i]);
    return last;
  }

  /** Prepares at() for a node. */
  enter({ slots }) {
    this.here ??= new Float64Array(24);
    for (let c = 0; c < 8; c++)
      for (let k = 0; k < 3; k++)
        this.here[3 * c + k] = this.sum[4 * slots[c] + k] / (this.sum[4 * slots[c] + 3] || 1);
  }

  /** Evaluates the field at a position in the cell, 0 to 1 on each axis, into `out`. The length of the result is 1 where all normals agree, and 0 where they cancel. */
  at(x, y, z, out) {
    out[0] = out[1] = out[2] = 0;
    for (let c = 0; c < 8; c++) {
      const w = (c & 1 ? x : 1 - x) * (c & 2 ? y : 1 - y) * (c & 4 ? z : 1 - z);
      for (let k = 0; k < 3; k++)
        out[k] += w * this.here[3 * c + k];
    }
  }
}
