// Writes views to addresses and reads views from addresses. A length of 1 is half the diagonal of the model's box, as in the scene (cut.js);
// the origin is the centre of the box.
//   view=AZIMUTH,HEIGHT,DISTANCE[,X,Y,Z]   the first two in degrees: around y from z, and above the horizon; distance of the eye
//                                          from the target; the target X,Y,Z
//   clip=x0.25 or -x0.25                   a clipping plane at a share of the box's side; shows the part below the plane,
//                                          or with the minus sign the part above
//   box=X0,Y0,Z0,X1,Y1,Z1                  the visible box, in shares of the box's sides
//   point=X,Y,Z                            the queried point, in the model's coordinates
//   measure=X,Y,Z,X,Y,Z,...                points whose distances are shown, in the model's coordinates
const DEGREES = 180 / Math.PI;

const numbers = (text, ...counts) => {
  const list = (text ?? '').split(',').map((word) => (word.trim() ? Number(word) : NaN));
  return list.every(Number.isFinite) && (counts.length === 0 || counts.includes(list.length)) ? list : undefined;
};
const short = (x, digits) => String(Number(x.toFixed(Math.max(0, Math.min(12, digits)))));

/** Returns { eye, target }, or undefined when the text is not a view. */
export function cameraOf(text) {
  const [azimuth, height, distance, ...target] = numbers(text, 3, 6) ?? [];
  if (!(distance > 0 && distance < 100 && Math.abs(height) <= 90))
    return undefined;
  const at = target.length ? target : [0, 0, 0], a = azimuth / DEGREES, h = Math.min(Math.abs(height), 89.99) * Math.sign(height) / DEGREES;
  return { target: at, eye: [Math.sin(a) * Math.cos(h), Math.sin(h), Math.cos(a) * Math.cos(h)].map((x, k) => at[k] + distance * x) };
}

export function cameraText({ eye, target }) {
  const d = eye.map((x, k) => x - target[k]), distance = Math.hypot(...d), digits = 3 - Math.floor(Math.log10(distance));
  const angles = [Math.atan2(d[0], d[2]), Math.asin(Math.max(-1, Math.min(1, d[1] / distance)))].map((x) => short(x * DEGREES, 1));
  const at = target.map((x) => short(x, digits));
  return [...angles, short(distance, digits), ...(at.every((x) => Number(x) === 0) ? [] : at)].join(',');
}

/** Returns the clipping plane { axis, at (0 to 1), flip }, or undefined when the text is not a plane. */
export function clipOf(text) {
  const found = /^(-?)([xyz])(\d*\.?\d+)$/.exec(text ?? ''), at = Number(found?.[3]);
  return found && at <= 1 ? { axis: 'xyz'.indexOf(found[2]), at, flip: found[1] === '-' } : undefined;
}

export const clipText = ({ axis, at, flip }) => (axis === undefined ? undefined : `${flip ? '-' : ''}${'xyz'[axis]}${short(at, 3)}`);

/** Returns six shares, the lower corner and then the upper corner, or undefined when the text is not a box. */
export function boxOf(text) {
  const box = numbers(text, 6);
  return box && box.every((x) => x >= 0 && x <= 1) && [0, 1, 2].every((k) => box[k] < box[k + 3]) ? box : undefined;
}

export const boxText = (box) => (box?.some((x, i) => x !== (i < 3 ? 0 : 1)) ? box.map((x) => short(x, 3)).join(',') : undefined);

/** Returns the visible part of a model's box, given a clipping plane and a section box: corners { low, high } in the scene; undefined for the whole box. */
export function cutOf(size, scale, clip, box) {
  const low = box?.slice(0, 3) ?? [0, 0, 0], high = box?.slice(3) ?? [1, 1, 1], k = clip?.axis;
  if (k !== undefined && clip.flip)
    low[k] = Math.max(low[k], clip.at);
  else if (k !== undefined)
    high[k] = Math.min(high[k], clip.at);
  if (k === undefined && low.every((x) => x <= 0) && high.every((x) => x >= 1))
    return undefined;
  const inScene = (share, axis) => (share <= 0 && axis !== k ? -BEYOND : share >= 1 && axis !== k ? BEYOND : (share - 0.5) * size[axis] * scale);
  return { low: low.map((x, axis) => (axis === k && !clip.flip && x <= 0 ? -BEYOND : inScene(x, axis))), high: high.map((x, axis) => (axis === k && clip.flip &&
    x >= 1 ? BEYOND : inScene(x, axis))) };
}
const BEYOND = 9; // of the scene, which is 1 in size

const POINTS_MOST = 1000; // limits untrusted addresses, because each point is drawn

export function pointsOf(text) {
  const list = numbers(text);
  return list && list.length % 3 === 0 && list.length <= 3 * POINTS_MOST ? Array.from({ length: list.length / 3 }, (_, i) => list.slice(3 * i, 3 * i + 3)) : undefined;
}

/** Returns points as text, rounded to a millionth of `diagonal` or finer. */
export function pointsText(points, diagonal) {
  const digits = 6 - Math.floor(Math.log10(diagonal));
  return points.flatMap((p) => p.map((x) => short(x, digits))).join(',');
}

/** Returns the address with replaced parameters. `entries`: [name, text] each; undefined as text removes the parameter. Commas are not escaped. */
export function withQuery(href, entries) {
  const url = new URL(href);
  for (const [name, text] of entries)
    if (text === undefined || text === '')
      url.searchParams.delete(name);
    else
      url.searchParams.set(name, text);
  url.search = url.search.replaceAll('%2C', ',').replaceAll('%2F', '/').replaceAll('%3A', ':');
  return url.href;
}
