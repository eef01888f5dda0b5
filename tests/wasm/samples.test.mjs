// Runs the samples with the packed and installed package, and compares picking with three's own. Skipped without the
// viewer's packages or Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, symlinkSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import test, { after } from 'node:test';
import { pathToFileURL } from 'node:url';

const { EBPO_PACKAGE: folder, EBPO_FILES: files = '', EBPO_ROOT: root, EBPO_VECTORS: vectors } = process.env;
const packages = join(root, 'tools/web/node_modules'), three = join(packages, 'three/build/three.module.js'), playwright = join(packages, 'playwright-core/index.mjs');
const browser = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
const file = files.split(' ').filter(Boolean).sort((a, b) => statSync(a).size - statSync(b).size)[0] ?? join(vectors, 'passed/06_four_levels_leaf_planes.ebpo.h5');
const work = mkdtempSync(join(tmpdir(), 'ebpo-samples-'));
after(() => rmSync(work, { recursive: true }));

/** Packs the package, and installs it in a new project of Node. */
function makeProject() {
  const project = join(work, 'project');
  if (existsSync(project))
    return project;
  mkdirSync(project);
  const npm = (...args) => execFileSync('npm', [...args, '--offline', '--no-audit', '--no-fund'], { cwd: project, encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'] });
  npm('pack', folder, '--pack-destination', work);
  npm('init', '-y');
  npm('install', join(work, readdirSync(work).find((name) => name.endsWith('.tgz'))));
  for (const name of ['million_points.mjs', 'three_page.html'])
    copyFileSync(join(root, 'samples', name), join(project, name));
  copyFileSync(file, join(project, 'model.ebpo.h5'));
  return project;
}

test('a packed and installed package evaluates a million points', () => {
  const out = execFileSync(process.execPath, ['million_points.mjs', 'model.ebpo.h5'], { cwd: makeProject(), encoding: 'utf8' });
  assert.match(out, /^1000000 distances in [\d.]+ s/);
});

test("intersections of three's Raycaster are those of its meshes", { skip: !existsSync(three) && 'three is missing' }, async () => {
  const THREE = await import(pathToFileURL(three)), { open } = await import(pathToFileURL(join(folder, 'index.js'))), { raycastOf } = await import(pathToFileURL(join(folder, 'three.js')));
  const model = await open(readFileSync(file)), { origin, size } = model.info, mesh = await model.mesh(), geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(Float32Array.from(mesh.vertices), 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.faces, 1));
  const longest = Math.max(...size), centre = new THREE.Vector3(...origin.map((x, k) => x + size[k] / 2));
  let state = 9, hits = 0, others = 0;
  const next = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32, vector = () => new THREE.Vector3(next() - 0.5, next() - 0.5, next() - 0.5);
  for (let i = 0; i < 300; i++) {
    const object = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ side: [THREE.FrontSide, THREE.BackSide, THREE.DoubleSide][i % 3] }));
    object.position.copy(vector().multiplyScalar(3 * longest));
    object.rotation.set(6 * next(), 6 * next(), 6 * next());
    object.scale.set(0.5 + next(), 0.5 + next(), 0.5 + next());
    object.updateMatrixWorld();
    const goal = centre.clone().addScaledVector(vector(), longest / 2).applyMatrix4(object.matrixWorld), from = goal.clone().addScaledVector(vector().normalize(), 2 * longest);
    const raycaster = new THREE.Raycaster(from, goal.clone().sub(from).normalize(), i % 2 ? next() * longest : 0, i % 5 ? Infinity : 2 * longest);
    const expected = raycaster.intersectObject(object);
    object.raycast = raycastOf(model);
    const found = raycaster.intersectObject(object);
    assert.equal(found.length, expected.length);
    found.forEach((hit, k) => {
      assert.ok(Math.abs(hit.distance - expected[k].distance) < 1e-5 * longest && hit.point.distanceTo(expected[k].point) < 1e-5 * longest);
      assert.equal(hit.object, object);
      const same = expected.find((other) => other.faceIndex === hit.faceIndex);
      if (!same) // three rounds, and so may take a neighbour at an edge
        return others++;
      assert.deepEqual(['a', 'b', 'c'].map((name) => hit.face[name]), ['a', 'b', 'c'].map((name) => same.face[name]));
      assert.ok(hit.face.normal.dot(same.face.normal) > 0.999);
    });
    raycaster.firstHitOnly = true;
    const [first, ...rest] = raycaster.intersectObject(object);
    assert.deepEqual([first?.faceIndex, rest.length], [found[0]?.faceIndex, 0]);
    hits += found.length;
  }
  assert.ok(hits > 50 && others <= hits / 50, `${hits} hits, ${others} with another face`);
  const part = await open(new Blob([readFileSync(file)])), object = new THREE.Object3D();
  if (!part.stats.resident) { // the first ray fetches what it needs
    const done = new Promise((ready) => { object.raycast = raycastOf(part, { ready }); });
    const raycaster = new THREE.Raycaster(centre.clone().addScaledVector(new THREE.Vector3(1, 2, 3), longest), new THREE.Vector3(-1, -2, -3).normalize());
    assert.equal(raycaster.intersectObject(object).length, 0);
    await done;
    assert.ok(raycaster.intersectObject(object).length > 0);
  }
  part.dispose();
  model.dispose();
});

