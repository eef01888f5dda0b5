// What several models an address asks for: ?model=A&model=B, each with &pose= in the same order, or ?scene=.
import { AT_HOME, unitQuaternion, matrixOf } from './poses.js';
import { MOST, readScene } from './scene_file.js';

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
  const names = differ(files.map((f) => f.name.replace(/(\.ebpo)?\.h5$/, ''))), models = files.map((file, i) => ({ name: names[i], file }));
  return { title: `${models.length} files`, models, instances: models.map((m, i) => ({ name: m.name, model: i, pose: AT_HOME })), local: true };
}

/** What an address' query asks for, likewise; undefined if it is no matter of several models. Throws an Error that says what is wrong. `base`: the page's address. */
export async function wanted(query, base, get = fetch) {
  const up = query.get('up') === 'z' ? 2 : query.get('up') === 'y' ? 1 : undefined;
  if (query.has('scene'))
    return sceneAt(new URL(query.get('scene'), base), { up, remote: query.get('remote') === '1', get });
  const addresses = query.getAll('model').slice(0, MODELS_MOST).map((text) => new URL(text, base).href);
  if (!addresses.length)
    return undefined;
  const poses = query.getAll('pose').map(poseFrom), files = [...new Set(addresses)], own = differ(files.map(nameOf)), names = differ(addresses.map((a) => own[files.indexOf(a)]));
  return { title: own.join(', '), models: files.map((file, i) => ({ name: own[i], file })),
    instances: addresses.map((a, i) => ({ name: names[i], model: files.indexOf(a), pose: poses[i] ?? AT_HOME })), up: up ?? 1 };
}

async function textAt(url, get) {
  const answer = await get(url);
  if (!answer.ok)
    throw new Error(`${url.pathname}: the server answers ${answer.status}; check the address`);
  if (Number(answer.headers.get('content-length') ?? 0) > MOST.bytes)
    throw new Error(`${url.pathname}: is larger than 64 MiB`);
  return answer.text();
}

async function sceneAt(url, { up, remote, get }) {
  const at = (path) => new URL(/^https?:/i.test(path) ? path : path.split('/').map(encodeURIComponent).join('/'), url);
  try {
    const scene = await readScene(await textAt(url, get), (path) => textAt(at(path), get));
    const far = scene.models.find((m) => /^https?:/i.test(m.file));
    if (far && !remote)
      throw new Error(`model "${far.name}" is on another server; add &remote=1 to the address if you trust the scene`);
    const models = scene.models.map((m) => ({ ...m, file: at(m.file).href })), uprights = scene.cameras.map((c) => c.up);
    return { ...scene, title: scene.title || nameOf(url.href).replace(/\.scene\.json$/, ''), unit: scene.unit || undefined, models,
      up: up ?? (uprights.some((u) => u[1] > Math.abs(u[2])) ? 1 : 2) };
  } catch (error) {
    throw new Error(`${url.pathname.split('/').at(-1)}: ${error.message}`, { cause: error });
  }
}
