// Reads and writes files of saved views: JSON { ebpo_views: '1.0', model_sha256, model_name, views: [{ name, query }] }. `query` is the part of the page's address
// that describes the view. Uses no DOM.
const OF_A_VIEW = ['view', 'level', 'clip', 'box', 'point', 'measure', 'colour', 'cell-faces', 'detail'];
const VIEWS_MOST = 1000, NAME_MOST = 100, QUERY_MOST = 20_000, BYTES_MOST = 1 << 22;

/** Returns the query of an address with only the parameters of the view. */
export function viewOf(address) {
  const all = new URL(address, 'https://localhost/').searchParams, own = new URLSearchParams(OF_A_VIEW.filter((name) => all.has(name)).map((name) => [name, all.get(name)]));
  return `?${own}`;
}

const fits = (v) => typeof v?.name === 'string' && v.name.trim() !== '' && typeof v?.query === 'string' && v.query.length <= QUERY_MOST;

/** Returns a list of views with other views appended. Omits duplicates and invalid views. */
export function mergedViews(list, others) {
  const out = [...list];
  for (const v of Array.isArray(others) ? others.filter(fits) : []) {
    const view = { name: v.name.trim().slice(0, NAME_MOST), query: viewOf(v.query) };
    if (out.length < VIEWS_MOST && !out.some((o) => o.name === view.name && o.query === view.query))
      out.push(view);
  }
  return out;
}

export const writeViews = (views, digest, name) => `${JSON.stringify({ ebpo_views: '1.0', model_sha256: digest, model_name: name, views }, undefined, 1)}\n`;

/** Returns the views of a file. Throws an Error for invalid files and for views of another model. */
export function readViews(text, digest) {
  let file;
  try {
    file = text.length <= BYTES_MOST ? JSON.parse(text) : undefined;
  } catch { /* reported below */ }
  if (!/^1\.\d+$/.test(file?.ebpo_views ?? '') || !Array.isArray(file.views))
    throw new Error('not a file of saved views; open a file that the viewer has saved, or open a paint file by Open in the section Paint');
  if (file.model_sha256 !== digest)
    throw new Error(`these views belong to ${typeof file.model_name === 'string' ? `"${file.model_name.slice(0, NAME_MOST)}"` : 'another model'}, not to the open one; open that model first`);
  return file.views;
}
