// Estimates which nodes are hidden behind nearer nodes and need not be fetched. Uses a coarse picture: the covered tiles of the view and their depths.
// The test of visibility is not exact, because an error only delays fetching, or leaves a part coarser.
const ACROSS = 48, DOWN = 32;
const COVERED = 0.8; // a tile counts as covered when nodes cover so much of its area
const PARALLEL = 1e-5; // in a view that is narrower at distance 1, as those of orthographic cameras are, nothing counts as hidden

const dot = (p, [x, y, z, w]) => x * p[0] + y * p[1] + z * p[2] + w;

export class Hidden {
  /** `view`: as for Cut.update(); `place(node)`: returns { center, radius } in the view's coordinates. */
  constructor(view, nodes, place) {
    Object.assign(this, { view, place });
    if (view.planes.length !== 4)
      return;
    const [a, b] = view.planes.slice(2), across = this.#opening(0), down = this.#opening(2);
    if (!(Math.min(across, down) > PARALLEL))
      return;
    this.forward = Math.hypot(...[0, 1, 2].map((k) => view.planes[0][k] + view.planes[1][k]));
    this.tileArea = (across / ACROSS) * (down / DOWN); // at distance 1
    this.depth = new Float64Array(ACROSS * DOWN).fill(Infinity);
    const cover = new Float64Array(ACROSS * DOWN), seen = nodes.map((node) => this.#see(node)).filter((s) => s && dot(s.center, a) + dot(s.center, b) > 0);
    for (const s of seen.sort((x, y) => x.distance - y.distance))
      this.#tiles(s, (tile, share) => {
        cover[tile] += share;
        if (cover[tile] >= COVERED && this.depth[tile] === Infinity)
          this.depth[tile] = s.distance + 2 * s.radius;
        return true;
      });
  }

  // Returns the view's width or height at distance 1, from two opposite planes.
  #opening(i) {
    const [a, b] = this.view.planes.slice(i, i + 2), cos = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return 2 * Math.tan((Math.PI - Math.acos(Math.max(-1, Math.min(1, cos)))) / 2);
  }

  #see(node) {
    const { center, radius } = this.place(node), { eye, planes } = this.view, [l, r, t, b] = planes.map((p) => dot(center, p));
    const distance = Math.hypot(center[0] - eye[0], center[1] - eye[1], center[2] - eye[2]);
    return l + r > 0 && t + b > 0 ? { center, radius, distance, depth: (l + r) / this.forward, u: l / (l + r) * ACROSS, v: t / (t + b) * DOWN } : undefined;
  }

  // Calls `each` with each tile that a node's surface may cover, and the covered share of the tile. Stops when `each` returns false.
  #tiles({ radius, depth, u, v }, each) {
    const edge = 2 * radius / Math.sqrt(3) / Math.max(depth, radius), area = edge * edge / this.tileArea, half = Math.sqrt(area) / 2;
    const from = [Math.max(0, Math.floor(u - half)), Math.max(0, Math.floor(v - half))], to = [Math.min(ACROSS - 1, Math.floor(u + half)), Math.min(DOWN - 1, Math.floor(v + half))];
    const share = Math.min(1, area / Math.max(1, (Math.floor(u + half) - Math.floor(u - half) + 1) * (Math.floor(v + half) - Math.floor(v - half) + 1)));
    for (let y = from[1]; y <= to[1]; y++)
      for (let x = from[0]; x <= to[0]; x++)
        if (!each(y * ACROSS + x, share))
          return false;
    return true;
  }

  /** Returns true when the whole node is behind nodes that cover its part of the view. */
  has(node) {
    const s = this.depth && this.#see(node);
    return Boolean(s) && s.distance > s.radius && this.#tiles(s, (tile) => this.depth[tile] < s.distance - s.radius);
  }
}
