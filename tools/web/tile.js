// Builds the geometry of nodes of a cut as typed arrays: envelopes with visible cell faces, real faces, lines.
// A vertex has a position, a tag [level, type, weight of its normal, 0] and a normal, in octahedral encoding with two numbers of 16 bits. Vertices of
// coloured tiles also have a hue: [red, green, blue, 0]; the last number is 255 where there is no colour.
export const REAL_FACE = 4;  // flag in a tag's type, in addition to the node's type
const SURE = [0.25, 0.6];    // the weight of the field rises from 0 to 1 between these lengths of the field; thin parts and edges are shaded flat

function grown(array, count) {
  if (count <= array.length)
    return array;
  const out = new array.constructor(2 * count);
  out.set(array);
  return out;
}

export class TileMaker {
  /** `place(node)`: returns { low, size } of the node's cell in the scene; `colour(node)`: returns the envelope's colour (tree.js), if envelopes have colours. */
  constructor({ place, polytope, colour, field, mesh }) {
    Object.assign(this, { place, polytope, colour, field, mesh });
    this.position = new Float32Array(3 << 12);
    this.tag = new Uint8Array(4 << 12);
    this.normal = new Int16Array(2 << 12);
    this.hue = new Uint8Array(4 << 12);
    this.inner = new Uint32Array(3 << 12);
    this.outer = new Uint32Array(3 << 12);
    this.line = new Uint32Array(2 << 12);
    this.chain = new Int32Array(0);   // by mesh vertex: its newest vertex in the tile, +1
    this.older = new Int32Array(1 << 12);
    this.n = [0, 0, 0];
  }

  /**
   * Returns { key, position, tag, normal, index, inner, lines, cells, triangles, meshTriangles, cellFaceTriangles }. The triangles of planes and faces are first in
   * `index`. `cellFaces`: from cell_faces.js; if undefined, all cell faces are drawn completely.
   */
  make(key, nodes, want, cellFaces) {
    this.vertices = this.inners = this.outers = this.lines = 0;
    this.wanted = want.lines;
    const coloured = this.colour || (this.mesh.coloured && nodes.some((node) => node.useMesh));
    let meshTriangles = 0;
    for (const node of nodes)
      if (node.useMesh)
        meshTriangles += this.#addFaces(node);
      else
        this.#addPolytope(node, cellFaces);
    for (const node of nodes)
      if (node.useMesh)
        this.#forget(node);
    const index = new Uint32Array(this.inners + this.outers);
    index.set(this.inner.subarray(0, this.inners));
    index.set(this.outer.subarray(0, this.outers), this.inners);
    return { key, position: this.position.slice(0, 3 * this.vertices), tag: this.tag.slice(0, 4 * this.vertices), normal: this.normal.slice(0, 2 * this.vertices),
      hue: coloured ? this.hue.slice(0, 4 * this.vertices) : undefined, index, inner: this.inners / 3,
      lines: want.lines ? this.line.slice(0, this.lines) : undefined, cells: want.cells ? this.#cells(nodes) : undefined,
      triangles: index.length / 3, meshTriangles, cellFaceTriangles: this.outers / 3 };
  }

