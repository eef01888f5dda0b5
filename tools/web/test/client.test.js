// Tests client.js: routing of responses, errors for requests without a response, and failing workers.
import assert from 'node:assert/strict';
import { test } from 'node:test';

Object.assign(globalThis, { location: new URL('https://example.org/v/'), document: { baseURI: 'https://example.org/v/' } });
const workers = [];
globalThis.Worker = class {
  constructor() {
    workers.push(Object.assign(this, { posted: [], over: false }));
  }

  postMessage(message) {
    this.posted.push(message);
  }

  terminate() {
    this.over = true;
  }
};
const { Client, Crew } = await import('../client.js');

const client = (crew, heard = () => {}) => new Client({ crew, heard });
const response = (worker, file, opening, news) => worker.onmessage({ data: { file, opening, ...news } });
const OPENED = { type: 'opened', info: {}, scene: {}, size: 1 };

test('files are shared among workers, and a worker ends with its last file', () => {
  workers.length = 0;
  const crew = new Crew({ most: 2 }), [a, b, c] = [0, 1, 2].map(() => client(crew));
  assert.equal(workers.length, 2);
  b.end();
  assert.deepEqual([workers[0].over, workers[1].over], [false, true]);
  a.end();
  a.end();
  assert.deepEqual([workers[0].over, workers[0].posted], [false, [{ file: 0, type: 'end' }]]);
  a.close();
  a.retry();
  assert.equal(workers[0].posted.length, 1, 'the worker hears no more of what has ended');
  c.end();
  assert.equal(workers[0].over, true);
  assert.equal(crew.workers.length, 0);
});

test('a failing worker is reported to all its files, and later files get another worker', async () => {
  workers.length = 0;
  const crew = new Crew({ most: 1 }), received = [], one = client(crew, (type) => received.push(type)), opening = one.open('a.ebpo.h5');
  const two = client(crew, (type) => received.push(type));
  workers[0].onerror({ message: 'gone' });
  await assert.rejects(opening, /the worker failed \(gone\)/);
  assert.deepEqual([received, workers[0].over], [['failed', 'failed'], true]);
  const three = client(crew), there = three.open('b.ebpo.h5');
  assert.equal(workers.length, 2);
  one.end();
  two.end();
  assert.equal(crew.workers.length, 1, 'the new one stays');
  response(workers[1], 2, 1, OPENED);
  await there;
});

test('each query gets a result or an error', async () => {
  workers.length = 0;
  const crew = new Crew({ most: 1 }), it = client(crew), open = async () => {
    const there = it.open('a.ebpo.h5');
    response(workers[0], 0, it.opening, OPENED);
    await there;
    return [it.probe([0, 0, 0]), it.positions([[0, 0, 0]])];
  };
  let requested = await open();
  response(workers[0], 0, it.opening, { type: 'failed', late: true, error: { message: 'of the picture' } });
  response(workers[0], 0, it.opening, { type: 'positions', id: it.queries, error: { code: 'NETWORK', message: 'no line' } });
  response(workers[0], 0, it.opening, { type: 'probed', done: true, where: 'in' });
  assert.equal((await requested[0]).where, 'in');
  await assert.rejects(requested[1], { code: 'NETWORK', message: 'no line' });
  for (const over of [() => it.open('b.ebpo.h5').catch(() => {}), () => it.close(), () => it.end()]) {
    requested = await open();
    over();
    for (const one of requested)
      await assert.rejects(one, { name: 'AbortError' });
  }
});
