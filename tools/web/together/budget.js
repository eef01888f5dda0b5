// Distributes a budget of triangles among several models by their size in the picture. Uses neither DOM nor WebGL.
const PIXELS_MOST = 1000; // limit of the size: about half a picture
const LEAST = 500;        // least number of triangles of a model, also when it is out of sight

/** Returns the weight of a model in a view (lookOf() of shade.js): the square of half its box's diagonal in pixels, or 0 when the model is out of sight. */
export function weightOf({ eye, planes, pixels }) {
  if (planes.some((p) => p[3] < -1)) // in the coordinates of the view, the model is within a distance of 1 from the origin
    return 0;
  return Math.min(PIXELS_MOST, pixels / Math.max(1, Math.hypot(...eye))) ** 2;
}

/**
 * Returns the number of triangles for each copy of each model. `models`: [{ weight (sum over its copies), copies (number of visible copies), faces (most triangles
 * that the model can use) }]. Shares are proportional to weights. Triangles that a model cannot use are distributed among the other models.
 */
export function sharesOf(total, models) {
  const out = models.map(() => LEAST);
  let open = models.map((m, i) => ({ ...m, i })).filter((m) => m.weight > 0 && m.copies > 0), rest = total;
  while (open.length) {
    const sum = open.reduce((s, m) => s + m.weight, 0), share = (m) => rest * m.weight / sum / m.copies, full = open.filter((m) => share(m) >= m.faces);
    if (!full.length) {
      open.forEach((m) => (out[m.i] = Math.max(LEAST, Math.floor(share(m)))));
      break;
    }
    full.forEach((m) => {
      out[m.i] = m.faces;
    });
    rest = Math.max(0, rest - full.reduce((s, m) => s + m.faces * m.copies, 0));
    open = open.filter((m) => !full.includes(m));
  }
  return out;
}
