// Reads levels of a file by URL, with one of two readers: { reader, url, to } -> { first, last, ms, values }. Reads all arrays of the levels.
self.onmessage = async ({ data }) => {
  try {
    self.postMessage(await ({ ours, h5wasm }[data.reader])(data));
  } catch (error) {
    self.postMessage({ failed: String(error?.message ?? error) });
  }
};

async function ours({ url, to, whole }) {
  const { openView, viewModule } = await import('/viewer/ebpo/view.js'), { open } = await import('/viewer/ebpo/index.js');
  await viewModule();
  const begin = performance.now(), count = (parts) => parts.reduce((sum, { planes }) => sum + planes.length, 0);
  if (whole) {
    const model = await open(url);
    let values = (await model.mesh()).faces.length;
    for await (const level of model.levels())
      values += count([level]);
    return { ms: performance.now() - begin, values };
  }
  const view = await openView(url), levels = (from) => view.nodes(Array.from({ length: to - from + 1 }, (_, i) => ({ level: from + i, part: -1 })));
  let values = count(await view.nodes([{ level: 0, part: -1 }]));
  const first = performance.now() - begin;
  if (to > 0)
    values += count(await levels(1));
  return { first, ms: performance.now() - begin, values };
}

async function h5wasm({ url, to, whole }) {
  const { default: library } = await import('/modules/h5wasm/dist/esm/hdf5_hl.js');
  const module = await library.ready;
  const { install_plugins: install } = await import('/modules/h5wasm-plugins/index.mjs');
  await install(module, ['zstd']);
  const begin = performance.now();
  module.FS.createLazyFile('/', 'model.h5', url, true, false);
  const file = new library.File('/model.h5', 'r');
  let first, values = 0;
  const take = (group) => group.keys().forEach((key) => {
    const item = group.get(key);
    values += item instanceof library.Dataset ? item.value.length : (take(item), 0);
  });
  const read = (level) => take(file.get(`levels/${String(level).padStart(2, '0')}`));
  if (whole) {
    take(file);
  } else {
    read(0);
    first = performance.now() - begin;
    for (let level = 1; level <= to; level++)
      read(level);
  }
  return { first, ms: performance.now() - begin, values };
}
