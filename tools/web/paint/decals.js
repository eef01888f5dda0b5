// Draws strokes over the picture. Each point of a stroke is a ball that colours the visible surface inside it. The surface is computed from the depths of
// the picture, so that the resolution of the paint does not depend on the drawn level. When a ball also intersects faces that are not connected with the
// point (format-spec/paint.md, section 4), only the visible parts of the connected faces are coloured: these faces are drawn and compared with the depths.
const VERTEX = `
  attribute vec3 corner, centre, facing;
  attribute vec4 tint; // red, green, blue, radius
  varying vec3 at, outward;
  varying vec4 what;
  void main() {
    at = centre;
    outward = facing;
    what = tint;
    gl_Position = projectionMatrix * viewMatrix * vec4(centre + corner * tint.w * 1.05, 1.0);
  }`;
const FRAGMENT = `
  uniform sampler2D depths;
  uniform vec2 size;
  uniform mat4 back;
  varying vec3 at, outward;
  varying vec4 what;
  void main() {
    vec2 uv = gl_FragCoord.xy / size;
    float z = texture2D(depths, uv).r;
    vec4 p = back * vec4(uv * 2.0 - 1.0, z * 2.0 - 1.0, 1.0);
    vec3 here = p.xyz / p.w, across = dFdx(here), n = cross(across, dFdy(here));
    float away = distance(here, at), soft = min(length(across), 0.2 * what.w);
    float cover = clamp((what.w - away) / max(soft, 1.0e-9) + 0.5, 0.0, 1.0);
    if (z >= 1.0 || cover <= 0.0 || dot(n, outward) < -0.2 * length(n)) discard;
    gl_FragColor = vec4(what.rgb * cover, cover);
  }`;
const REACH_VERTEX = `
  attribute vec3 centre;
  attribute vec4 tint;
  varying vec3 at, face;
  varying vec4 what;
  void main() {
    at = centre;
    face = position;
    what = tint;
    gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
  }`;
const REACH_FRAGMENT = `
  uniform sampler2D depths;
  uniform vec2 size;
  uniform mat4 back;
  uniform float near; // greatest distance in pixels between a face and the surface that is drawn for it
  varying vec3 at, face;
  varying vec4 what;
  void main() {
    vec2 uv = gl_FragCoord.xy / size;
    vec4 p = back * vec4(uv * 2.0 - 1.0, texture2D(depths, uv).r * 2.0 - 1.0, 1.0);
    float away = distance(face, at), pixel = length(dFdx(face)) + length(dFdy(face)), soft = min(pixel, 0.2 * what.w);
    float cover = clamp((what.w - away) / max(soft, 1.0e-9) + 0.5, 0.0, 1.0);
    if (cover <= 0.0 || distance(p.xyz / p.w, face) > near * pixel) discard;
    gl_FragColor = vec4(what.rgb * cover, cover);
  }`;
const ALL_VERTEX = 'varying vec2 uv2; void main() { uv2 = position.xy * 0.5 + 0.5; gl_Position = vec4(position.xy, 0.0, 1.0); }';
const ALL_FRAGMENT = 'uniform sampler2D map; uniform float opacity; varying vec2 uv2; void main() { gl_FragColor = texture2D(map, uv2) * opacity; }';
const CUBE = Float32Array.from([0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) => [0, 1, 2].map((k) => (i >> k & 1 ? 1 : -1))));
const SIDES = [0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5];
const BLENDING = { custom: 5, none: 0, add: 100, zero: 200, one: 201, withoutAlpha: 205 }; // three.js' constants
const FRONT = 0, BACK = 1, DOUBLE = 2;
const NEAR_PIXELS = 2; // for real faces; for envelopes the value is near the size of cells

const CHUNK = 1000; // points of a stroke that are put into the picture together

/**
 * Returns decals of a stroke: the same objects as before for points that have not changed. Overlapping points of a translucent stroke cover only once, so it is one
 * decal. `made`: a WeakMap of earlier decals; isKnown(point): its faces are known; `about`: what else decals depend on; decal(stroke, points): makes a decal.
 */
export function splitStroke(s, made, { isKnown, about, decal }) {
  const size = s.erases || s.colour[3] === 255 ? CHUNK : s.points.length, all = [];
  for (let i = 0; i < s.points.length; i += size) {
    const points = s.points.slice(i, i + size), known = points.reduce((sum, p) => sum + isKnown(p), 0), last = points.at(-1), before = made.get(points[0]);
    const what = [points.length, known, s.erases, s.radius, about, ...s.colour].join();
    const now = before?.what === what && before.last === last ? before : { what, last, decal: decal(s, points) };
    made.set(points[0], now);
    all.push(now.decal);
  }
  return all;
}

