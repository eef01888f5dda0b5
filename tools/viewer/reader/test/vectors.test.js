// The format's vectors: passed ones must be read as their .json says, failed ones must be refused.
import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { EbpoError } from '../index.js';
import { readAll } from './as_json.js';

const vectors = new URL('../../../../format-spec/vectors/', import.meta.url).pathname;
const load = (folder, name) => readFileSync(join(vectors, folder, name));

const narrow = (value) => (typeof value === 'number' ? Math.fround(value) : Array.isArray(value) ? value.map(narrow) : value);

for (const name of readdirSync(join(vectors, 'passed')).filter((n) => n.endsWith('.h5')))
  test(`${name} is read as its json says`, async () => {
    const wanted = JSON.parse(load('passed', name.replace('.ebpo.h5', '.json'))), found = await readAll(load('passed', name), name);
    if (found.coordinate_type === 'float32')
      for (const side of [wanted, found])
        side.mesh.vertices = narrow(side.mesh.vertices);
    assert.deepEqual(found, wanted);
  });

for (const name of readdirSync(join(vectors, 'failed')).filter((n) => n.endsWith('.h5')))
  test(`${name} is refused`, async () => {
    const [status, said] = load('failed', name.replace('.ebpo.h5', '.txt')).toString().split('\n');
    await assert.rejects(readAll(load('failed', name), name), (error) => {
      assert.ok(error instanceof EbpoError, error.stack);
      assert.equal('EBPO_E_' + error.code, status);
      assert.ok(error.message.startsWith(name + ': ') && error.message.includes('; '), error.message);
      if (process.env.EBPO_SHOW)
        console.log(`C:  ${said}\nJS: ${error.message}\n`);
      return true;
    });
  });

test('a few thousand damaged files give an error or the same content, never anything else', async () => {
  const names = readdirSync(join(vectors, 'passed')).filter((n) => n.endsWith('.h5'));
  let state = 1;
  const random = (n) => (state = (state * 1103515245 + 12345) % 2147483648) % n;
  for (let i = 0; i < 1500; i++) {
    const bytes = Buffer.from(load('passed', names[i % names.length]));
    for (let k = random(3); k >= 0; k--)
      bytes[random(random(2) ? bytes.length : Math.min(bytes.length, 8000))] = random(256);
    await readAll(random(8) ? bytes : bytes.subarray(0, random(bytes.length)), 'damaged').catch((error) => assert.ok(error instanceof EbpoError, error.stack));
  }
});
