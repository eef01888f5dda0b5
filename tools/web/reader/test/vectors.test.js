// Tests the format's vectors: files in passed must be read as in their .json files, and files in failed must be refused.
import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { EbpoError, openEbpo } from '../index.js';
import { readAll } from './as_json.js';

const vectors = new URL('../../../../format-spec/vectors/', import.meta.url).pathname;
const load = (folder, name) => readFileSync(join(vectors, folder, name));

// Returns all data of a file, with attributes, as one text.
const everything = async (bytes) => {
  const { info } = await openEbpo(bytes);
  return JSON.stringify([await readAll(bytes, 'damaged'), { ...info, parts: [...info.parts] }]);
};

const narrow = (value) => (typeof value === 'number' ? Math.fround(value) : Array.isArray(value) ? value.map(narrow) : value);

for (const name of readdirSync(join(vectors, 'passed')).filter((n) => n.endsWith('.h5')))
  test(`${name} agrees with its .json file`, async () => {
    const wanted = JSON.parse(load('passed', name.replace('.ebpo.h5', '.json'))), found = await readAll(load('passed', name), name);
    if (found.coordinate_type === 'float32')
      for (const side of [wanted, found])
        side.mesh.vertices = narrow(side.mesh.vertices);
    assert.deepEqual(found, wanted);
  });

// Reads each subtree by the file's table.
async function readSubtrees(bytes, name) {
  const file = await openEbpo(bytes, { name }), { info } = file;
  await file.levels(0, info.subtree_level);
  await file.locate();
  for (let i = 0; i < info.levels[info.subtree_level].gray; i++)
    await file.subtrees([i]);
}

// Attributes, and ends of lists of faces, are not returned here. They are therefore not checked. Only verifiers refuse the vectors unverified_*.
for (const name of readdirSync(join(vectors, 'failed')).filter((n) => n.endsWith('.h5') && !/^(attributes|unverified)_|_of_another_end/.test(n)))
  test(`${name} is refused`, async () => {
    const [status, expected] = load('failed', name.replace('.ebpo.h5', '.txt')).toString().split('\n');
    await assert.rejects(readAll(load('failed', name), name).then(() => readSubtrees(load('failed', name), name)), (error) => {
      assert.ok(error instanceof EbpoError, error.stack);
      assert.equal('EBPO_E_' + error.code, status);
      assert.ok(error.message.startsWith(name + ': ') && error.message.includes('; '), error.message);
      if (process.env.EBPO_SHOW)
        console.log(`C:  ${expected}\nJS: ${error.message}\n`);
      return true;
    });
  });

test('1,500 damaged files give an error or the same content', async () => {
  const names = readdirSync(join(vectors, 'passed')).filter((n) => n.endsWith('.h5')), right = new Map();
  for (const name of names)
    right.set(name, await everything(load('passed', name)));
  let state = 1, refused = 0;
  const random = (n) => Math.floor((state = (state * 48271) % 2147483647) / 2147483647 * n);
  for (let i = 0; i < 1500; i++) {
    const name = names[i % names.length], bytes = Buffer.from(load('passed', name));
    for (let k = random(3); k >= 0; k--)
      bytes[random(random(2) ? bytes.length : Math.min(bytes.length, 8000))] ^= 1 << random(8);
    const found = await everything(random(8) ? bytes : bytes.subarray(0, random(bytes.length))).catch((error) => {
      assert.ok(error instanceof EbpoError, error.stack);
      refused++;
    });
    assert.ok(found === undefined || found === right.get(name), `${name}, damaged copy ${i}, is read as something else`);
  }
  assert.ok(refused > 1000, String(refused)); // damage in unused bytes of a header is not detected
});
