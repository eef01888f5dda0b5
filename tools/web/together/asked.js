// Parses addresses of several models: ?model=A&model=B, each with &pose= in the same order, or ?scene=.
import { AT_HOME, unitQuaternion, matrixOf } from './poses.js';
import { MOST, isFar, readScene } from './scene_file.js';

const MODELS_MOST = 100; // an address may come from anybody

const nameOf = (url) => {
  const last = new URL(url).pathname.split('/').at(-1);
  try {
    return decodeURIComponent(last).replace(/(\.ebpo)?\.h5$/, '');
  } catch {
    return last;
  }
};

/** X,Y,Z[,QX,QY,QZ,QW[,SCALE]] as a pose; an empty text is where the file's own coordinates are. */
export function poseFrom(text) {
  if (!text)
    return AT_HOME;
  const list = text.split(',').map((word) => (word.trim() ? Number(word) : NaN)), turn = unitQuaternion(list.length > 3 ? list.slice(3, 7) : [0, 0, 0, 1]), scale = list[7] ?? 1;
  if (!list.every(Number.isFinite) || ![3, 7, 8].includes(list.length) || !turn || !(scale > 0))
    throw new Error(`pose=${text}: a pose is X,Y,Z or X,Y,Z,QX,QY,QZ,QW or that and a scale; correct the address`);
  return { rotation: matrixOf(turn), scale, translation: list.slice(0, 3) };
}

// Of files that are fetched; nothing else is an address here.
function addressOf(text, base) {
  const url = URL.canParse(text, base) ? new URL(text, base) : undefined;
  if (!['http:', 'https:', 'blob:'].includes(url?.protocol))
    throw new Error(`${text}: this is no address of a file; give one that begins with https://`);
  return url;
}

// Names differ, also of files that are called alike.
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

/** For Assembly.open(): { title, models, instances, up, ... } of files (File objects). */
export function ofFiles(files) {
  return { ...ofParts(files.map((src) => ({ src }))), title: `${files.length} files`, local: true };
}

/** What an address' query asks for, likewise; undefined if it is no matter of several models. Throws an Error that says what is wrong. `base`: the page's address. */
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
 * Of parts, likewise: [{ src (an address, a File or a Blob), name, pose (of poseFrom()), colour (#RRGGBB), hidden }], all but the first of which may be missing. Parts of one file and
 * colour are instances of one model.
 */
export function ofParts(parts, base) {
  const models = [], fileOf = ({ src }) => (typeof src === 'string' || src instanceof URL ? addressOf(src, base).href : src);
  const own = parts.map((part) => {
    const file = fileOf(part), { colour } = part;
    if (colour !== undefined && !/^#[0-9a-f]{6}$/i.test(colour))
      throw new Error(`colour ${colour}: a colour is #RRGGBB; correct it`);
    const known = models.findIndex((m) => m.file === file && m.colour === colour);
    return known < 0 ? models.push({ file, colour }) - 1 : known;
  });
  const labels = differ(models.map(({ file }) => (typeof file === 'string' ? nameOf(file) : file.name?.replace(/(\.ebpo)?\.h5$/, '') ?? 'model')));
  models.forEach((model, i) => (model.name = labels[i]));
  const names = differ(parts.map(({ name }, i) => name ?? labels[own[i]]));
  return { title: labels.join(', '), models, instances: parts.map(({ pose, hidden = false }, i) => ({ name: names[i], model: own[i], pose: pose ?? AT_HOME, hidden })) };
}

// A scene and its files of poses together may be so long: `rest` is what may still come.
async function textAt(url, get, rest) {
  const answer = await get(url);
  if (!answer.ok)
    throw new Error(`${url.pathname}: the server answers ${answer.status}; check the address`);
  const parts = [];
  for (const reader = answer.body.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done)
      return new Blob(parts).text();
    parts.push(value);
    if ((rest.bytes -= value.length) < 0) {
      await reader.cancel();
      throw new Error(`${url.pathname}: with it the scene is larger than 64 MiB; show a part of it`);
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
