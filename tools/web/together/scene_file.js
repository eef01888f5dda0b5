// Reads scene files (format-spec/scene.md): models, instances, routes and cameras. The page does not use the members ignore and clearance, which are only
// for queries, and does not check their values.
import { AT_HOME, placed, quaternionOf, routeAt, unitQuaternion } from './poses.js';
import { parseStrict } from './strict_json.js';

export const MOST = { bytes: 64 << 20, instances: 100_000, models: 1000, keys: 1_000_000 }; // bytes: of the scene together with all files of poses
const SCALE_MOST = 2 ** 300, TIME_MOST = 2 ** 1000, LIKE_ROTATION = 2 ** -20;

const refuse = (where, what) => {
  throw new Error(`${where}: ${what}; see format-spec/scene.md, or run ebpo scene info on the file`);
};
const must = (good, where, what) => good || refuse(where, what);
const isObject = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

// Returns an object after checking that its members are among `names` or begin with `x-`.
function members(value, where, names) {
  must(isObject(value), where, 'is not an object');
  for (const name of Object.keys(value))
    must(names.includes(name) || name.startsWith('x-'), where, `has a member ${JSON.stringify(name)} that the format does not have`);
  return value;
}
const list = (value, where) => (value === undefined ? [] : Array.isArray(value) ? value : refuse(where, 'is not an array'));
function number(value, where, most = Infinity) {
  must(Number.isFinite(value) && Math.abs(value) <= most, where, 'is not a number in range');
  return value;
}
function numbers(value, where, count) {
  must(Array.isArray(value) && value.length === count, where, `is not ${count} numbers`);
  return value.map((x, i) => number(x, `${where}[${i}]`));
}
function text(value, where) {
  must(typeof value === 'string', where, 'is not a string');
  return value;
}
function name(value, where) {
  // eslint-disable-next-line no-control-regex
  must(typeof value === 'string' && value.length > 0 && new TextEncoder().encode(value).length <= 255 && !/[\u0000-\u001f\u007f]/.test(value), where, 'is not a name');
  must(value !== '*' && !/^(layer|group):/.test(value), where, `"${value}" cannot be a name`);
  return value;
}
const unique = (names, where) => must(new Set(names).size === names.length, where, 'has a name twice');

function rotationOf(r, where) {
  for (let i = 0; i < 3; i++)
    for (let k = i; k < 3; k++) {
      const off = Math.abs(r[i] * r[k] + r[3 + i] * r[3 + k] + r[6 + i] * r[6 + k] - (i === k ? 1 : 0));
      must(off <= LIKE_ROTATION, where, `is not a rotation: off by ${off.toPrecision(2)}`);
    }
  const det = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
  must(det > 0, where, 'is a mirror, not a rotation');
  return r;
}

/** Returns a pose of a file. Adds `turn`, the rotation as a quaternion of length 1. */
export function poseOf(value, where) {
  const p = members(value === undefined ? {} : value, where, ['translation', 'scale', 'rotation', 'quaternion']);
  must(p.rotation === undefined || p.quaternion === undefined, where, 'has both a rotation and a quaternion');
  const scale = p.scale === undefined ? 1 : number(p.scale, `${where}.scale`);
  must(scale >= 1 / SCALE_MOST && scale <= SCALE_MOST, `${where}.scale`, 'is not from 2^-300 to 2^300');
  const rotation = p.rotation === undefined ? undefined : rotationOf(numbers(p.rotation, `${where}.rotation`, 9), `${where}.rotation`);
  const turn = rotation ? quaternionOf(rotation) : unitQuaternion(p.quaternion === undefined ? [0, 0, 0, 1] : numbers(p.quaternion, `${where}.quaternion`, 4));
  must(turn !== undefined, `${where}.quaternion`, 'is 0');
  const translation = p.translation === undefined ? [0, 0, 0] : numbers(p.translation, `${where}.translation`, 3);
  return { ...routeAt({ keys: [{ time: 0, turn, scale, translation }] }, 0), ...(rotation && { rotation }), turn };
}

// --- routes ---