export class Decals {
  constructor(kit) {
    this.kit = kit;
    this.near = () => 0; // returns the current distance limit between faces and the drawn surface, in pixels
    this.layers = []; // { opacity, runs: [{ meshes, erases, alpha }] }
    this.uniforms = { depths: { value: null }, size: { value: null }, back: { value: new kit.Matrix4() }, near: { value: NEAR_PIXELS } };
    const blend = (source) => ({ blending: BLENDING.custom, blendEquation: BLENDING.add, blendSrc: source, blendDst: BLENDING.withoutAlpha, blendSrcAlpha: source,
      blendDstAlpha: BLENDING.withoutAlpha });
    const ball = (source) => new kit.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: this.uniforms, side: BACK, depthTest: false, depthWrite: false,
      transparent: true, ...blend(source) });
    const reach = (source) => new kit.ShaderMaterial({ vertexShader: REACH_VERTEX, fragmentShader: REACH_FRAGMENT, uniforms: this.uniforms, side: FRONT, depthTest: false, depthWrite: false,
      transparent: true, ...blend(source) });
    this.paints = ball(BLENDING.one);
    this.erases = ball(BLENDING.zero);
    this.reachPaints = reach(BLENDING.one);
    this.reachErases = reach(BLENDING.zero);
    this.over = new kit.ShaderMaterial({ vertexShader: ALL_VERTEX, fragmentShader: ALL_FRAGMENT, uniforms: { map: { value: null }, opacity: { value: 1 } }, depthTest: false, depthWrite: false,
      transparent: true, ...blend(BLENDING.one) });
    const geometry = new kit.BufferGeometry();
    geometry.setAttribute('position', new kit.BufferAttribute(Float32Array.of(-1, -1, 0, 3, -1, 0, -1, 3, 0), 3));
    this.all = new kit.Scene();
    const triangle = new kit.Mesh(geometry, this.over);
    triangle.frustumCulled = false;
    this.all.add(triangle);
    this.corner = new kit.BufferAttribute(CUBE, 3);
    this.one = new kit.Scene();
  }

  get any() {
    return this.layers.length > 0;
  }

  resize() {
    for (const name of ['sum', 'layer', 'stroke'])
      this[name]?.dispose();
    this.sum = this.layer = this.stroke = undefined;
  }

  /**
   * Sets the layers to draw, lowest first: [{ opacity (0 to 1), strokes: [{ erases, colour, radius, points: [{ centre, normal, faces, share }] }] }], in scene
   * coordinates. `share`: of the stroke's radius. `faces`: nine numbers each; if present, only these faces are coloured instead of everything inside the ball.
   * `solid`: true when backs of faces are never visible. Strokes that are the same objects as before, in the same order, are not uploaded again.
   */
  set(layers, solid = true) {
    this.reachPaints.side = this.reachErases.side = solid ? FRONT : DOUBLE;
    const before = new Map(this.layers.flatMap((layer) => layer.runs).map((run) => [run.strokes[0], run]));
    this.layers = layers.map(({ opacity, strokes }) => ({ opacity, runs: this.#runs(strokes, before) })).filter((layer) => layer.runs.length);
    before.forEach((run) => run.meshes.forEach((mesh) => mesh.geometry.dispose()));
  }

  // Groups strokes: consecutive opaque strokes are drawn together. A translucent stroke is drawn separately, because its overlapping balls must cover only once. So is the
  // last stroke, because a pen adds points to it. Takes equal runs from `before`, by their first strokes.
  #runs(strokes, before) {
    const runs = [];
    strokes.forEach((stroke, i) => {
      const alpha = stroke.erases ? 255 : stroke.colour[3], last = runs.at(-1);
      if (last && last.erases === stroke.erases && alpha === 255 && last.alpha === 255 && i < strokes.length - 1)
        last.strokes.push(stroke);
      else
        runs.push({ erases: stroke.erases, alpha, strokes: [stroke] });
    });
    return runs.filter((run) => run.alpha > 0).map((run) => {
      const same = before.get(run.strokes[0]);
      if (same?.strokes.length === run.strokes.length && same.strokes.every((stroke, i) => stroke === run.strokes[i])) {
        before.delete(run.strokes[0]);
        return same;
      }
      return { ...run, meshes: [this.#balls(run), this.#reach(run)].filter(Boolean) };
    });
  }

  // Returns a mesh of the faces of points that have `faces`, or undefined when there are none.
  #reach({ strokes, erases }) {
    const { kit } = this, all = strokes.flatMap(({ colour, radius, points }) => points.filter((p) => p.faces?.length).map((p) => ({ ...p, tint: [...colour.slice(0,
      3).map((c) => c / 255), radius * p.share] })));
    const corners = all.reduce((sum, p) => sum + p.faces.length / 3, 0), position = new Float32Array(3 * corners), centre = new Float32Array(3 * corners), tint = new Float32Array(4 * corners);
    if (!corners)
      return undefined;
    let i = 0;
    for (const p of all) {
      position.set(p.faces, 3 * i);
      for (let end = i + p.faces.length / 3; i < end; i++) {
        centre.set(p.centre, 3 * i);
        tint.set(p.tint, 4 * i);
      }
    }
    const geometry = new kit.BufferGeometry();
    for (const [name, array, size] of [['position', position, 3], ['centre', centre, 3], ['tint', tint, 4]])
      geometry.setAttribute(name, new kit.BufferAttribute(array, size));
    const mesh = new kit.Mesh(geometry, erases ? this.reachErases : this.reachPaints);
    mesh.frustumCulled = false;
    return mesh;
  }

  // Returns a mesh of the balls of all other points.
  #balls({ strokes: all, erases }) {
    const strokes = all.map((s) => ({ ...s, points: s.points.filter((p) => !p.faces) }));
    const { kit } = this, count = strokes.reduce((sum, s) => sum + s.points.length, 0), centre = new Float32Array(3 * count), facing = new Float32Array(3 * count), tint = new Float32Array(4 * count);
    let i = 0;
    for (const { colour, radius, points } of strokes)
      for (const p of points) {
        centre.set(p.centre, 3 * i);
        facing.set(p.normal ?? [0, 0, 0], 3 * i);
        tint.set([colour[0] / 255, colour[1] / 255, colour[2] / 255, radius * p.share], 4 * i++);
      }
    const geometry = new kit.InstancedBufferGeometry();
    geometry.setIndex(SIDES);
    geometry.setAttribute('corner', this.corner);
    geometry.setAttribute('position', this.corner);
    for (const [name, array, size] of [['centre', centre, 3], ['facing', facing, 3], ['tint', tint, 4]])
      geometry.setAttribute(name, new kit.InstancedBufferAttribute(array, size));
    geometry.instanceCount = count;
    const mesh = new kit.Mesh(geometry, erases ? this.erases : this.paints);
    mesh.frustumCulled = false;
    return mesh;
  }

  /** Draws points of all kinds without size, and the probe, so that no shader is compiled later. Replaces the layers. */
  warmUp(scene) {
    const points = [{ centre: [0, 0, 0], share: 0 }, { centre: [0, 0, 0], share: 0, faces: new Float32Array(9) }];
    this.set([{ opacity: 1, strokes: [255, 128].map((alpha) => ({ erases: false, colour: [0, 0, 0, alpha], radius: 0, points })) }]);
    scene.showProbe([0, 0, 0], [0, 0, 0]);
    scene.draw();
    scene.showProbe();
  }

  /** Draws all layers into a texture: sRGB, premultiplied by alpha. */
  render(renderer, camera, depths, size) {
    const { kit } = this, target = () => new kit.WebGLRenderTarget(size.x, size.y, { depthBuffer: false });
    this.sum ??= target();
    this.uniforms.depths.value = depths;
    this.uniforms.size.value = size;
    this.uniforms.near.value = Math.max(NEAR_PIXELS, this.near());
    this.uniforms.back.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).invert();
    const clear = renderer.autoClear;
    renderer.autoClear = false;
    this.#begin(renderer, this.sum);
    for (const { opacity, runs } of this.layers) {
      const straight = opacity === 1 && runs.every((run) => !run.erases), own = straight ? this.sum : (this.layer ??= target());
      if (!straight)
        this.#begin(renderer, own);
      for (const run of runs)
        this.#run(renderer, camera, run, own, target);
      if (!straight)
        this.#add(renderer, camera, own, this.sum, opacity);
    }
    renderer.autoClear = clear;
    return this.sum.texture;
  }

  #begin(renderer, target) {
    renderer.setRenderTarget(target);
    renderer.clear();
  }

  #run(renderer, camera, { meshes, erases, alpha }, own, target) {
    const alone = !erases && alpha < 255, to = alone ? (this.stroke ??= target()) : own;
    if (alone)
      this.#begin(renderer, to);
    renderer.setRenderTarget(to);
    this.one.add(...meshes);
    renderer.render(this.one, camera);
    this.one.remove(...meshes);
    if (alone)
      this.#add(renderer, camera, to, own, alpha / 255);
  }

  #add(renderer, camera, from, to, opacity) {
    this.over.uniforms.map.value = from.texture;
    this.over.uniforms.opacity.value = opacity;
    renderer.setRenderTarget(to);
    renderer.render(this.all, camera);
  }
}
