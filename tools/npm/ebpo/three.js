// Picking with three.js: a function for `raycast` of an Object3D. This file does not import three.
import { EbpoPendingError } from './errors.js';

const SIDES = ['front', 'back', 'both']; // FrontSide, BackSide, DoubleSide of three

/** Returns the face of three's geometry, if it has the faces of the model: indices of its corners, and its normal. */
function faceOf({ index, attributes: { position } }, face, vector) {
  const [a, b, c] = [0, 1, 2].map((i) => index.getX(3 * face + i)), [p, q, r] = [a, b, c].map((i) => vector.clone().fromBufferAttribute(position, i));
  return { a, b, c, materialIndex: 0, normal: q.sub(p).cross(r.sub(p)).normalize() };
}

/**
 * Returns a function for `raycast` of an Object3D in the model's coordinates, which three's Raycaster then calls:
 *   object.raycast = raycastOf(model);
 * As with three-mesh-bvh, `firstHitOnly` of the raycaster selects the first intersection. `face` is null unless the object's
 * geometry is indexed. A ray that needs bytes that are not in memory has no intersections; the bytes are fetched, and
 * then `ready` is called.
 */
export const raycastOf = (model, { ready = () => {} } = {}) => function raycast(raycaster, intersects) {
  const { ray, near, far } = raycaster, inverse = this.matrixWorld.clone().invert();
  const start = ray.origin.clone().addScaledVector(ray.direction, near), from = start.clone().applyMatrix4(inverse);
  const { x, y, z } = ray.direction, direction = [0, 1, 2].map((k) => inverse.elements[k] * x + inverse.elements[k + 4] * y + inverse.elements[k + 8] * z);
  const options = { tMax: far - near, sides: SIDES[this.material?.side ?? 2] }, first = raycaster.firstHitOnly === true;
  const line = [...from.toArray(), ...direction]; // t is a length in the world
  let hits;
  try {
    hits = first ? model.raysSync(line, options) : model.raysAllSync(line, options);
  } catch (error) {
    if (!(error instanceof EbpoPendingError))
      throw error;
    model[first ? 'rays' : 'raysAll'](line, options).then(ready, () => {});
    return;
  }
  hits.t.forEach((t, i) => {
    if (t < Infinity)
      intersects.push({ distance: near + t, point: start.clone().addScaledVector(ray.direction, t), object: this, faceIndex: hits.face[i],
        face: this.geometry?.index ? faceOf(this.geometry, hits.face[i], start) : null });
  });
};