/** Serves a folder with range requests. */
async function serve(folder) {
  const TYPES = { '.js': 'text/javascript', '.html': 'text/html', '.wasm': 'application/wasm' };
  const server = createServer(({ url, headers }, response) => {
    const path = join(folder, decodeURIComponent(new URL(url, 'http://x').pathname)), range = /bytes=(\d+)-(\d+)/.exec(headers.range ?? '');
    if (!existsSync(path))
      return response.writeHead(404).end();
    const bytes = readFileSync(path), end = range && Math.min(+range[2], bytes.length - 1);
    return range ? response.writeHead(206, { 'content-range': `bytes ${range[1]}-${end}/${bytes.length}`, etag: '"1"' }).end(bytes.subarray(+range[1], end + 1))
      : response.writeHead(200, { 'content-type': TYPES[extname(path)] ?? 'application/octet-stream' }).end(bytes);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return { address: `http://127.0.0.1:${server.address().port}`, close: () => { server.close(); server.closeAllConnections(); } };
}

test('the page with three.js shows and picks a model', { skip: !browser ? 'Chromium is missing' : !existsSync(playwright) && 'playwright-core is missing', timeout: 300000 }, async () => {
  const project = makeProject(), { chromium } = await import(pathToFileURL(playwright)), { address, close } = await serve(project);
  if (!existsSync(join(project, 'node_modules/three')))
    symlinkSync(join(packages, 'three'), join(project, 'node_modules/three'));
  const instance = await chromium.launch({ executablePath: browser, args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'] });
  try {
    const page = await instance.newPage(), errors = [];
    page.on('pageerror', (error) => errors.push(error.message));
    await page.goto(`${address}/three_page.html?model.ebpo.h5`);
    await page.waitForSelector('canvas', { timeout: 120000 });
    const { width, height } = page.viewportSize();
    const click = async (i) => { // the title changes by itself when the bytes have arrived
      await page.mouse.click(width * (0.5 + 0.01 * i), height * (0.5 + 0.007 * i));
      await page.waitForFunction(() => document.title.startsWith('face'), undefined, { timeout: 3000 }).catch(() => {});
      return page.title();
    };
    let first = 0;
    while (first < 20 && !/^face \d+ at/.test(await click(first)))
      first++;
    assert.ok(first < 20);
    for (let i = 0; i < first; i++) // no click was without an answer because bytes were missing
      assert.equal(await click(i), 'nothing');
    await page.mouse.click(2, 2);
    assert.equal(await page.title(), 'nothing');
    const picture = await page.screenshot();
    assert.ok(picture.length > 5000, `${picture.length} bytes`);
    assert.deepEqual(errors, []);
  } finally {
    await instance.close();
    close();
  }
});
