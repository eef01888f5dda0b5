// Stores the received real faces, with shared vertices for smooth shading. A face that several leaves list is stored once.
const SMOOTH = 0.766;        // cosine of 40 degrees: greatest angle between a face and the mean of the faces at a corner that is drawn smooth
const CREASE = 0.866;        // cosine of 30 degrees: at other corners, an edge between faces with a greater angle is drawn sharp
const NONE = 0xffffffff;
const EMPTY = new Uint32Array(0);

// Returns a typed array with capacity for twice `count` items.
function grown(array, count) {
  if (count <= array.length)
    return array;
  const out = new array.constructor(Math.max(1024, 2 * count));
  out.set(array);
  return out;
}

export class MeshStore {
  constructor() {
    this.clear();
  }

  clear() {
    this.faces = this.vertices = 0;
    this.byNumber = new Map();            // maps a face's number in the file to its index in this store
    this.number = EMPTY;
    this.corner = EMPTY;                  // three vertices of each face
    this.next = EMPTY;                    // by corner: another corner at the same vertex
    this.normal = new Float32Array(0);    // by face: the normal, of length 1 or 0
    this.angle = new Float32Array(0);     // by corner: the face's angle
    this.owner = new Int32Array(0);       // by face: the id of the leaf that draws the face
    this.colour = new Uint8Array(0);      // by corner: red, green, blue, if `coloured`
    this.coloured = false;
    this.leafOf = [];                     // by face: a leaf that lists it, which is notified when its normals change
    this.position = new Float32Array(0);  // by vertex
    this.last = EMPTY;                    // by vertex: its newest corner
    this.table = new Uint32Array(4096).fill(NONE);
  }

  /**
   * Adds a leaf's faces: nine numbers each in the scene's coordinates, and their colours, if any, nine bytes each. Sets the leaf's `mesh`, the indices of the faces,
   * and `vector`, the sum of their area vectors and the sum of their areas.
   */
  add(leaf, positions, numbers, colours) {
    this.coloured ||= colours !== undefined;
    const sum = [0, 0, 0, 0];
    leaf.mesh = Uint32Array.from(numbers, (number, i) => this.byNumber.get(number) ?? this.#addFace(leaf, positions, 9 * i, number, colours));
    for (const face of leaf.mesh)
      this.#addArea(face, sum);
    leaf.vector = sum;
    leaf.stamp = (leaf.stamp ?? 0) + 1;
  }

  #addFace(leaf, x, at, number, colours) {
    const face = this.faces++, c = 3 * face;
    this.#makeRoom();
    this.byNumber.set(number, face);
    this.number[face] = number;
    this.leafOf[face] = leaf;
    if (colours)
      this.colour.set(colours.subarray(at, at + 9), 9 * face);
    for (let k = 0; k < 3; k++) {
      const v = this.corner[c + k] = this.#vertex(x[at + 3 * k], x[at + 3 * k + 1], x[at + 3 * k + 2]);
      for (let other = this.last[v]; other !== NONE; other = this.next[other]) { // the normals at this vertex have changed
        const neighbour = this.leafOf[Math.floor(other / 3)];
        neighbour.stamp = (neighbour.stamp ?? 0) + 1;
      }
      this.next[c + k] = this.last[v];
      this.last[v] = c + k;
    }
    this.#shape(face);
    return face;
  }

