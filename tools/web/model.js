// A model for any three.js scene: an Object3D with more detail in the view of the camera. Its coordinates are those of the file.
import { Box3, DoubleSide, Group, MeshStandardMaterial, Object3D, Vector3 } from 'three';
import { Client, Crew } from './client.js';
import { NO_HUE, Tiles, lookOf, makeLook, setCut } from './shade.js';
import { sharesOf, weightOf } from './together/budget.js';

const TRIANGLES_MOST = 2_000_000, PIXELS = 12;

const BEND = `
  attribute vec2 bend;
  attribute vec4 tag, hue;
  varying vec3 ebpoHue, ebpoPlace;
  varying float ebpoWeight;
  vec3 ebpoUnbent() { // octahedral
    vec3 n = vec3(bend, 1.0 - abs(bend.x) - abs(bend.y));
    if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    return normalize(n);
  }`;
const LIGHT = 'mix(hue.rgb / 12.92, pow((hue.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, hue.rgb))';

/** Returns a MeshStandardMaterial that evaluates the attributes of the tiles and is lit by the scene's lights. `parameters`: as for its constructor. */
export function standardMaterial(parameters = {}, { low, high, clipping, own } = makeLook().uniforms) {
  const material = new MeshStandardMaterial({ color: '#c9cdd6', roughness: 0.75, metalness: 0, side: DoubleSide, ...parameters });
  material.defaultAttributeValues = NO_HUE;
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, { ebpoLow: low, ebpoHigh: high, ebpoClipping: clipping, ebpoOwn: own });
    shader.vertexShader = shader.vertexShader.replace('#include <common>', `#include <common>${BEND}`)
      .replace('#include <beginnormal_vertex>', 'vec3 objectNormal = ebpoUnbent(); ebpoWeight = tag.z / 255.0;')
      .replace('#include <begin_vertex>', `#include <begin_vertex>\nebpoPlace = position; ebpoHue = hue.w < 0.5 ? ${LIGHT} : vec3(-1.0);`);
    shader.fragmentShader = shader.fragmentShader.replace('#include <common>', `#include <common>
      varying vec3 ebpoHue, ebpoPlace;
      varying float ebpoWeight;
      uniform vec3 ebpoLow, ebpoHigh;
      uniform bool ebpoClipping, ebpoOwn;`)
      .replace('#include <clipping_planes_fragment>', `#include <clipping_planes_fragment>
      if (ebpoClipping && (any(lessThan(ebpoPlace, ebpoLow)) || any(greaterThan(ebpoPlace, ebpoHigh)))) discard;`)
      .replace('#include <color_fragment>', '#include <color_fragment>\nif (ebpoOwn && ebpoHue.r >= 0.0) diffuseColor.rgb = ebpoHue;')
      .replace('#include <normal_fragment_begin>', `#include <normal_fragment_begin>
      { // where the field of normals is weak, the polygon's normal is used
        vec3 flatly = normalize(cross(dFdx(vViewPosition), dFdy(vViewPosition)));
        normal = normalize(mix(flatly, normal, min(ebpoWeight, 1.0)) + 0.0001 * flatly);
      }`);
  };
  material.customProgramCacheKey = () => 'ebpo';
  return material;
}

const heightOf = (renderer) => (typeof renderer === 'number' ? renderer : renderer.domElement.clientHeight);

