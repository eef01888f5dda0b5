// node package.mjs FOLDER: writes the npm package "ebpo-viewer" into FOLDER, for npm pack or npm publish; writes no other files. The package contains the
// element and the three.js object, each as one module with its types; the worker with its dependencies; and package.json. It does not contain three.js.
import { copyFileSync, mkdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { build } from 'esbuild';
import { wasmFiles, withoutNode } from './for_browsers.mjs';

const [folder] = process.argv.slice(2), here = import.meta.dirname ?? new URL('.', import.meta.url).pathname;
const { version, license, description, dependencies } = JSON.parse(readFileSync(join(here, 'package.json'), 'utf8'));
const PARTS = { element: 'element.js', three: 'model.js' };

rmSync(folder, { recursive: true, force: true });
mkdirSync(folder, { recursive: true });
const common = { bundle: true, format: 'esm', target: 'es2022', platform: 'browser', legalComments: 'eof', logLevel: 'warning', outdir: folder };
await build({ ...common, entryPoints: Object.fromEntries(Object.entries(PARTS).map(([name, file]) => [name, join(here, file)])), splitting: true, chunkNames: 'common-[hash]',
  external: ['three', 'three/*'] });
await build({ ...common, entryPoints: [join(here, 'worker.js')], minify: true, plugins: [withoutNode] });
for (const name of Object.keys(PARTS))
  copyFileSync(join(here, 'types', `${name}.d.ts`), join(folder, `${name}.d.ts`));
for (const [name, bytes] of wasmFiles())
  writeFileSync(join(folder, name), bytes);
copyFileSync(join(here, 'types/README.md'), join(folder, 'README.md'));
copyFileSync(join(here, '../../LICENSE'), join(folder, 'LICENSE'));

const way = (name) => ({ types: `./${name}.d.ts`, default: `./${name}.js` });
writeFileSync(join(folder, 'package.json'), JSON.stringify({
  name: 'ebpo-viewer', version, description, license, type: 'module', keywords: ['ebpo', 'octree', 'level of detail', 'mesh', 'three', 'viewer', 'web component'],
  types: './element.d.ts', exports: { '.': way('element'), './three': way('three'), './worker.js': './worker.js', './package.json': './package.json' },
  files: ['*.js', '*.d.ts', '*.wasm'], sideEffects: ['./element.js'], peerDependencies: { three: `>=${dependencies.three}` },
}, null, 2) + '\n');
