// Reads levels of a file by URL, with one of two readers: { reader, url, to } -> { first, last, ms, values }. Reads all arrays of the levels.
self.onmessage = async ({ data }) => {
  try {
    self.postMessage(await ({ ours, h5wasm }[data.reader])(data));
  } catch (error) {
    self.postMessage({ failed: String(error?.message ?? error) });
  }
};

async function ours({ url, to, whole }) {
  const { openEbpo, loadZstd } = await import('/viewer/reader/index.js');
  const { ZSTDDecoder } = await import('/viewer/node_modules/zstddec/dist/zstddec.mjs');
  const zstd = await loadZstd(ZSTDDecoder);
  const begin = performance.now();
  const file = await openEbpo(url, { zstd });
  let first, values = 0;
  const add = (levels) => levels.forEach((level) => (values += level.planes?.length ?? 0));
  if (whole) {
    add(await file.levels(0, file.info.level_count - 1));
    values += (await file.mesh()).faces.length;
  } else {
    add(await file.levels(0, 0));
    first = performance.now() - begin;
    if (to > 0)
      add(await file.levels(1, to));
  }
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