function csvKeys(csv, where) {
  const lines = csv.replace(/^\ufeff/, '').split(/\r?\n/).filter((line) => line.trim()), cells = (line) => line.split(/[,;]/).map((cell) => cell.trim()), [head] = lines;
  must(head !== undefined, where, 'is empty');
  const columns = cells(head), needed = ['time', 'x', 'y', 'z', 'qx', 'qy', 'qz', 'qw'];
  unique(columns, where);
  must(needed.every((c) => columns.includes(c)) && columns.every((c) => [...needed, 'scale'].includes(c)), `${where}: line 1`,
    'does not name the columns time, x, y, z, qx, qy, qz, qw and optionally scale');
  return lines.slice(1).map((line, i) => {
    const at = `${where}: line ${i + 2}`, row = cells(line).map((cell) => number(cell === '' ? NaN : Number(cell), at)), of = (c) => row[columns.indexOf(c)];
    must(row.length === columns.length, at, `does not have ${columns.length} numbers`);
    return { time: of('time'), pose: poseOf({ translation: [of('x'), of('y'), of('z')], quaternion: [of('qx'), of('qy'), of('qz'), of('qw')], scale: of('scale') ?? 1 }, at) };
  });
}

// Returns a path within the scene's folder. Files of poses have no digests and are therefore not read from other servers.
function nearPath(value, where) {
  const path = pathOf(value, where);
  must(!isFar(path), where, 'is on a server: files of poses must be in the scene\'s folder');
  return path;
}

async function routeOf(value, where, fetchText) {
  const r = members(value, where, ['keys', 'poses', 'csv', 'begin', 'step', 'between']);
  must([r.keys, r.poses, r.csv].filter((x) => x !== undefined).length === 1, where, 'needs exactly one of keys, poses, csv');
  must(r.between === undefined || ['even', 'jump'].includes(r.between), `${where}.between`, 'is neither even nor jump');
  must(r.poses !== undefined || (r.begin === undefined && r.step === undefined), where, 'has begin or step without poses');
  let keys;
  if (r.csv !== undefined)
    keys = csvKeys(await fetchText(nearPath(r.csv, `${where}.csv`)), r.csv);
  else if (r.poses !== undefined)
    keys = list(r.poses, `${where}.poses`).map((pose, i) => ({ time: number(r.begin === undefined ? 0 : r.begin, `${where}.begin`) + i * number(r.step, `${where}.step`),
      pose: poseOf(pose, `${where}.poses[${i}]`) }));
  else
    keys = list(r.keys, `${where}.keys`).map((key, i) => {
      const at = `${where}.keys[${i}]`, { time, pose } = members(key, at, ['time', 'pose']);
      return { time: number(time, `${at}.time`), pose: poseOf(pose, `${at}.pose`) };
    });
  must(keys.length > 0, where, 'has no keys');
  keys.forEach(({ time }, i) => must(Math.abs(time) <= TIME_MOST && (i === 0 || time > keys[i - 1].time), where, `key ${i}: times do not ascend`));
  return { jumps: r.between === 'jump', keys: keys.map(({ time, pose: { turn, scale, translation } }) => ({ time, turn, scale, translation })) };
}

/** Returns true when a path is an address, not a path within the scene's folder. */
export const isFar = (path) => /^https?:\/\//i.test(path);

/** Returns a path within the scene's folder, or an address. `where`: the path's position in the scene, for errors. */
function pathOf(value, where) {
  const path = text(value, where);
  if (isFar(path))
    return path;
  must(path !== '' && !/^([/\\]|[a-z][a-z0-9+.-]*:)/i.test(path) && !path.split(/[/\\]/).includes('..'), where, `"${path}" leads out of the scene's folder`);
  return path;
}

// --- the scene ---

const named = (value, where) => members(value === undefined ? {} : value, where, Object.keys(value ?? {})); // allows any names of members
const declared = (value, where, known, kind) => must(known.has(value), where, `"${value}" is not a ${kind} of this scene`);

function modelOf(key, value) {
  const where = `models.${name(key, 'models')}`, m = members(value, where, ['file', 'content_sha256', 'subset_of']), file = pathOf(m.file, `${where}.file`);
  must(m.content_sha256 === undefined || /^[0-9a-f]{64}$/.test(m.content_sha256), `${where}.content_sha256`, 'is not 64 hexadecimal digits');
  must(m.content_sha256 !== undefined || !isFar(file), where, 'is on a server, but has no content_sha256');
  return { name: key, file, digest: m.content_sha256 };
}

async function routesOf(value, fetchText) {
  const routes = new Map();
  let keys = 0;
  for (const [key, route] of Object.entries(named(value, 'routes'))) {
    routes.set(name(key, 'routes'), await routeOf(route, `routes.${key}`, fetchText));
    keys += routes.get(key).keys.length;
    must(keys <= MOST.keys, 'routes', `have more than ${MOST.keys} keys, the most that this page shows`);
  }
  return routes;
}

