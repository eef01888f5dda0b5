// One budget of triangles for several models, by how much of the picture they may fill. No DOM, no WebGL.
const PIXELS_MOST = 1000; // half a picture: nearer is not more
const LEAST = 500;        // triangles of a model that is out of sight, or small

/** How large a model is in a view (lookOf() of shade.js): the square of half its box' diagonal in pixels; 0 out of sight. */
export function weightOf({ eye, planes, pixels }) {
  if (planes.some((p) => p[3] < -1)) // in its own coordinates the model is within 1 of the origin
    return 0;
  return Math.min(PIXELS_MOST, pixels / Math.max(1, Math.hypot(...eye))) ** 2;
}

/**
 * Triangles for each copy of some models: [{ weight (of all its copies together), copies (that are seen), faces (of the model: more are of no use) }]. Shares go by weight; what one
 * model cannot use the others get.
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