  #makeRoom() {
    const n = this.faces;
    for (const name of ['number', 'owner'])
      this[name] = grown(this[name], n);
    for (const name of ['corner', 'next', 'normal', 'angle'])
      this[name] = grown(this[name], 3 * n);
    if (this.coloured)
      this.colour = grown(this.colour, 9 * n);
    this.position = grown(this.position, 3 * this.vertices + 9);
    this.last = grown(this.last, this.vertices + 3);
  }

  // Returns the vertex at a position. Vertices with equal positions are one vertex.
  #vertex(x, y, z) {
    if (2 * this.vertices >= this.table.length)
      this.#rehash(2 * this.table.length);
    const { position, table } = this, mask = table.length - 1, at = 3 * this.vertices;
    position[at] = x;
    position[at + 1] = y;
    position[at + 2] = z;
    let slot = this.#hash(this.vertices) & mask;
    for (; table[slot] !== NONE; slot = (slot + 1) & mask) {
      const v = 3 * table[slot];
      if (position[v] === position[at] && position[v + 1] === position[at + 1] && position[v + 2] === position[at + 2])
        return table[slot];
    }
    table[slot] = this.vertices;
    this.last[this.vertices] = NONE;
    return this.vertices++;
  }

  #hash(v) {
    const { position } = this;
    this.float ??= new Float32Array(3);
    this.bits ??= new Uint32Array(this.float.buffer);
    for (let k = 0; k < 3; k++)
      this.float[k] = position[3 * v + k] + 0; // -0 is 0
    const [a, b, c] = this.bits, h = Math.imul(a, 0x9e3779b1) ^ Math.imul(b, 0x85ebca6b) ^ Math.imul(c, 0xc2b2ae35);
    return (h ^ h >>> 15) >>> 0;
  }

  #rehash(length) {
    this.table = new Uint32Array(length).fill(NONE);
    for (let v = 0; v < this.vertices; v++) {
      let slot = this.#hash(v) & (length - 1);
      while (this.table[slot] !== NONE)
        slot = (slot + 1) & (length - 1);
      this.table[slot] = v;
    }
  }

  // Computes the face's normal and the angle at each corner.
  #shape(face) {
    const { position, corner, normal, angle } = this, p = [0, 1, 2].map((k) => 3 * corner[3 * face + k]);
    const edge = (a, b) => [position[b] - position[a], position[b + 1] - position[a + 1], position[b + 2] - position[a + 2]];
    const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const n = cross(edge(p[0], p[1]), edge(p[0], p[2])), size = Math.hypot(...n);
    for (let k = 0; k < 3; k++) {
      const u = edge(p[k], p[(k + 1) % 3]), v = edge(p[k], p[(k + 2) % 3]);
      normal[3 * face + k] = size > 0 ? n[k] / size : 0;
      angle[3 * face + k] = Math.atan2(Math.hypot(...cross(u, v)), u[0] * v[0] + u[1] * v[1] + u[2] * v[2]);
    }
  }

  #addArea(face, sum) {
    const { position, corner } = this, [a, b, c] = [0, 1, 2].map((k) => 3 * corner[3 * face + k]), n = [0, 0, 0];
    for (let k = 0; k < 3; k++) {
      const u = (k + 1) % 3, v = (k + 2) % 3;
      n[k] = ((position[b + u] - position[a + u]) * (position[c + v] - position[a + v]) - (position[b + v] - position[a + v]) * (position[c + u] - position[a + u])) / 2;
      sum[k] += n[k];
    }
    sum[3] += Math.hypot(...n);
  }

  /**
   * Computes the normal at a corner into `out`: the mean, by angles, of the faces around the vertex. If it differs by more than 40 degrees from this face's normal,
   * only faces whose normals differ by at most 30 degrees count.
   */
  cornerNormal(c, out) {
    const { normal } = this, own = 3 * Math.floor(c / 3);
    this.#meanNormal(c, -1, out);
    const dot = normal[own] * out[0] + normal[own + 1] * out[1] + normal[own + 2] * out[2];
    if (dot < SMOOTH * Math.hypot(out[0], out[1], out[2]))
      this.#meanNormal(c, CREASE, out);
  }

  #meanNormal(c, least, out) {
    const { normal, next, angle } = this, own = 3 * Math.floor(c / 3);
    out[0] = out[1] = out[2] = 0;
    for (let other = this.last[this.corner[c]]; other !== NONE; other = next[other]) {
      const f = 3 * Math.floor(other / 3);
      if (normal[f] * normal[own] + normal[f + 1] * normal[own + 1] + normal[f + 2] * normal[own + 2] < least)
        continue;
      for (let k = 0; k < 3; k++)
        out[k] += angle[other] * normal[f + k];
    }
  }

  /** Assigns each face to the one of `leaves` that draws the face: the leaf with the least id. Sets each leaf's `owned`, and `ownedHash`, which shows a change. */
  share(leaves) {
    const { owner } = this;
    for (const { mesh } of leaves)
      for (const face of mesh)
        owner[face] = 0x7fffffff;
    for (const { mesh, id } of leaves)
      for (const face of mesh)
        owner[face] = Math.min(owner[face], id);
    for (const leaf of leaves) {
      leaf.owned = leaf.ownedHash = 0;
      for (const face of leaf.mesh)
        if (owner[face] === leaf.id) {
          leaf.owned++;
          leaf.ownedHash = (Math.imul(leaf.ownedHash, 31) + face) | 0;
        }
    }
  }

  /** Removes all faces except those of `leaves`. Removed faces must be fetched again before they are drawn. */
  keep(leaves) {
    const old = leaves.map((leaf) => {
      const numbers = Array.from(leaf.mesh, (face) => this.number[face]), positions = new Float32Array(9 * numbers.length);
      const colours = this.coloured ? new Uint8Array(9 * numbers.length) : undefined;
      leaf.mesh.forEach((face, i) => {
        colours?.set(this.colour.subarray(9 * face, 9 * face + 9), 9 * i);
        for (let k = 0; k < 9; k++)
          positions[9 * i + k] = this.position[3 * this.corner[3 * face + Math.floor(k / 3)] + k % 3];
      });
      return [leaf, positions, numbers, colours];
    });
    this.clear();
    old.forEach((leaf) => this.add(...leaf));
  }
}
