// Tests files of saved views: writing, reading, and refusing invalid files.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { mergedViews, readViews, viewOf, writeViews } from '../views.js';

const DIGEST = 'a'.repeat(64), VIEW = { name: 'Front', query: '?view=0,0,2&clip=x0.5' };

test('views are read from a file as they were written', () => {
  const [clip] = mergedViews([], [{ ...VIEW, query: '?file=secret.ebpo.h5&view=0,0,2&clip=x0.5&paint=x' }]);
  assert.deepEqual([...new URLSearchParams(clip.query)], [['view', '0,0,2'], ['clip', 'x0.5']], 'of the file and its paint a view says nothing');
  const again = mergedViews([], readViews(writeViews([clip], DIGEST, 'statue'), DIGEST));
  assert.deepEqual(again, [clip]);
  assert.deepEqual(mergedViews(again, again), again, 'none twice');
  assert.equal(viewOf('https://example.org/v/?file=a'), '?');
});

test('invalid files are refused, and invalid views are omitted', () => {
  for (const text of ['', '{', '[]', '{"ebpo_views":"2.0","views":[]}', '{"ebpo_views":"1.0","views":5}', 'x'.repeat(1 << 23)])
    assert.throws(() => readViews(text, DIGEST), /not a file of saved views/);
  assert.throws(() => readViews(writeViews([VIEW], 'b'.repeat(64), 'statue'), DIGEST), /belong to "statue"/);
  assert.deepEqual(mergedViews([], [null, 5, { name: 1, query: '?' }, { name: ' ', query: '?' }, { name: 'a', query: 'x'.repeat(30000) }]), []);
  assert.deepEqual(mergedViews([], 'none'), []);
  assert.equal(mergedViews([], Array.from({ length: 2000 }, (_, i) => ({ name: `${i}`, query: '?' }))).length, 1000);
});