  // Adds a vertex with the normal this.n. The length of the normal is its weight.
  #vertex(x, y, z, level, type) {
    const i = this.vertices++, { n } = this;
    this.position = grown(this.position, 3 * i + 3);
    this.tag = grown(this.tag, 4 * i + 4);
    this.normal = grown(this.normal, 2 * i + 2);
    this.position[3 * i] = x;
    this.position[3 * i + 1] = y;
    this.position[3 * i + 2] = z;
    const sum = Math.abs(n[0]) + Math.abs(n[1]) + Math.abs(n[2]), weight = Math.min(1, Math.max(0, (Math.hypot(n[0], n[1], n[2]) - SURE[0]) / (SURE[1] - SURE[0])));
    this.tag[4 * i] = level;
    this.tag[4 * i + 1] = type;
    this.tag[4 * i + 2] = sum > 0 ? Math.round(255 * weight) : 0;
    this.tag[4 * i + 3] = 0;
    this.hue = grown(this.hue, 4 * i + 4);
    this.hue.fill(255, 4 * i, 4 * i + 4);
    const u = sum > 0 ? n[0] / sum : 0, v = sum > 0 ? n[1] / sum : 0, below = n[2] < 0;
    this.normal[2 * i] = Math.round(32767 * (below ? (1 - Math.abs(v)) * (u < 0 ? -1 : 1) : u));
    this.normal[2 * i + 1] = Math.round(32767 * (below ? (1 - Math.abs(u)) * (v < 0 ? -1 : 1) : v));
    return i;
  }

  #addLine(a, b) {
    this.line = grown(this.line, this.lines + 2);
    this.line[this.lines++] = a;
    this.line[this.lines++] = b;
  }

  #triangle(onCellFace, a, b, c) {
    const name = onCellFace ? 'outer' : 'inner', count = onCellFace ? 'outers' : 'inners', to = this[name] = grown(this[name], this[count] + 3);
    to[this[count]++] = a;
    to[this[count]++] = b;
    to[this[count]++] = c;
  }

  // --- envelopes ---

  #addPolytope(node, cellFaces) {
    const p = this.polytope(node), { low, size } = this.place(node), numbers = this.numbers ??= new Int32Array(256), seen = this.seen ??= [];
    this.field.enter(node);
    numbers.fill(-1, 0, p.vertices);
    for (let f = 0; f < p.faces; f++)
      seen[f] = p.onCellFace[f] && cellFaces ? cellFaces.seen(node, p, f) : undefined;
    const colour = this.colour && this.colour(node);
    const make = (x, y, z) => {
      this.field.at(x, y, z, this.n);
      const made = this.#vertex(low[0] + x * size[0], low[1] + y * size[1], low[2] + z * size[2], node.level, node.type);
      if (colour !== undefined)
        this.hue.set([colour & 255, colour >> 8 & 255, colour >> 16, 0], 4 * made);
      return made;
    };
    const own = (v) => (numbers[v] < 0 ? numbers[v] = make(p.x[3 * v], p.x[3 * v + 1], p.x[3 * v + 2]) : numbers[v]);
    for (let f = 0; f < p.faces; f++)
      if (!seen[f])
        this.#polygon(p.onCellFace[f], p.first[f + 1] - p.first[f], (i) => own(p.corner[p.first[f] + i]));
      else
        for (const piece of seen[f]) {
          const axis = cellFaces.sideOf(p, f) >> 1, at = cellFaces.sideOf(p, f) & 1, corners = [];
          for (let i = 0; i < piece.length; i += 2) {
            const x = [at, at, at];
            x[(axis + 1) % 3] = piece[i];
            x[(axis + 2) % 3] = piece[i + 1];
            corners.push(make(...x));
          }
          this.#polygon(1, corners.length, (i) => corners[i]);
        }
  }

  #polygon(onCellFace, corners, number) {
    const first = number(0);
    for (let i = 1; i + 1 < corners; i++)
      this.#triangle(onCellFace, first, number(i), number(i + 1));
    for (let i = 0; this.wanted && i < corners; i++) {
      const a = number(i), b = number((i + 1) % corners);
      if (a < b || onCellFace)
        this.#addLine(a, b);
    }
  }

  // --- real faces ---

  // Adds the faces that this leaf draws. Corners of a tile with equal position, normal, level and colour share a vertex.
  #addFaces(leaf) {
    const { mesh } = this, type = leaf.type | REAL_FACE;
    this.chain = grown(this.chain, mesh.vertices);
    let count = 0;
    for (const face of leaf.mesh) {
      if (mesh.owner[face] !== leaf.id)
        continue;
      count++;
      const [a, b, c] = [0, 1, 2].map((k) => this.#corner(3 * face + k, leaf.level, type));
      this.#triangle(false, a, b, c);
      if (this.wanted)
        [[a, b], [b, c], [c, a]].forEach(([from, to]) => this.#addLine(from, to));
    }
    return count;
  }

  #corner(c, level, type) {
    const { mesh, n, older } = this, v = mesh.corner[c];
    mesh.cornerNormal(c, n);
    const length = Math.hypot(n[0], n[1], n[2]);
    for (let k = 0; k < 3; k++)
      n[k] = length > 0 ? n[k] / length : 0;
    const made = this.#vertex(mesh.position[3 * v], mesh.position[3 * v + 1], mesh.position[3 * v + 2], level, type);
    if (mesh.coloured) {
      this.hue.set(mesh.colour.subarray(3 * c, 3 * c + 3), 4 * made);
      this.hue[4 * made + 3] = 0;
    }
    for (let other = this.chain[v] - 1; other >= 0; other = older[other] - 1)
      if (this.normal[2 * other] === this.normal[2 * made] && this.normal[2 * other + 1] === this.normal[2 * made + 1] && this.tag[4 * other] === level &&
          this.#sameHue(other, made)) {
        this.vertices--;
        return other;
      }
    this.older = grown(this.older, made + 1);
    this.older[made] = this.chain[v];
    this.chain[v] = made + 1;
    return made;
  }

  #sameHue(a, b) {
    return [0, 1, 2, 3].every((k) => this.hue[4 * a + k] === this.hue[4 * b + k]);
  }

  #forget(leaf) {
    for (const face of leaf.mesh)
      for (let k = 0; k < 3; k++)
        this.chain[this.mesh.corner[3 * face + k]] = 0;
  }

  // --- cells ---

  #cells(nodes) {
    const position = new Float32Array(24 * 3 * nodes.length);
    let to = 0;
    for (const node of nodes) {
      const { low, size } = this.place(node);
      for (let axis = 0; axis < 3; axis++)
        for (let i = 0; i < 8; i++) { // four edges along each axis, with two ends each
          const end = i & 1, u = i >> 1 & 1, v = i >> 2, bit = [0, 0, 0];
          bit[axis] = end;
          bit[(axis + 1) % 3] = u;
          bit[(axis + 2) % 3] = v;
          for (let k = 0; k < 3; k++)
            position[to++] = low[k] + bit[k] * size[k];
        }
    }
    return position;
  }
}

/** Returns the sum of the area vectors of a polytope's plane polygons, [x, y, z, sum of their lengths], for a cell of this size. */
export function planeVector(p, size) {
  const sum = [0, 0, 0, 0], n = [0, 0, 0], at = (v, k) => p.x[3 * v + k] * size[k];
  for (let f = 0; f < p.faces; f++) {
    if (p.onCellFace[f])
      continue;
    const a = p.corner[p.first[f]];
    n[0] = n[1] = n[2] = 0;
    for (let i = p.first[f] + 1; i + 1 < p.first[f + 1]; i++) {
      const b = p.corner[i], c = p.corner[i + 1];
      for (let k = 0; k < 3; k++) {
        const u = (k + 1) % 3, v = (k + 2) % 3;
        n[k] += ((at(b, u) - at(a, u)) * (at(c, v) - at(a, v)) - (at(b, v) - at(a, v)) * (at(c, u) - at(a, u))) / 2;
      }
    }
    for (let k = 0; k < 3; k++)
      sum[k] += n[k];
    sum[3] += Math.hypot(...n);
  }
  return sum;
}
