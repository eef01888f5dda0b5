// Evaluates queries of the page in the worker by the package "ebpo": points, positions on faces for painting and measuring, and sections of the real faces.
import { open } from './ebpo/index.js';
import { EbpoError } from './error.js';
import { errorOf } from './model_file.js';

const ONE_WEIGHT = 2 ** 30;     // format-spec/paint.md
const TILES = 4;                // a section is computed in so many rows and columns, with progress between them
const FACES_MOST = 4_000_000;   // in a section
const OFF = 2 ** -30;           // distance of a computed position from its face, in diagonals, is less than this
const WHERE = ['out', 'in', 'on', 'maybe'];

/** The queries of an open model (model_file.js). The large module of the package is loaded with the first query. */
export class Queries {
  #opening;

  constructor(file) {
    this.file = file;
    this.info = file.info;
  }

  /** Calls use(model) with the package's model. */
  async with(use) {
    this.#opening ??= open(this.file.kept).catch((error) => {
      this.#opening = undefined; // the next query tries again
      throw error;
    });
    try {
      return await use(await this.#opening);
    } catch (error) {
      throw errorOf(error, this.file.source.name);
    }
  }

  /** Returns what levels 0 to `level` say of a point: { where, lo, hi }, bounds of the distance. `where` is undefined for surfaces. */
  coarse(point, level) {
    return this.with(async (model) => {
      const { lo, hi } = await model.distance(point, { level, unsigned: true });
      return { where: this.info.solid ? WHERE[(await model.inside(point, { level })).where[0]] : undefined, lo: lo[0], hi: hi[0] };
    });
  }

  /** Returns { where, distance, nearest, face } of a point, computed exactly. `where` is undefined for surfaces. */
  exact(point) {
    return this.with(async (model) => {
      const { distance, point: nearest, face } = await model.distance(point, { unsigned: true });
      return { where: this.info.solid ? WHERE[(await model.inside(point)).where[0]] : undefined, distance: distance[0], nearest: [...nearest], face: face[0] };
    });
  }

  /** Returns the first point of the faces on a ray, or undefined. `ray`: origin and direction, six numbers. */
  hit(ray) {
    return this.with(async (model) => {
      const { t } = await model.rays(ray);
      return Number.isFinite(t[0]) ? [0, 1, 2].map((k) => ray[k] + t[0] * ray[3 + k]) : undefined;
    });
  }

  close() {
    this.#opening?.then((model) => model.dispose(), () => {});
  }
}

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]], dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Returns the barycentric weights of a triangle's second and third corner at a point of the triangle, in units of 2^-30. `corners`: nine numbers. */
export function weightsOf(p, corners) {
  const a = corners.subarray(0, 3), u = sub(corners.subarray(3, 6), a), v = sub(corners.subarray(6, 9), a), w = sub(p, a);
  const uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v), area = uu * vv - uv * uv;
  if (!(area > 0)) // the triangle is a segment or a point: weights along its longer side
    return uu >= vv ? [unit(uu > 0 ? wu / uu : 0), 0] : [0, unit(wv / vv)];
  const second = unit((vv * wu - uv * wv) / area);
  return [second, Math.min(ONE_WEIGHT - second, unit((uu * wv - uv * wu) / area))];
}
const unit = (x) => Math.round(Math.min(1, Math.max(0, x)) * ONE_WEIGHT);

/**
 * Returns the nearest positions on the faces: [{ face, weights, place, normal, distance }]. `face` is the number that paint files use. The file must have the part
 * `mesh`.
 */
export function positionsOf(queries, points) {
  const near = OFF * Math.hypot(...queries.info.box_size);
  return queries.with(async (model) => {
    const { distance, point, face: faces } = await model.distance(points.flat(), { unsigned: true }), out = [];
    for (const [i, face] of faces.entries()) {
      const place = [...point.subarray(3 * i, 3 * i + 3)], around = await model.boxTriangles(place.map((x) => x - near), place.map((x) => x + near)), k = around.face.indexOf(face);
      if (k < 0)
        throw new EbpoError('ABSENT', `${queries.file.source.name}: the file has no face at this point`);
      const own = around.corners.subarray(9 * k, 9 * k + 9);
      out.push({ face, weights: weightsOf(place, own), place, normal: normalOf(own), distance: distance[i] });
    }
    return out;
  });
}

