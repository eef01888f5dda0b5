// SPDX-License-Identifier: MIT
// The JavaScript reader on damaged files: its own errors, or the same results.
//
//     node fuzz_reader.mjs [-n MUTATIONS] [-s SEED] FILE...     mutates; checksums are made good again half of the time
//     node fuzz_reader.mjs -d [-e EVERY] [-o OTHER] FILE...     damages as tests/fuzz/damage.c does; wrong results are counted
//
// Run where zstddec is found: in tools/web after npm ci, or with NODE_PATH's like.
import { readFileSync, writeFileSync } from 'node:fs';
import { basename } from 'node:path';
import { parseArgs } from 'node:util';
import { kinds, queryAll } from './query_all.mjs';
import { changeHead, changeNumbers, changeBytes } from './mutate.mjs';

const { values: option, positionals: files } = parseArgs({
  allowPositionals: true,
  options: { n: { type: 'string', default: '200' }, s: { type: 'string', default: '1' }, d: { type: 'boolean' }, e: { type: 'string', default: '1' }, o: { type: 'string' }, w: { type: 'string' } },
});

// The same numbers for the same seed.
function random(seed) {
  let state = (seed * 2654435761) >>> 0 || 1;
  return (below) => {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    state >>>= 0;
    return Math.floor(state / 2 ** 32 * below);
  };
}

function crashed(name, what, bytes, error) {
  if (option.w)
    writeFileSync(option.w, bytes);
  console.error(`${name}: ${what}: ${error.stack}`);
  process.exit(1);
}

async function fuzz(path) {
  const good = readFileSync(path), name = basename(path), counts = { runs: 0, opened: 0 };
  for (let i = -1; i < Number(option.n); i++) {
    const pick = random(Number(option.s) * 1000003 + i + 1);
    let bytes = Buffer.from(good);
    for (let times = i < 0 ? 0 : 1 + pick(3); times > 0; times--)
      bytes = await [changeBytes, changeHead, changeNumbers, changeNumbers][pick(4)](bytes, pick);
    const results = await queryAll(bytes).catch((error) => crashed(name, `mutation ${i}, seed ${option.s}`, bytes, error));
    counts.runs++;
    counts.opened += results.open === undefined ? 1 : 0;
  }
  console.log(`${name}: ${counts.runs} inputs, ${counts.opened} opened, no crash`);
}

// --- damage ---

const ways = ['flips', 'zeros', 'ones', 'cuts', 'swaps', 'of another'];

async function damage(path) {
  const good = readFileSync(path), name = basename(path), right = await queryAll(good), step = Number(option.e), wrongs = [];
  const counts = Object.fromEntries(ways.map((way) => [way, { tried: 0, refused: 0, noticed: 0, harmless: 0, wrong: 0 }]));
  const summed = right.chunks.some((c) => c.path === '/chunk_checksums');
  const judge = async (way, at, bytes) => {
    const found = await queryAll(Buffer.from(bytes)).catch((error) => crashed(name, `${way}, byte ${at}`, bytes, error)), count = counts[way];
    count.tried++;
    if (found.open)
      return void count.refused++;
    const differ = kinds.filter((kind) => found[kind].said !== right[kind].said), wrong = differ.filter((kind) => !found[kind].error);
    count[wrong.length ? 'wrong' : differ.length ? 'noticed' : 'harmless']++;
    const reported = !summed && !found.verified && (way === 'swaps' || way === 'of another'); // of whole chunks only the checksum of the content can detect the damage
    if (wrong.length && !reported && wrongs.push(at) <= 20)
      console.log(`${name}: ${way}, byte ${at}: ${wrong.join(', ')}: wrong, and nothing is said`);
  };
  const bytes = Buffer.from(good);
  for (let i = 0; i < good.length; i += step) {
    for (const [way, value] of [['flips', good[i] ^ 1 << i * 5 % 8], ['zeros', 0], ['ones', 255]])
      if (value !== good[i]) {
        bytes[i] = value;
        await judge(way, i, bytes);
      }
    bytes[i] = good[i];
    await judge('cuts', i, good.subarray(0, i));
  }
  const chunks = right.chunks;
  for (const [a, x] of chunks.entries())
    for (const y of chunks.slice(a + 1))
      if (x.bytes === y.bytes && !good.subarray(x.at, x.at + x.bytes).equals(good.subarray(y.at, y.at + y.bytes))) {
        good.copy(bytes, x.at, y.at, y.at + y.bytes);
        good.copy(bytes, y.at, x.at, x.at + x.bytes);
        await judge('swaps', x.at, bytes);
        good.copy(bytes);
      }
  if (option.o) {
    const other = readFileSync(option.o), theirs = (await queryAll(other)).chunks;
    for (const x of chunks)
      for (const y of theirs)
        if (x.path === y.path && x.chunk === y.chunk && x.bytes === y.bytes && !good.subarray(x.at, x.at + x.bytes).equals(other.subarray(y.at, y.at + y.bytes))) {
          other.copy(bytes, x.at, y.at, y.at + y.bytes);
          await judge('of another', x.at, bytes);
          good.copy(bytes);
        }
  }
  for (const [way, c] of Object.entries(counts))
    if (c.tried)
      console.log(`${name}: ${way}: ${c.tried} tried, ${c.refused} refused in opening, ${c.noticed} noticed, ${c.harmless} harmless, ${c.wrong} wrong`);
  return wrongs.length;
}

let wrong = 0;
for (const path of files)
  wrong += option.d ? await damage(path) : (await fuzz(path), 0);
process.exitCode = wrong ? 1 : 0;
