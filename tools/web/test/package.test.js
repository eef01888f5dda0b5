// Tests the npm package as another project uses it: packs, unpacks and bundles it for browsers without warnings about Node.js.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';

const here = join(import.meta.dirname ?? new URL('.', import.meta.url).pathname, '..');
const esbuild = existsSync(join(here, 'node_modules/esbuild')) && spawnSync('npm', ['--version']).status === 0 ? await import('esbuild') : undefined;

test('the package is packed, bundled for browsers, and has types for its exports', { skip: esbuild ? false : 'esbuild or npm is not installed' }, async (t) => {
  const work = mkdtempSync(join(tmpdir(), 'ebpo-package-')), project = join(work, 'project'), own = join(project, 'node_modules/ebpo-viewer');
  t.after(() => rmSync(work, { recursive: true, force: true }));
  execFileSync(process.execPath, [join(here, 'package.mjs'), join(work, 'package')]);
  execFileSync('npm', ['pack', '--silent', '--offline', '--pack-destination', work], { cwd: join(work, 'package'), stdio: ['ignore', 'pipe', 'inherit'] });
  mkdirSync(own, { recursive: true });
  execFileSync('tar', ['-xzf', join(work, readdirSync(work).find((name) => name.endsWith('.tgz'))), '-C', own, '--strip-components', '1']);
  symlinkSync(join(here, 'node_modules/three'), join(project, 'node_modules/three'));
  assert.ok(['element.d.ts', 'three.d.ts', 'worker.js', 'ebpo-view.wasm', 'ebpo.wasm', 'README.md', 'LICENSE'].every((name) => existsSync(join(own, name))));

  writeFileSync(join(project, 'main.js'), `import { EbpoViewerElement } from 'ebpo-viewer'; import { EbpoModel, standardMaterial } from 'ebpo-viewer/three';
    import { Object3D } from 'three';
    globalThis.all = [EbpoViewerElement, standardMaterial, new EbpoModel() instanceof Object3D];`);
  const { outputFiles, warnings } = await esbuild.build({ entryPoints: [join(project, 'main.js')], bundle: true, format: 'esm', platform: 'browser', write: false, logLevel: 'silent' });
  assert.deepEqual(warnings, []);
  const text = outputFiles[0].text;
  assert.doesNotMatch(text, /(from|import\()\s*["']node:/);
  assert.equal(text.match(/\bWebGLRenderer = class\b|class WebGLRenderer\b/g)?.length ?? 0, 1, 'three.js is there once');
  assert.doesNotMatch(readFileSync(join(own, 'worker.js'), 'utf8'), /(from|import\()\s*["'](node:|three|\.\/ebpo)/);

  // Each exported name has a declared type, and each declared value is exported.
  for (const part of ['element', 'three']) {
    const { metafile } = await esbuild.build({ entryPoints: [join(own, `${part}.js`)], metafile: true, bundle: true, external: ['three', 'three/*'], format: 'esm', write: false, outdir: work });
    const [{ exports: exported }] = Object.values(metafile.outputs);
    const types = readFileSync(join(own, `${part}.d.ts`), 'utf8');
    const declared = [...types.matchAll(/^export declare (?:const|function|class) ([^;(<{]+)/gm)].flatMap((m) => m[1].replace(/ (extends|implements) .*/,
      '').split(',').map((name) => name.split(':')[0].trim()));
    assert.deepEqual(declared.filter((name, i, all) => all.indexOf(name) === i).sort(), exported.sort(), part);
  }
});
