// Compares what the viewer draws with all faces of the model, for viewer_line.mjs. The faces of a mesh file are drawn by the viewer itself, with its camera, light and
// material, in place of what it has drawn.
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const TILE_FACES = 1 << 20;   // faces that are drawn together
const LEAST_COSINE = 0.766;   // of the angle between a face's normal and its vertex's, as the viewer shades meshes (tools/web/mesh.js)
const FRAMES = 2, ROUNDS = 3; // frames of each kind, by turns

// Reads a binary PLY file as ebpo-generate writes it: { corners: Float32Array, faces: Uint32Array }.
function readMesh(path) {
  const bytes = readFileSync(path), text = bytes.toString('latin1', 0, 1000), end = text.indexOf('end_header\n') + 11;
  const [vertices, count] = ['vertex', 'face'].map((name) => Number(new RegExp(`element ${name} (\\d+)`).exec(text)?.[1]));
  const words = text.slice(0, end).split('\n').filter((line) => line.startsWith('property')).join(';');
  if (end < 11 || !text.includes('format binary_little_endian') || !/^property float x;property float y;property float z;property list uchar u?int vertex_ind\w+$/.test(words))
    throw new Error(`${path}: expected a binary PLY file as ebpo-generate writes it`);
  const corners = new Float32Array(bytes.buffer.slice(bytes.byteOffset + end, bytes.byteOffset + end + 12 * vertices)), faces = new Uint32Array(3 * count);
  for (let i = 0, at = end + 12 * vertices; i < count; i++, at += 13)
    for (let k = 0; k < 3; k++)
      faces[3 * i + k] = bytes.readUInt32LE(at + 1 + 4 * k);
  return { corners, faces };
}

// Returns the area vectors of faces, and their sums at vertices.
function areasOf({ corners, faces }) {
  const areas = new Float32Array(faces.length), sums = new Float32Array(corners.length), u = [0, 0, 0], v = [0, 0, 0];
  for (let f = 0; f < faces.length; f += 3) {
    for (let k = 0; k < 3; k++) {
      u[k] = corners[3 * faces[f + 1] + k] - corners[3 * faces[f] + k];
      v[k] = corners[3 * faces[f + 2] + k] - corners[3 * faces[f] + k];
    }
    for (let k = 0; k < 3; k++) {
      const a = areas[f + k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
      for (let c = 0; c < 3; c++)
        sums[3 * faces[f + c] + k] += a;
    }
  }
  return { areas, sums };
}

function octahedral(list, at, out) {
  const [x, y, z] = list.subarray(at, at + 3), sum = Math.abs(x) + Math.abs(y) + Math.abs(z) || 1;
  const u = x / sum, v = y / sum;
  out.push(...(z < 0 ? [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)] : [u, v]).map((n) => Math.round(32767 * n)));
}

const cosine = (a, i, b, j) => (a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2]) / (Math.hypot(a[i], a[i + 1], a[i + 2]) * Math.hypot(b[j], b[j + 1], b[j + 2]) || 1);

// Returns tile number n of a mesh: { position, normal, index }, in coordinates (x - center) * scale.
function tileOf({ corners, faces, areas, sums }, n, { center, scale }) {
  const known = new Map(), position = [], normal = [], index = [], end = Math.min(faces.length, 3 * TILE_FACES * (n + 1));
  const add = (vertex, list, at) => {
    for (let k = 0; k < 3; k++)
      position.push((corners[3 * vertex + k] - center[k]) * scale);
    octahedral(list, at, normal);
    return position.length / 3 - 1;
  };
  for (let i = 3 * TILE_FACES * n; i < end; i++) {
    const vertex = faces[i], face = i - i % 3;
    if (cosine(areas, face, sums, 3 * vertex) < LEAST_COSINE)
      index.push(add(vertex, areas, face));
    else
      index.push(known.get(vertex) ?? known.set(vertex, add(vertex, sums, 3 * vertex)).get(vertex));
  }
  return [Float32Array.from(position), Int16Array.from(normal), Uint32Array.from(index)];
}

