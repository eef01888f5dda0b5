// A stroke during drawing: closely spaced points along the path of the pen in the picture, and later their positions on the faces.

const APART = 0.45;          // distance of neighbouring points, in radii of the smaller one
const LIGHTEST = 0.2;        // size of a point without pressure, relative to its size at full pressure
const FULL_SIZE = 32768, FULL_PRESSURE = 65535;
const PIECES_MOST = 64;      // most points between two positions of the pen

export class Stroke {
  /** `pick(x, y)`: returns the visible point of the model at a pixel; `pixels(point)`: returns the size of the model's unit at a point, in pixels of the page. */
  constructor({ layer, erases, colour, radius }, { pick, pixels }) {
    Object.assign(this, { layer, erases, colour: erases ? [0, 0, 0, 0] : colour, radius, pick, pixels });
    this.time = Date.now();
    this.points = [];
  }

  /** Moves the pen to a pixel, with a pressure of 0 to 1. `light`: the pressure scales the point's size. Returns the number of new points. */
  to(x, y, pressure, light) {
    const share = light ? LIGHTEST + (1 - LIGHTEST) * Math.sqrt(pressure) : 1, before = this.points.length, from = this.last;
    this.last = { x, y, share };
    if (!from) {
      this.#add(x, y, pressure, share);
      return this.points.length - before;
    }
    const moved = Math.hypot(x - from.x, y - from.y), at = this.points.at(-1), step = at ? Math.max(1, APART * this.radius * Math.min(share, from.share) * this.pixels(at.place)) : 4;
    const pieces = Math.min(PIECES_MOST, Math.floor(moved / step));
    if (pieces === 0) {
      this.last = from; // the pen has not moved far enough
      return 0;
    }
    for (let i = 1; i <= pieces; i++)
      this.#add(from.x + (x - from.x) * i / pieces, from.y + (y - from.y) * i / pieces, pressure, from.share + (share - from.share) * i / pieces);
    return this.points.length - before;
  }

  #add(x, y, pressure, share) {
    const place = this.pick(x, y);
    if (place)
      this.points.push({ place, size: Math.max(1, Math.round(share * FULL_SIZE)), pressure: Math.round(pressure * FULL_PRESSURE), time: Math.min(2 ** 32 - 1, Date.now() - this.time) });
  }

  /** Returns the stroke for a document, with the positions from the worker. Omits points whose distance from all faces is greater than their radius. */
  settled(places) {
    const points = this.points.map((p, i) => ({ ...p, ...places[i] })).filter((p) => p.distance <= this.radius * p.size / FULL_SIZE);
    return { layer: this.layer, erases: this.erases, colour: this.colour, radius: this.radius, time: this.time,
      points: points.map(({ face, weights, place, size, pressure, time, normal }) => ({ face, weights, place, size, pressure, time, normal })) };
  }
}

