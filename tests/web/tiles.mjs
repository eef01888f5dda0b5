// Tests exported 3D Tiles with packages of npm: tiles.mjs valid|drawn EBPO GENERATE SOURCE_ROOT [PICTURES]
//   valid   gltf-validator finds no error in the tiles, and 3d-tiles-validator no error or warning in the tileset
//   drawn   3d-tiles-renderer draws in Chromium what three.js draws of the whole mesh; PICTURES: folder for the pictures
// Exits with 77 (skipped) when a package cannot be installed, or Chromium or tools/web/node_modules is missing.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [what, ebpo, generate, root, pictures] = process.argv.slice(2), viewer = join(root, 'tools/web');
const GLTF_VALIDATOR = 'gltf-validator@2.0.0-dev.3.10', TILES_VALIDATOR = '3d-tiles-validator@0.6.1', RENDERER = ['3d-tiles-renderer@0.5.3', 'three@0.187.0'];
const INSTALL_MS = 300_000;
const work = mkdtempSync(join(tmpdir(), 'ebpo-tiles-'));
process.on('exit', () => rmSync(work, { recursive: true, force: true }));
const run = (program, ...args) => execFileSync(program, args, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'], maxBuffer: 1 << 26 });

function skip(why) {
  console.log(`skipped: ${why}`);
  process.exit(77);
}

function install(...packages) {
  try {
    execFileSync('npm', ['install', '--prefix', work, '--no-audit', '--no-fund', '--legacy-peer-deps', '--fetch-retries=1', '--fetch-timeout=60000', ...packages],
      { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'], timeout: INSTALL_MS });
  } catch (error) {
    skip(`npm cannot install ${packages.join(' ')}: ${/npm error (?!code)[^\n]*/.exec(error.stderr ?? '')?.[0] ?? error.message}`);
  }
}

function exportTiles() {
  run(generate, '--base', 'torus', '--faces', '60000', join(work, 'model.ply'));
  run(ebpo, 'convert', '-q', '--parts=+surface', join(work, 'model.ply'), join(work, 'model.ebpo.h5'));
  run(ebpo, 'export', '-q', '--tiles', join(work, 'model.ebpo.h5'), join(work, 'tiles'));
  run(ebpo, 'export', '-q', '--mesh', join(work, 'model.ebpo.h5'), join(work, 'mesh.glb'));
  run(ebpo, 'export', '-q', '--surface', '--triangles', '5000', join(work, 'model.ebpo.h5'), join(work, 'surface.glb'));
}

// --- validators ---

async function validate() {
  const require = createRequire(join(work, 'package.json')), gltf = require('gltf-validator');
  const files = [...readdirSync(join(work, 'tiles')).filter((name) => name.endsWith('.glb')).map((name) => join(work, 'tiles', name)), join(work, 'surface.glb')];
  for (const file of files) {
    const { issues } = await gltf.validateBytes(new Uint8Array(readFileSync(file)));
    assert.equal(issues.numErrors, 0, `${file}: ${JSON.stringify(issues.messages)}`);
  }
  console.log(`OK: ${files.length} glb files, 0 errors`);
  install(TILES_VALIDATOR);
  const { Validators } = require('3d-tiles-validator'), result = await Validators.validateTilesetFile(join(work, 'tiles/tileset.json'));
  console.log(result.serialize ? result.serialize() : JSON.stringify(result));
  assert.equal(result.numErrors, 0);
  assert.equal(result.numWarnings, 0);
}

// --- drawing ---

const PAGE = `
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TilesRenderer } from '3d-tiles-renderer';
import { GLTFExtensionsPlugin } from '3d-tiles-renderer/plugins';

const renderer = new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true }), SIZE = 700;
renderer.setSize(SIZE, SIZE, false);
renderer.setPixelRatio(1);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(35, 1, 0.1, 100), light = new THREE.DirectionalLight(0xffffff, 2.5), scene = new THREE.Scene();
scene.background = new THREE.Color(0, 0, 1);
light.position.set(1, 2, 3);
scene.add(light, new THREE.AmbientLight(0xffffff, 0.4));
const material = new THREE.MeshStandardMaterial({ color: 0xc0a070, roughness: 0.8 });
const pixels = () => {
  renderer.render(scene, camera);
  const gl = renderer.getContext(), out = new Uint8Array(4 * SIZE * SIZE);
  gl.readPixels(0, 0, SIZE, SIZE, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return out;
};
const plain = (object) => object.traverse((o) => { if (o.isMesh) { o.material = material; if (!o.geometry.attributes.normal) o.geometry.computeVertexNormals(); } });
const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);

function look(distance) {
  camera.position.copy(window.centre).add(new THREE.Vector3(0.4, 0.35, 1).normalize().multiplyScalar(distance * window.radius));
  camera.near = window.radius / 100;
  camera.far = window.radius * 100;
  camera.lookAt(window.centre);
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}
let shown;
function replace(object) {
  if (shown)
    scene.remove(shown);
  scene.add(shown = object);
}
const draw = window.draw = {
  async glb(url, distance) {
    const { scene: object } = await loader.loadAsync(url);
    plain(object);
    if (!window.centre) {
      const sphere = new THREE.Box3().setFromObject(object).getBoundingSphere(new THREE.Sphere());
      window.centre = sphere.center;
      window.radius = sphere.radius;
    }
    replace(object);
    look(distance);
    return pixels();
  },
  async tiles(url, distance, errorTarget) {
    const tiles = new TilesRenderer(url);
    tiles.registerPlugin(new GLTFExtensionsPlugin({ meshoptDecoder: MeshoptDecoder }));
    tiles.errorTarget = errorTarget;
    let failed;
    tiles.addEventListener('load-error', ({ error, url: at }) => (failed = at + ': ' + error));
    tiles.addEventListener('load-model', ({ scene: object }) => plain(object));
    tiles.setCamera(camera);
    tiles.setResolution(camera, SIZE, SIZE);
    replace(tiles.group);
    look(distance);
    for (let quiet = 0, i = 0; quiet < 10 && i < 3000; i++) {
      tiles.update();
      renderer.render(scene, camera);
      await new Promise((done) => setTimeout(done, 20));
      quiet = tiles.loadProgress === 1 && tiles.visibleTiles.size ? quiet + 1 : 0;
      if (failed)
        throw new Error(failed);
    }
    let triangles = 0;
    for (const tile of tiles.visibleTiles)
      tile.engineData.scene.traverse((o) => (triangles += o.isMesh ? o.geometry.index.count / 3 : 0));
    window.last = { tiles: tiles.visibleTiles.size, triangles };
    return pixels();
  },
};
const isModel = (p, i) => i < 0 || i >= p.length || p[i] > 30 || p[i + 1] > 30 || p[i + 2] < 225;
const AROUND = [4, 8, 12, 16].flatMap((r) => [1, SIZE - 1, SIZE, SIZE + 1].flatMap((d) => [4 * r * d, -4 * r * d]));
window.compare = (a, b) => {
  let covered = 0, different = 0, holes = 0, sum = 0;
  for (let i = 0; i < a.length; i += 4) {
    const here = isModel(a, i), there = isModel(b, i);
    covered += here;
    different += here !== there;
    holes += here && !there && AROUND.every((d) => isModel(a, i + d)); // not at the silhouette
    if (here && there)
      sum += Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) + Math.abs(a[i + 2] - b[i + 2]);
  }
  return { covered, different, holes, change: sum / (3 * covered) };
};
window.ready = true;
`;

async function makePage() {
  const { build } = await import(pathToFileURL(join(viewer, 'node_modules/esbuild/lib/main.js')));
  writeFileSync(join(work, 'page.js'), PAGE);
  await build({ absWorkingDir: work, entryPoints: ['page.js'], bundle: true, format: 'esm', outfile: join(work, 'bundle.js'), logLevel: 'error', external: [] });
  writeFileSync(join(work, 'index.html'), '<!doctype html><body style="margin:0"><script type="module" src="bundle.js"></script>');
}

const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json', '.glb': 'model/gltf-binary' };
async function serve() {
  const server = createServer((request, response) => {
    const path = join(work, decodeURIComponent(request.url.split('?')[0]).replace(/^\/$/, '/index.html'));
    if (!path.startsWith(work) || !existsSync(path))
      return response.writeHead(404).end();
    return response.writeHead(200, { 'Content-Type': TYPES[extname(path)] ?? 'application/octet-stream' }).end(readFileSync(path));
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return server;
}

async function drawn() {
  const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  if (!chromium || !existsSync(join(viewer, 'node_modules/playwright-core')) || !existsSync(join(viewer, 'node_modules/esbuild')))
    skip('chromium or tools/web/node_modules is missing; run tools/install-deps.sh --tests');
  install(...RENDERER);
  exportTiles();
  await makePage();
  const { chromium: playwright } = await import(pathToFileURL(join(viewer, 'node_modules/playwright-core/index.mjs')));
  const server = await serve(), flags = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
  const browser = await playwright.launch({ executablePath: chromium, args: process.getuid() === 0 ? ['--no-sandbox', ...flags] : flags });
  try {
    const page = await browser.newPage({ viewport: { width: 700, height: 700 } }), complaints = [];
    page.on('pageerror', (e) => complaints.push(e.message));
    page.on('console', (m) => ['error', 'warning'].includes(m.type()) && !/GPU stall|WebGL-0x|404|limited support/.test(m.text()) && complaints.push(m.text()));
    await page.goto(`http://127.0.0.1:${server.address().port}/`);
    await page.waitForFunction('window.ready');
    const picture = async (name) => pictures && (mkdirSync(pictures, { recursive: true }), await page.screenshot({ path: join(pictures, `${name}.png`) }));
    const compare = async (kind, ...args) => {
      const found = await page.evaluate(async ([k, a]) => {
        const result = await window.draw[k](...a);
        window.mesh ??= {};
        const key = a[1];
        if (a[0] === 'mesh.glb')
          window.mesh[key] = result;
        return { ...window.compare(window.mesh[key], result), ...window.last };
      }, [kind, args]);
      await picture(`${kind}-${args.join('-').replace(/\//g, '_')}`);
      console.log(kind, ...args, JSON.stringify(found));
      return found;
    };
    for (const [distance, middle] of [[1.5, 10], [4, 4]]) {
      const mesh = await compare('glb', 'mesh.glb', distance);
      assert.ok(mesh.covered > 20000 && mesh.different === 0);
      const surface = await compare('glb', 'surface.glb', distance);
      assert.ok(surface.different < 0.02 * mesh.covered && surface.holes < 1e-4 * mesh.covered && surface.change < 8, 'the surface as GLB');
      const exact = await compare('tiles', 'tiles/tileset.json', distance, 0.01);
      assert.ok(exact.different < 0.001 * mesh.covered && exact.holes < 1e-4 * mesh.covered && exact.change < 2, 'the finest tiles');
      const normal = await compare('tiles', 'tiles/tileset.json', distance, middle);
      assert.ok(normal.triangles < exact.triangles && normal.different < 0.01 * mesh.covered && normal.change < 8, 'tiles of an error of some pixels');
      const coarse = await compare('tiles', 'tiles/tileset.json', distance, 1000);
      assert.ok(coarse.tiles === 1 && coarse.triangles < normal.triangles, 'the coarsest tile');
    }
    assert.deepEqual(complaints, []);
  } finally {
    await browser.close();
    server.close();
  }
}

if (what === 'valid') {
  install(GLTF_VALIDATOR);
  exportTiles();
  await validate();
} else {
  await drawn();
}