function instanceOf(value, where, { models, layers, groups, routes }) {
  const one = members(value, where, ['name', 'model', 'pose', 'route', 'layer', 'groups', 'fixed']);
  must(one.fixed === undefined || typeof one.fixed === 'boolean', `${where}.fixed`, 'is neither true nor false');
  must(!(one.fixed && one.route !== undefined), where, 'is fixed and has a route');
  declared(one.model, `${where}.model`, models, 'model');
  if (one.route !== undefined)
    declared(one.route, `${where}.route`, routes, 'route');
  if (one.layer !== undefined)
    declared(one.layer, `${where}.layer`, layers, 'layer');
  list(one.groups, `${where}.groups`).forEach((n) => declared(n, `${where}.groups`, groups, 'group'));
  return { name: name(one.name, `${where}.name`), model: models.get(one.model), layer: one.layer, pose: poseOf(one.pose, `${where}.pose`), route: routes.get(one.route) };
}

// Returns the times of the first and the last key of all routes.
function timesOf(instances) {
  const routes = new Set(instances.map(({ route }) => route).filter(Boolean));
  let from = Infinity, to = -Infinity;
  for (const { keys } of routes) {
    from = Math.min(from, keys[0].time);
    to = Math.max(to, keys.at(-1).time);
  }
  return routes.size ? { from, to } : { from: 0, to: 0 };
}

/**
 * Reads a scene from a file's text. Returns { title, unit, models: [{ name, file, digest }], layers, instances: [{ name, model (its index), layer, pose, route }],
 * cameras, from, to }. `from` and `to` are the first and last time of all keys, equal when nothing moves. `fetchText(path)` fetches files of poses. Throws an
 * Error with the position and the problem.
 */
export async function readScene(source, fetchText) {
  must(source.length <= MOST.bytes, 'the scene', 'is larger than 64 MiB');
  let json;
  try {
    json = parseStrict(source.replace(/^\ufeff/, ''));
  } catch (error) {
    throw new Error(`not JSON as scenes require (${error.message}); give a scene file`);
  }
  const s = members(json, 'the scene', ['ebpo_scene', 'title', 'unit', 'models', 'layers', 'groups', 'routes', 'instances', 'cameras', 'ignore', 'clearance']);
  must(typeof s.ebpo_scene === 'string' && /^1\.\d+$/.test(s.ebpo_scene), 'ebpo_scene', 'is not 1.0: the file is not a scene, or is newer than this page');
  const files = Object.entries(named(s.models, 'models')), all = list(s.instances, 'instances');
  must(all.length <= MOST.instances && files.length <= MOST.models, 'the scene', `has more than ${MOST.instances} instances or ${MOST.models} models, the most that this page shows`);
  const models = files.map(([key, value]) => modelOf(key, value)), [layers, groups] = ['layers', 'groups'].map((kind) => list(s[kind], kind).map((n, i) => name(n, `${kind}[${i}]`)));
  unique(layers, 'layers');
  unique(groups, 'groups');
  const routes = await routesOf(s.routes, fetchText), known = { models: new Map(models.map((m, i) => [m.name, i])), layers: new Set(layers), groups: new Set(groups), routes };
  const instances = all.map((value, i) => instanceOf(value, `instances[${i}]`, known)), cameras = list(s.cameras, 'cameras').map((value, i) => cameraOf(value, `cameras[${i}]`, routes));
  unique(instances.map((i) => i.name), 'instances');
  return { title: s.title === undefined ? '' : text(s.title, 'title'), unit: s.unit === undefined ? '' : text(s.unit, 'unit'), models, layers, instances, cameras, ...timesOf(instances) };
}

function cameraOf(value, where, routes) {
  const c = members(value, where, ['name', 'eye', 'target', 'up', 'fov', 'pixels', 'route']);
  must(c.route === undefined || routes.has(c.route), `${where}.route`, 'is not a route of this scene');
  return { name: name(c.name, `${where}.name`), eye: numbers(c.eye, `${where}.eye`, 3), target: numbers(c.target, `${where}.target`, 3),
    up: c.up === undefined ? [0, 0, 1] : numbers(c.up, `${where}.up`, 3), route: routes.get(c.route) };
}

/** Returns a camera's eye and target at a time. */
export function cameraAt({ eye, target, route }, time) {
  const pose = route ? routeAt(route, time) : AT_HOME;
  return { eye: placed(pose, eye), target: placed(pose, target) };
}