// Serves tiles of the mesh and three.js to the page.
function serve(mesh, place, three) {
  const tiles = new Map(), server = createServer(({ url }, response) => {
    const [, tile, part] = /^\/(\d+)\/(\d)$/.exec(url) ?? [];
    response.setHeader('Access-Control-Allow-Origin', '*');
    if (!tile) {
      response.writeHead(200, { 'Content-Type': 'text/javascript' }).end(readFileSync(join(three, url.slice(url.lastIndexOf('/') + 1))));
      return;
    }
    const data = tiles.get(tile) ?? tiles.set(tile, tileOf(mesh, Number(tile), place)).get(tile);
    if (part === '2')
      tiles.delete(tile);
    response.writeHead(200).end(Buffer.from(data[part].buffer));
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done(server)));
}

// --- in the page ---

const read = () => {
  const { scene } = window.ebpoViewer, gl = scene.renderer.getContext();
  scene.redraw = () => {}; // nothing else is drawn from now on
  scene.draw();
  const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let text = '';
  for (let i = 0; i < pixels.length; i += 1 << 14)
    text += String.fromCharCode(...pixels.subarray(i, i + (1 << 14)));
  return { width: gl.drawingBufferWidth, data: btoa(text) };
};

const showMesh = async ({ address, count }) => {
  const { scene } = window.ebpoViewer, { tiles } = scene, tag = tiles.meshes[0].geometry.attributes.tag.array.slice(0, 4);
  scene.setTiles([], [...tiles.byKey.keys()]);
  for (let i = 0; i < count; i++) {
    const get = async (part) => (await fetch(`${address}${i}/${part}`)).arrayBuffer();
    const tile = { key: `all${i}`, position: new Float32Array(await get(0)), normal: new Int16Array(await get(1)), index: new Uint32Array(await get(2)) };
    tile.tag = new Uint8Array(tile.position.length / 3 * 4);
    for (let at = 0; at < tile.tag.length; at += 4)
      tile.tag.set(tag, at);
    scene.setTiles([{ ...tile, inner: tile.index.length / 3 }], []);
  }
};

// Makes a plain mesh of three.js with the triangles that the viewer has drawn, in a picture of the same size. Sets window.drawFrames: functions that draw a number of frames and
// wait until they are drawn: the viewer's, those of the plain mesh with fronts of faces alone, the default, and those with both sides.
const preparePlain = async (address) => {
  const { scene } = window.ebpoViewer, THREE = await import(`${address}three.module.js`), { canvas, camera } = scene;
  const renderer = new THREE.WebGLRenderer({ canvas: document.createElement('canvas'), antialias: true, powerPreference: 'high-performance', preserveDrawingBuffer: true });
  renderer.setSize(canvas.width, canvas.height, false);
  const plain = new THREE.Scene(), light = new THREE.DirectionalLight(0xffffff, 2.5), material = new THREE.MeshStandardMaterial({ color: 0xbcc3cf });
  light.position.set(1, 2, 3);
  plain.add(light, new THREE.AmbientLight(0xffffff, 0.4));
  for (const { geometry } of scene.tiles.meshes) {
    const { position } = geometry.attributes, copy = new THREE.BufferGeometry();
    copy.setAttribute('position', new THREE.BufferAttribute(position.array, 3));
    copy.setIndex(new THREE.BufferAttribute(geometry.index.array, 1));
    copy.computeVertexNormals();
    plain.add(new THREE.Mesh(copy, material));
  }
  const eye = new THREE.PerspectiveCamera();
  eye.copy(new THREE.ObjectLoader().parse(camera.toJSON()));
  const times = (gl, draw) => (count) => {
    for (let i = 0; i < count; i++) {
      draw();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until the frame is drawn
    }
  };
  const plainly = (side) => times(renderer.getContext(), () => {
    material.side = side;
    renderer.render(plain, eye);
  });
  window.drawFrames = { own: times(scene.renderer.getContext(), () => scene.draw()), fronts: plainly(THREE.FrontSide), both: plainly(THREE.DoubleSide) };
};

// Returns the processor time of a frame of each kind in seconds, as the graphics are drawn by software. It depends less on other programs than the time that passes.
async function timeFrames(page) {
  const session = await page.context().browser().newBrowserCDPSession(), spent = { own: 0, fronts: 0, both: 0 };
  const used = async () => (await session.send('SystemInfo.getProcessInfo')).processInfo.find(({ type }) => type === 'GPU').cpuTime;
  for (let round = -1; round < ROUNDS; round++)
    for (const kind of Object.keys(spent)) {
      const before = await used();
      await page.evaluate(([name, count]) => window.drawFrames[name](count), [kind, round < 0 ? 1 : FRAMES]);
      spent[kind] += round < 0 ? 0 : (await used() - before) / FRAMES / ROUNDS;
    }
  return spent;
}

