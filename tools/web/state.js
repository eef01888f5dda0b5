// The page's state of the open file, which the modules share, and the events between the modules.
export const $ = (id) => document.getElementById(id);

export const state = {
  opening: 0, want: 0, settled: 0, idle: false, info: undefined, scene: undefined, depth: -1, bytesTo: [], timeline: [], stats: undefined, traffic: undefined,
  clip: { axis: undefined, at: 0.5, flip: false }, box: undefined, measured: undefined, probe: undefined, frames: [],
};

// --- formatted numbers ---

export const count = (n) => n.toLocaleString('en');
export const time = (ms) => (ms < 1000 ? `${Math.round(ms)} ms` : `${(ms / 1000).toFixed(2)} s`);
/** Returns a length as text with the file's unit; `power`: 2 for areas. */
export const length = (x, digits = 5, power = 1) => `${Number(x.toPrecision(digits))}${state.info?.unit ? ` ${state.info.unit}${power > 1 ? '²' : ''}` : ''}`;

// --- coordinates ---

// The picture's y axis points upwards; `up` is 2 when the model's z axis does. upright() converts to the picture's axes, fromUpright() back.
export const upright = ([x, y, z], up) => (up === 2 ? [x, z, -y] : [x, y, z]);
export const fromUpright = ([x, y, z], up) => (up === 2 ? [x, -z, y] : [x, y, z]);
export const fromPicture = (p, { center, scale, up }) => fromUpright(p, up).map((x, k) => x / scale + center[k]);
export const toPicture = (p, { center, scale, up }) => upright(p.map((x, k) => (x - center[k]) * scale), up);
export const toModel = (p) => fromPicture(p, state.scene);
export const toScene = (p) => toPicture(p, state.scene);

/** Returns the ray from one point through another, for the worker: origin and direction. */
export const rayThrough = (origin, point) => [...origin, ...point.map((x, k) => x - origin[k])];

// --- events: frame, opened, closed, cut, theme, point, view (the camera has moved), and messages from the worker for modules that are loaded later ---

const listeners = new Map();
export function on(name, listener) {
  listeners.set(name, [...(listeners.get(name) ?? []), listener]);
}
export function emit(name, news) {
  listeners.get(name)?.forEach((listener) => listener(news));
}
