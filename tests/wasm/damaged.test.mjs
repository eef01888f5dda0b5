// Opens and queries damaged files: each gives an error of the package, or results, and never a trap. Files: the failed
// vectors, and the seeds and corpora of the fuzz targets.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, readdirSync, statSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';

const { EBPO_PACKAGE: folder, EBPO_VECTORS: vectors, EBPO_FUZZ: fuzz, EBPO_TEST_SCALE: scale = '0.05' } = process.env;
const { open, EbpoError } = await import(join(folder, 'index.js'));

/** Reads all of a file and queries it; returns the first error, or null. */
async function useAll(bytes, options = {}) {
  let model, last = null;
  const check = async (call) => {
    try {
      return await call();
    } catch (error) {
      assert.ok(error instanceof EbpoError, error.stack);
      assert.notEqual(error.status, 'EBPO_E_INTERNAL', error.stack);
      assert.ok(error.message.length > 10, error.message);
      last = error;
      return null;
    }
  };
  const attempt = async (call) => { // the first error is returned
    last = null;
    const result = await check(call);
    first ??= last;
    return result;
  };
  let first = null;
  model = await attempt(() => open(bytes, { heap: 2 ** 30, ...options }));
  if (!model)
    return first;
  const { origin, size } = model.info, middle = origin.map((x, i) => x + size[i] / 2);
  const usual = Float64Array.of(...middle, ...origin);
  if (model.info.solid)
    await attempt(() => model.inside(usual));
  await attempt(() => model.distance(usual));
  await attempt(() => model.raysAll([...origin, ...size]));
  await attempt(() => model.boxFaces(origin, middle));
  await attempt(() => model.mesh());
  await attempt(() => model.measure());
  await attempt(() => model.check());
  await attempt(async () => {
    for await (const level of model.levels({ polygons: true }))
      assert.ok(level.level >= 0);
  });
  await useParts(model, check, middle, size);
  model.dispose();
  return first;
}

/** Reads the parts of a file that queries do not read. */
async function useParts(model, check, middle, size) {
  const { attributes } = model.info, [name] = attributes.map(({ element, names }) => `${element}:${names.split(' ')[0]}`);
  await check(() => model.maps());
  for (const { element, names } of attributes)
    await check(() => model.attribute(`${element}:${names.split(' ')[0]}`));
  await check(() => model.textures());
  await check(() => model.sample(name ?? 'x', middle, [0]));
  await check(() => model.corners([0, 1]));
  await check(() => model.subtree());
  await check(() => model.subtree(model.octcode(middle, 2)));
  await check(() => model.windingBounds(middle));
  await check(async () => {
    const view = model.view({ priority: 'pixels', observer: { eye: middle, direction: size }, polygons: true, windings: true, faces: model.info.hasMesh });
    for await (const nodes of view)
      assert.ok(nodes.count > 0);
    view.cut();
    view.dispose();
  });
}

const failed = join(vectors, 'failed');
for (const name of readdirSync(failed).filter((x) => x.endsWith('.h5') && !x.startsWith('unverified_')))
  test(`${name} is refused`, async () => {
    for (const whole of [true, false]) {
      const error = await useAll(readFileSync(join(failed, name)), { whole });
      assert.ok(error, 'no error');
      const [status] = readFileSync(join(failed, name.replace('.ebpo.h5', '.txt')), 'utf8').split('\n');
      assert.equal(error.status, status);
    }
  });

/** Returns all files below a folder. */
const filesBelow = (path) => !existsSync(path) ? [] : statSync(path).isFile() ? [path]
  : readdirSync(path).sort().flatMap((name) => filesBelow(join(path, name)));

test('inputs of the fuzz targets give results or errors', async () => {
  const all = filesBelow(fuzz);
  let refused = 0;
  assert.ok(all.length > 0, `no files in ${fuzz}`);
  for (const path of all)
    refused += await useAll(readFileSync(path)) !== null;
  console.log(`${all.length} files, ${refused} refused`);
});

test('damaged copies of vectors give results or errors', async () => {
  const passed = join(vectors, 'passed'), names = readdirSync(passed).filter((x) => x.endsWith('.h5'));
  const count = Math.max(300, Math.round(20000 * scale));
  let state = 1, refused = 0;
  const random = (n) => Math.floor((state = (state * 48271) % 2147483647) / 2147483647 * n);
  for (let i = 0; i < count; i++) {
    const bytes = readFileSync(join(passed, names[i % names.length]));
    for (let k = random(3); k >= 0; k--)
      bytes[random(random(2) ? bytes.length : Math.min(bytes.length, 8000))] ^= 1 << random(8);
    refused += await useAll(random(8) ? bytes : bytes.subarray(0, random(bytes.length)), { whole: random(2) > 0 }) !== null;
  }
  console.log(`${count} copies, ${refused} refused`);
  assert.ok(refused > count / 2);
});