/** Returns the unit normal of a triangle; 0 without an area. */
export function normalOf(corners) {
  const a = corners.subarray(0, 3), n = cross(sub(corners.subarray(3, 6), a), sub(corners.subarray(6, 9), a)), size = Math.hypot(...n);
  return n.map((x) => (size > 0 ? x / size : 0));
}

/**
 * Cuts faces (nine numbers each) by a plane across an axis. Adds segments [u, v, u, v] to `out`, where u and v are coordinates on the two axes after `axis`.
 * Seen from the axis' upper end, the interior of a closed mesh is on the left of each segment. Corners on the plane count as above the plane, so that
 * outlines are closed.
 */
export function cutFaces(faces, axis, at, out) {
  const u = (axis + 1) % 3, v = (axis + 2) % 3, crossing = (low, high) => { // from below to above, so that both faces of an edge compute the same point
    const t = (at - faces[low + axis]) / (faces[high + axis] - faces[low + axis]);
    return [faces[low + u] + t * (faces[high + u] - faces[low + u]), faces[low + v] + t * (faces[high + v] - faces[low + v])];
  };
  for (let f = 0; f < faces.length; f += 9) {
    const above = [0, 3, 6].map((c) => faces[f + c + axis] >= at);
    if (above[0] === above[1] && above[1] === above[2])
      continue;
    let up, down;
    for (let c = 0; c < 3; c++) {
      const next = (c + 1) % 3;
      if (!above[c] && above[next])
        up = crossing(f + 3 * c, f + 3 * next);
      else if (above[c] && !above[next])
        down = crossing(f + 3 * next, f + 3 * c);
    }
    out.push(...down, ...up);
  }
}

/** Returns { area, length } of segments from cutFaces(). The area is the integral of the winding number. */
export function measureOf(segments) {
  const [u, v] = segments; // an origin near the segments reduces rounding errors
  let area = 0, length = 0;
  for (let i = 0; i < segments.length; i += 4) {
    const [a, b, c, d] = [segments[i] - u, segments[i + 1] - v, segments[i + 2] - u, segments[i + 3] - v];
    area += (a * d - b * c) / 2;
    length += Math.hypot(c - a, d - b);
  }
  return { area, length };
}

/**
 * Computes the section of the real faces by a plane across an axis, in the model's coordinates. Calls `emit` repeatedly with the progress { looked, of }, and at
 * the end with { segments, area, length, faces, partial } or { fault }. `area` is present only for solids. `partial`: the file is a subset and lacks part of
 * the section.
 */
export async function sectionOf(queries, axis, at, emit, ended) {
  const { info } = queries, seen = new Set(), segments = [], u = (axis + 1) % 3, v = (axis + 2) % 3;
  if (!info.parts.has('mesh')) {
    emit({ fault: 'the file has no faces; convert it with its mesh' });
    return;
  }
  const bound = (k, i) => info.box_origin[k] + i / TILES * info.box_size[k];
  let partial = false;
  for (let tile = 0; tile < TILES * TILES && !ended(); tile++) {
    const low = [at, at, at], high = [at, at, at], i = tile % TILES, j = Math.floor(tile / TILES);
    [low[u], high[u], low[v], high[v]] = [bound(u, i), bound(u, i + 1), bound(v, j), bound(v, j + 1)];
    const { face, corners } = await queries.with((model) => model.boxTriangles(low, high, { most: FACES_MOST })).catch((error) => {
      if (error.code !== 'ABSENT')
        throw error;
      partial = true;
      return { face: [], corners: [] };
    });
    const fresh = [];
    face.forEach((number, k) => {
      if (!seen.has(number))
        fresh.push(...corners.subarray(9 * k, 9 * k + 9));
      seen.add(number);
    });
    cutFaces(fresh, axis, at, segments);
    if (seen.size > FACES_MOST) {
      emit({ fault: `the section intersects more than ${FACES_MOST / 1e6} million faces; cut a part of the model out with ebpo subset` });
      return;
    }
    emit({ looked: tile + 1, of: TILES * TILES });
  }
  if (!ended()) {
    const { area, length } = segments.length ? measureOf(segments) : { area: 0, length: 0 };
    emit({ segments: Float64Array.from(segments), area: info.solid ? area : undefined, length, faces: segments.length / 4, partial });
  }
}
