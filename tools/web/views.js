// Saved views as a file, to be sent with a model: JSON { ebpo_views: '1.0', model_sha256, model_name, views: [{ name, query }] }; `query` is what the page's address says of
// the view. No DOM.
const OF_A_VIEW = ['view', 'level', 'clip', 'box', 'point', 'measure', 'colour', 'walls', 'detail'];
const VIEWS_MOST = 1000, NAME_MOST = 100, QUERY_MOST = 20_000, BYTES_MOST = 1 << 22;

/** What an address says of the view alone: neither the file nor what else is in it. */
export function viewOf(address) {
  const all = new URL(address, 'https://localhost/').searchParams, own = new URLSearchParams(OF_A_VIEW.filter((name) => all.has(name)).map((name) => [name, all.get(name)]));
  return `?${own}`;
}

const fits = (v) => typeof v?.name === 'string' && v.name.trim() !== '' && typeof v?.query === 'string' && v.query.length <= QUERY_MOST;

/** A list of views with others behind it; those that are there already are left out, as is what is no view. */
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

/** A file's views; throws an Error that says what is wrong. */
export function readViews(text, digest) {
  let file;
  try {
    file = text.length <= BYTES_MOST ? JSON.parse(text) : undefined;
  } catch { /* said below */ }
  if (!/^1\.\d+$/.test(file?.ebpo_views ?? '') || !Array.isArray(file.views))
    throw new Error('this is no file of views; open one that the viewer has saved, or a paint file by Open in the section Paint');
  if (file.model_sha256 !== digest)
    throw new Error(`these views are of ${typeof file.model_name === 'string' ? `"${file.model_name.slice(0, NAME_MOST)}"` : 'another model'}, not of the open one; open that model first`);
  return file.views;
}
