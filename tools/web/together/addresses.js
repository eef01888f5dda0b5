// Parses addresses of several models: ?model=A&model=B, each with &pose= in the same order, or ?scene=.
import { AT_HOME, unitQuaternion, matrixOf } from './poses.js';
import { MOST, isFar, readScene } from './scene_file.js';

const MODELS_MOST = 100; // limits untrusted addresses

const nameOf = (url) => {
  const last = new URL(url).pathname.split('/').at(-1);
  try {
    return decodeURIComponent(last).replace(/(\.ebpo)?\.h5$/, '');
  } catch {
    return last;
  }
};

/** Parses a pose: X,Y,Z[,QX,QY,QZ,QW[,SCALE]]. An empty text is the identity. */
export function poseFrom(text) {
  if (!text)
    return AT_HOME;
  const list = text.split(',').map((word) => (word.trim() ? Number(word) : NaN)), turn = unitQuaternion(list.length > 3 ? list.slice(3, 7) : [0, 0, 0, 1]), scale = list[7] ?? 1;
  if (!list.every(Number.isFinite) || ![3, 7, 8].includes(list.length) || !turn || !(scale > 0))
    throw new Error(`pose=${text}: expected X,Y,Z or X,Y,Z,QX,QY,QZ,QW or X,Y,Z,QX,QY,QZ,QW,SCALE; correct the address`);
  return { rotation: matrixOf(turn), scale, translation: list.slice(0, 3) };
}

// Returns the URL of a file to fetch. Throws for other texts and protocols.
function addressOf(text, base) {
  const url = URL.canParse(text, base) ? new URL(text, base) : undefined;
  if (!['http:', 'https:', 'blob:'].includes(url?.protocol))
    throw new Error(`${text}: not an address of a file; give an address that begins with https://`);
  return url;
}

// Makes names unique by appending numbers.
function differ(names) {
  const taken = new Set();
  return names.map((name) => {
    let free = name;
    for (let i = 2; taken.has(free); i++)
      free = `${name} (${i})`;
    taken.add(free);
    return free;
  });
}

/** Returns the argument of Assembly.open(), { title, models, instances, up, ... }, for File objects. */
export function ofFiles(files) {
  return { ...ofParts(files.map((src) => ({ src }))), title: `${files.length} files`, local: true };
}

/**
 * Returns the argument of Assembly.open() for the query of an address, or undefined when the query names neither models nor a scene. Throws an Error for invalid
 * queries and scenes. `base`: the page's address.
 */
export async function wanted(query, base, get = fetch) {
  const up = query.get('up') === 'z' ? 2 : query.get('up') === 'y' ? 1 : undefined;
  if (query.has('scene'))
    return sceneAt(addressOf(query.get('scene'), base), { up, remote: query.get('remote') === '1', get });
  const addresses = query.getAll('model').map((text) => addressOf(text, base).href);
  if (!addresses.length)
    return undefined;
  if (addresses.length > MODELS_MOST)
    throw new Error(`the address names ${addresses.length} models; name at most ${MODELS_MOST}, or give a scene`);
  const poses = query.getAll('pose').map(poseFrom);
  return { ...ofParts(addresses.map((src, i) => ({ src, pose: poses[i] })), base), up: up ?? 1 };
}

/**
 * Returns the argument of Assembly.open() for parts: [{ src (an address, a File or a Blob), name, pose (from poseFrom()), colour (#RRGGBB), hidden }]. All members
 * except `src` are optional. Parts with the same file and colour are instances of one model.
 */
export function ofParts(parts, base) {
  const models = [], fileOf = ({ src }) => (typeof src === 'string' || src instanceof URL ? addressOf(src, base).href : src);
  const own = parts.map((part) => {
    const file = fileOf(part), { colour } = part;
    if (colour !== undefined && !/^#[0-9a-f]{6}$/i.test(colour))
      throw new Error(`colour ${colour}: expected #RRGGBB; correct the colour`);
    const known = models.findIndex((m) => m.file === file && m.colour === colour);
    return known < 0 ? models.push({ file, colour }) - 1 : known;
  });
  const labels = differ(models.map(({ file }) => (typeof file === 'string' ? nameOf(file) : file.name?.replace(/(\.ebpo)?\.h5$/, '') ?? 'model')));
  models.forEach((model, i) => (model.name = labels[i]));
  const names = differ(parts.map(({ name }, i) => name ?? labels[own[i]]));
  return { title: labels.join(', '), models, instances: parts.map(({ pose, hidden = false }, i) => ({ name: names[i], model: own[i], pose: pose ?? AT_HOME, hidden })) };
}

// Fetches a text. `rest.bytes`: the number of bytes that the scene and its files of poses may still have together.
async function textAt(url, get, rest) {
  const response = await get(url);
  if (!response.ok)
    throw new Error(`${url.pathname}: the server returned ${response.status}; check the address`);
  const parts = [];
  for (const reader = response.body.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done)
      return new Blob(parts).text();
    parts.push(value);
    if ((rest.bytes -= value.length) < 0) {
      await reader.cancel();
      throw new Error(`${url.pathname}: the scene with this file is larger than 64 MiB; show a part of the scene`);
    }
  }
}

async function sceneAt(url, { up, remote, get }) {
  const rest = { bytes: MOST.bytes }, at = (path) => new URL(isFar(path) ? path : path.split('/').map(encodeURIComponent).join('/'), url);
  try {
    const scene = await readScene(await textAt(url, get, rest), (path) => textAt(at(path), get, rest));
    const far = scene.models.find((m) => isFar(m.file));
    if (far && !remote)
      throw new Error(`model "${far.name}" is on another server; add &remote=1 to the address if you trust the scene`);
    const models = scene.models.map((m) => ({ ...m, file: at(m.file).href })), uprights = scene.cameras.map((c) => c.up);
    return { ...scene, title: scene.title || nameOf(url.href).replace(/\.scene\.json$/, ''), unit: scene.unit || undefined, models,
      up: up ?? (uprights.some((u) => u[1] > Math.abs(u[2])) ? 1 : 2) };
  } catch (error) {
    throw new Error(`${url.pathname.split('/').at(-1)}: ${error.message}`, { cause: error });
  }
}