// Bundled for the page: loads the tiles of the viewer's view with 3d-tiles-renderer, and draws them by the viewer. Sets window.drawTiles.
const TILES = `
import { Matrix3, ObjectLoader, Vector3 } from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TilesRenderer } from '3d-tiles-renderer';
import { GLTFExtensionsPlugin } from '3d-tiles-renderer/plugins';
window.drawTiles = async (url, errorTarget) => {
  const { scene, place } = window.ebpoViewer, camera = new ObjectLoader().parse(scene.camera.toJSON()), tiles = new TilesRenderer(url), began = performance.now();
  camera.updateMatrixWorld();
  tiles.registerPlugin(new GLTFExtensionsPlugin({ meshoptDecoder: MeshoptDecoder }));
  tiles.errorTarget = errorTarget;
  let failed, last;
  tiles.addEventListener('load-error', ({ error, url: at }) => (failed = at + ': ' + error));
  tiles.setCamera(camera);
  tiles.setResolution(camera, scene.canvas.width, scene.canvas.height);
  tiles.group.scale.setScalar(place.scale);
  tiles.group.position.set(...place.center).multiplyScalar(-place.scale);
  tiles.group.updateMatrixWorld(true);
  for (let quiet = 0; quiet < 10 && !failed;) {
    tiles.update();
    await new Promise((done) => setTimeout(done, 20));
    const settled = tiles.loadProgress === 1 && tiles.visibleTiles.size > 0;
    last = settled && quiet ? last : performance.now();
    quiet = settled ? quiet + 1 : 0;
  }
  if (failed)
    throw new Error(failed);
  tiles.group.updateMatrixWorld(true);
  let triangles = 0, n = 0;
  const set = [], v = new Vector3(), shown = scene.tiles, tag = shown.meshes[0].geometry.attributes.tag.array.slice(0, 4);
  for (const tile of tiles.visibleTiles)
    tile.engineData.scene.traverse((o) => {
      if (!o.isMesh)
        return;
      if (!o.geometry.attributes.normal)
        o.geometry.computeVertexNormals();
      const { position: p, normal: m } = o.geometry.attributes, turned = new Matrix3().getNormalMatrix(o.matrixWorld), index = new Uint32Array(o.geometry.index.array);
      const made = { key: 'tile' + n++, position: new Float32Array(3 * p.count), tag: new Uint8Array(4 * p.count), normal: new Int16Array(2 * p.count), index, inner: index.length / 3 };
      for (let i = 0; i < p.count; i++) {
        v.fromBufferAttribute(p, i).applyMatrix4(o.matrixWorld).toArray(made.position, 3 * i);
        made.tag.set(tag, 4 * i);
        v.fromBufferAttribute(m, i).applyMatrix3(turned);
        const sum = Math.abs(v.x) + Math.abs(v.y) + Math.abs(v.z) || 1, [x, y] = [v.x / sum, v.y / sum];
        made.normal.set((v.z < 0 ? [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)] : [x, y]).map((k) => Math.round(32767 * k)), 2 * i);
      }
      triangles += made.inner;
      set.push(made);
    });
  scene.setTiles(set, [...shown.byKey.keys()]);
  tiles.dispose();
  return { ms: last - began, triangles, tiles: set.length };
};`;

async function bundleTiles(modules, esbuild) {
  const { build } = await import(pathToFileURL(esbuild));
  const { outputFiles } = await build({ stdin: { contents: TILES, resolveDir: modules }, bundle: true, format: 'iife', write: false, logLevel: 'error' });
  return outputFiles[0].text;
}

// --- similarity ---

