// A stroke while it is made: points along the pen's way on the picture, close enough to each other, and then their places on the faces.

const APART = 0.45;          // of a point's own radius, between neighbours
const LIGHTEST = 0.2;        // the least size, at no pressure
const FULL_SIZE = 32768, FULL_PRESSURE = 65535;
const PIECES_MOST = 64;      // between two places of the pen

export class Stroke {
  /** `pick(x, y)`: the point of the model seen at a pixel; `pixels(point)`: how many pixels of the page the model's unit is there. */
  constructor({ layer, erases, colour, radius }, { pick, pixels }) {
    Object.assign(this, { layer, erases, colour: erases ? [0, 0, 0, 0] : colour, radius, pick, pixels });
    this.time = Date.now();
    this.points = [];
  }

  /** The pen is at a pixel, with a pressure of 0 to 1. Returns how many points are new. */
  to(x, y, pressure, light) {
    const share = light ? LIGHTEST + (1 - LIGHTEST) * Math.sqrt(pressure) : 1, before = this.points.length, from = this.last;
    this.last = { x, y, share };
    if (!from) {
      this.#add(x, y, pressure, share);
      return this.points.length - before;
    }
    const way = Math.hypot(x - from.x, y - from.y), at = this.points.at(-1), step = at ? Math.max(1, APART * this.radius * Math.min(share, from.share) * this.pixels(at.place)) : 4;
    const pieces = Math.min(PIECES_MOST, Math.floor(way / step));
    if (pieces === 0) {
      this.last = from; // not far enough yet
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

  /** As a document has it, its points being where the worker says; those that are farther from all faces than their own radius are left out. */
  settled(places) {
    const points = this.points.map((p, i) => ({ ...p, ...places[i] })).filter((p) => p.distance <= this.radius * p.size / FULL_SIZE);
    return { layer: this.layer, erases: this.erases, colour: this.colour, radius: this.radius, time: this.time,
      points: points.map(({ face, weights, place, size, pressure, time, normal }) => ({ face, weights, place, size, pressure, time, normal })) };
  }
}