export class EbpoModel extends Object3D {
  /**
   * All options are optional. `worker`: the address of worker.js. `material`: 'standard' (lit by the scene's lights), 'viewer' (shaded as on the viewer's page)
   * or a result of standardMaterial(). `crew`: workers shared with other models; EbpoGroup has a crew. `detail`, `level`, `mesh`, `triangles`: initial values of
   * the members with these names.
   */
  constructor({ worker, crew, material = 'standard', detail = PIXELS, level = Infinity, mesh = true, triangles = TRIANGLES_MOST } = {}) {
    super();
    this.type = 'EbpoModel';
    Object.assign(this, { detail, level, mesh, triangles });
    this.info = undefined;                  // the root attributes of the open file, by the format's names
    this.content = new Group();             // the drawn objects, in the scene's coordinates (cut.js)
    this.content.matrixAutoUpdate = false;
    this.add(this.content);
    this.look = makeLook();
    if (material !== 'viewer')
      this.look.faces = material === 'standard' ? standardMaterial({}, this.look.uniforms) : material;
    this.tiles = new Tiles(this.content, this.look);
    this.client = new Client({ worker, crew, heard: (type, news) => this.#hear(type, news) });
  }

  get material() {
    return this.look.faces;
  }

  #hear(type, news) {
    if (type === 'tiles') {
      this.tiles.set(news.set, news.removed);
      this.dispatchEvent({ type: 'change', stats: news.stats });
    } else if (type === 'line') {
      this.dispatchEvent({ type: 'progress', got: news.got, want: news.want, quiet: news.quiet });
    } else if (type === 'idle') {
      if (news.want === this.client.want)
        this.dispatchEvent({ type: 'idle', traffic: news.traffic });
    } else if (type === 'failed') {
      this.dispatchEvent({ type: 'error', error: news.error });
    }
  }

  /** Opens an address, a File or a Blob. Resolves to `info` when the file's header has been read. Errors have a `code`, and a message that says what to do. */
  async load(what) {
    this.tiles.clear();
    this.info = undefined;
    const { info, scene } = await this.client.open(what);
    this.info = info;
    this.content.matrix.makeScale(1 / scene.scale, 1 / scene.scale, 1 / scene.scale).setPosition(...scene.center);
    this.content.matrixWorldNeedsUpdate = true;
    this.clip = this.cut;
    this.dispatchEvent({ type: 'load', info });
    return info;
  }

  /** The box of the root cell, in this object's coordinates. The box contains the model. */
  get box() {
    const { box_origin: low, box_size: size } = this.info;
    return new Box3(new Vector3(...low), new Vector3(...low.map((x, k) => x + size[k])));
  }

  /** Sends the current view to the worker; call it before each frame. `renderer`: the renderer, or the picture's height in CSS pixels. The call is cheap when nothing has moved. */
  update(camera, renderer) {
    if (!this.info)
      return;
    this.updateWorldMatrix(true, true);
    const height = heightOf(renderer), { level, mesh, detail, triangles, info } = this;
    const faces = mesh && level >= info.level_count && info.parts.has('mesh');
    this.client.look(lookOf(camera, height, this.content.matrixWorld),
      { level: Math.min(level, 99), mesh: faces, surface: level >= info.level_count, pixels: detail,
        triangles: detail === 0 ? Infinity : triangles, black: this.cut !== undefined, lines: false, cells: false });
  }

  /** Shows only the part of the model inside a Box3, in this object's coordinates; undefined shows the whole model. */
  set clip(box) {
    this.cut = box;
    if (!this.info)
      return;
    const { center, scale } = this.client.scene, of = (v) => v.toArray().map((x, k) => Math.max(-9, Math.min(9, (x - center[k]) * scale)));
    setCut(this.look, box && of(box.min), box && of(box.max));
  }

  get clip() {
    return this.cut;
  }

  /** Queries a point (Vector3) in this object's coordinates: { where, distance, nearest, lo, hi, exact }. */
  async probe(point) {
    const { where, distance, nearest, lo, hi, exact } = await this.client.probe(point.toArray());
    return { where, distance, nearest: nearest && new Vector3(...nearest), lo, hi, exact };
  }

  /** Returns the first point (Vector3) of the faces on a THREE.Ray, in this object's coordinates; undefined: none. */
  async hit({ origin, direction }) {
    const point = await this.client.hit([...origin.toArray(), ...direction.toArray()]);
    return point && new Vector3(...point);
  }

  /** Terminates the worker and frees the memory of the graphics card. */
  dispose() {
    this.client.end();
    this.tiles.clear();
    [this.look.faces, this.look.wire, this.look.cells].forEach((material) => material.dispose());
  }
}

/** Several models that share workers and a budget of triangles. A model's share depends on its size in the picture. The caller places the models. */
export class EbpoGroup extends Group {
  /** `triangles`: approximate limit for all models together; `worker`: the address of worker.js; `workers`: the greatest number of workers. */
  constructor({ triangles = TRIANGLES_MOST, worker, workers } = {}) {
    super();
    this.type = 'EbpoGroup';
    this.triangles = triangles;
    this.crew = new Crew({ ...(worker && { worker }), ...(workers && { most: workers }) });
  }

  /** Creates an EbpoModel in this group. `options`: as for its constructor. */
  make(options = {}) {
    const model = new EbpoModel({ ...options, crew: this.crew });
    this.add(model);
    return model;
  }

  get models() {
    return this.children.filter((child) => child instanceof EbpoModel);
  }

  /** Shares the budget among the visible models and updates each of them. Call it before each frame instead of the models' own update(). */
  update(camera, renderer) {
    this.updateWorldMatrix(true, true);
    const height = heightOf(renderer), models = this.models.filter((model) => model.info && model.visible);
    const shares = sharesOf(this.triangles, models.map(({ content, info }) => ({ weight: weightOf(lookOf(camera, height, content.matrixWorld)), copies: 1, faces: 2 * info.face_count })));
    models.forEach((model, i) => {
      model.triangles = shares[i];
      model.update(camera, height);
    });
  }

  /** Disposes all models and terminates their workers. */
  dispose() {
    this.models.forEach((model) => {
      this.remove(model);
      model.dispose();
    });
  }
}