// Sums of rows and columns under a Gaussian of 11 pixels, sigma 1.5 (Wang and others 2004).
function blurred(from, width) {
  const weights = Array.from({ length: 11 }, (_, i) => Math.exp(-((i - 5) ** 2) / 4.5)), all = weights.reduce((a, b) => a + b), height = from.length / width;
  const along = (list, step, limit, at) => {
    const out = new Float64Array(list.length);
    for (let i = 0; i < list.length; i++)
      for (let k = -5, here = at(i); k <= 5; k++)
        out[i] += weights[k + 5] / all * list[i + step * (Math.max(0, Math.min(limit - 1, here + k)) - here)];
    return out;
  };
  return along(along(from, 1, width, (i) => i % width), width, height, (i) => Math.floor(i / width));
}

// Returns the mean SSIM of the luminance of two pictures on a black ground, over the pixels in which one of them shows the model.
export function similarity(a, b, width) {
  const light = (p) => Float64Array.from({ length: p.length / 4 }, (_, i) => 0.2126 * p[4 * i] + 0.7152 * p[4 * i + 1] + 0.0722 * p[4 * i + 2]);
  const [x, y] = [light(a), light(b)], times = (u, v) => blurred(u.map((n, i) => n * v[i]), width);
  const mx = blurred(x, width), my = blurred(y, width), xx = times(x, x), yy = times(y, y), xy = times(x, y);
  let sum = 0, count = 0;
  for (let i = 0; i < x.length; i++)
    if (a[4 * i + 3] || b[4 * i + 3]) {
      const m = mx[i] * my[i], squares = mx[i] ** 2 + my[i] ** 2;
      sum += (2 * m + 6.5025) * (2 * (xy[i] - m) + 58.5225) / ((squares + 6.5025) * (xx[i] + yy[i] - squares + 58.5225));
      count++;
    }
  return sum / count;
}

// Counts the pixels that `mesh` covers completely, with all pixels up to 2 away, and those of them that `drawn` does not cover completely, or not at all.
export function uncovered(mesh, drawn, width) {
  const out = { inside: 0, partly: 0, holes: 0 }, near = [-2, -1, 0, 1, 2].flatMap((x) => [-2, -1, 0, 1, 2].map((y) => 4 * (x + y * width)));
  for (let i = 8 * width + 11; i < mesh.length - 8 * width - 8; i += 4)
    if (near.every((d) => mesh[i + d] === 255)) {
      out.inside++;
      out.partly += drawn[i] < 255;
      out.holes += drawn[i] === 0;
    }
  return out;
}

/**
 * Returns measurements of the picture in the viewer's page, and ends the picture. `path`: the mesh; `packages`: node_modules with three and esbuild. `tiles`: { url, modules, errors,
 * delivered() }, an address of 3D Tiles, a folder in which 3d-tiles-renderer is installed, the allowed errors in pixels, and a function that returns a count of bytes; or undefined.
 */
export async function comparePicture(page, path, packages, tiles) {
  const three = join(packages, 'three/build');
  const mesh = readMesh(path), place = await page.evaluate(() => window.ebpoViewer.place), server = await serve(Object.assign(mesh, areasOf(mesh)), place, three);
  const address = `http://127.0.0.1:${server.address().port}/`, picture = async () => {
    const { width, data } = await page.evaluate(read);
    return { width, pixels: Buffer.from(data, 'base64') };
  };
  try {
    const drawn = await picture();
    await page.evaluate(preparePlain, address);
    const frames = await timeFrames(page);
    await page.evaluate(showMesh, { address, count: Math.ceil(mesh.faces.length / 3 / TILE_FACES) });
    const { pixels, width } = await picture(), others = [];
    if (tiles) {
      await (await page.context().newCDPSession(page)).send('Network.setCacheDisabled', { cacheDisabled: true }); // each error needs all its tiles
      await page.evaluate(await bundleTiles(tiles.modules, join(packages, 'esbuild/lib/main.js')));
    }
    for (const error of tiles?.errors ?? []) {
      const before = tiles.delivered(), made = await page.evaluate(([url, most]) => window.drawTiles(url, most), [tiles.url, error]), bytes = tiles.delivered() - before;
      others.push({ error, ...made, bytes, ssim: similarity(pixels, (await picture()).pixels, width) });
    }
    return { others, ssim: similarity(pixels, drawn.pixels, width), silhouette: uncovered(pixels, drawn.pixels, width), faces: mesh.faces.length / 3, frames };
  } finally {
    server.close();
  }
}
