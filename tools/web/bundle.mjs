// node bundle.mjs FOLDER: bundles and minifies the page into FOLDER; writes no other files.
//   index.html           with its style and boot.js
//   app.js               with three.js
//   worker.js
//   ebpo-view.wasm       the C library's reader
//   ebpo.wasm            loaded for queries
//   more.js, more.css    loaded after the first picture
//   together.js          loaded for several models
//   pairs_worker.js      with ebpo-collide.wasm, loaded for pairs of models
//   icon.svg
// Each file is also written compressed, with .gz after its name, for servers that send compressed files (nginx: gzip_static).
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { gzipSync } from 'node:zlib';
import { build, transform } from 'esbuild';
import { wasmFiles, withoutNode } from './for_browsers.mjs';

const [folder] = process.argv.slice(2), here = import.meta.dirname ?? new URL('.', import.meta.url).pathname;
const TARGET = 'es2022';
const read = (name) => readFileSync(join(here, name), 'utf8');
const small = async (name, loader) => (await transform(read(name), { loader, minify: true, target: TARGET })).code.trim();

// The replacement is given as a function, so that `$&` in the text has no special meaning.
function replace(page, from, to) {
  if (page.split(from).length !== 2)
    throw new Error(`index.html: expected ${from} exactly once`);
  return page.replace(from, () => to);
}

let page = read('index.html');
page = replace(page, '<link rel="stylesheet" href="style.css">', `<style>${await small('style.css', 'css')}</style>`);
page = replace(page, '<script src="boot.js"></script>', `<script>${await small('boot.js', 'js')}</script>`);
page = replace(page, 'ebpo/ebpo-view.wasm', 'ebpo-view.wasm');
page = replace(page, /<script type="importmap">[^]*?<\/script>\n/.exec(page)[0], '');

const common = { outdir: folder, bundle: true, minify: true, format: 'esm', target: TARGET, legalComments: 'eof', write: false, logLevel: 'warning' };
// Modules that are loaded later import shared modules from app.js. A second copy would have separate state and a second three.js.
const fromApp = { name: 'from-app', setup: ({ onResolve }) => onResolve({ filter: /\/(state|scene|shade)\.js$/ }, () => ({ path: './app.js', external: true })) };
const built = await Promise.all([
  build({ ...common, entryPoints: ['app.js', 'worker.js', 'together/pairs_worker.js'].map((name) => join(here, name)), external: ['./together.js'], plugins: [withoutNode] }),
  build({ ...common, entryPoints: ['more.js', 'together.js', 'more.css'].map((name) => join(here, name)), plugins: [fromApp, withoutNode] }),
]);
const files = new Map([['index.html', Buffer.from(page)], ['icon.svg', Buffer.from(read('icon.svg'))], ...wasmFiles({ pairs: true }),
  ...built.flatMap(({ outputFiles }) => outputFiles).map((f) => [f.path.slice(f.path.lastIndexOf('/') + 1), Buffer.from(f.contents)])]);
mkdirSync(folder, { recursive: true });
for (const [name, bytes] of files) {
  writeFileSync(join(folder, name), bytes);
  writeFileSync(join(folder, `${name}.gz`), gzipSync(bytes, { level: 9 }));
}
