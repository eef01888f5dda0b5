// Several models in one picture, some of them in many places: each file is read once, drawn once for all instances of it, and refined for those that are largest.
import { Client, Crew } from '../client.js';
import { kit } from '../scene.js';
import { Tiles, lookOf, makeLook, setCut, setTheme } from '../shade.js';
import { upright } from '../state.js';
import { sharesOf, weightOf } from './budget.js';
import { placed, poseAt, unplaced } from './poses.js';

const VIEWS_MOST = 8;                    // of a model at the same time: its instances that are largest in the picture
const SEEN_PIXELS = 0.5;                 // smaller instances are not drawn
const WHOLE_FILES = 4, FEW_BYTES = 1 << 17, MANY_BYTES = 1 << 20; // of first requests, with more files and with fewer
const CACHE_BYTES = 64 << 20, CACHE_LEAST = 4 << 20;              // of decoded chunks, of all files and of one
const TIMES = 32;                        // of a route, besides its keys, at which its box is taken

// Far apart in hue, neither dark nor pale: beside each other on both themes.
export const COLOURS = ['#8fb3d9', '#e0a96d', '#8cc084', '#c792c9', '#d98c8c', '#6dbfb8', '#c9bd6a', '#a6a3dc', '#b9bfca', '#d9a0b8'];

export class Assembly {
  /** `crew`: a Crew, if not one of its own; `news(model)` is called when something of a model changed, `failed(model, error)`, `changed()` when the picture is another. */
  constructor({ crew = new Crew(), news = () => {}, failed = () => {}, changed = () => {} } = {}) {
    Object.assign(this, { crew, news, failed, changed });
    this.group = new kit.Group();
    this.group.matrixAutoUpdate = false;
    this.models = [];
    this.instances = [];
    this.time = 0;
    this.dark = true;
  }

  /**
   * Opens all files. `models`: [{ name, file (an address or a File), digest, colour }]; `instances`: as readScene() gives them; `up`: 1 or 2, the axis that is drawn upwards.
   * Resolves when all heads are there or have failed: to whether there is anything to be seen.
   */
  async open({ models, instances, up = 1, from = 0, to = 0 }) {
    Object.assign(this, { up, from, to, time: from });
    this.models = models.map((m, i) => this.#model(m, i));
    this.instances = instances.map((instance, number) => ({ ...instance, number, visible: true }));
    this.instances.forEach((instance) => this.models[instance.model].instances.push(instance));
    const ahead = models.length > WHOLE_FILES ? FEW_BYTES : MANY_BYTES, cacheBytes = Math.max(CACHE_LEAST, Math.floor(CACHE_BYTES / models.length));
    await Promise.all(this.models.filter((m) => m.instances.length).map((m) => this.#openModel(m, { ahead, cacheBytes })));
    this.#measure();
    this.setTime(from);
    return this.box !== undefined;
  }

  #model({ name, file, digest, colour }, number) {
    const look = makeLook(), model = { name, file, digest, number, colour: colour ?? COLOURS[number % COLOURS.length], visible: true, instances: [], shown: [], look,
      idle: false, content: new kit.Group() };
    model.content.matrixAutoUpdate = false;
    this.group.add(model.content);
    model.matrices = new kit.InstancedBufferAttribute(new Float32Array(16), 16);
    model.tiles = new Tiles(model.content, look, (geometry, material) => {
      const mesh = new kit.InstancedMesh(geometry, material, 0);
      mesh.instanceMatrix = model.matrices;
      mesh.count = model.shown.length;
      mesh.frustumCulled = false; // instances that are out of sight are left out one by one
      mesh.ebpoModel = model;
      return mesh;
    });
    model.client = new Client({ crew: this.crew, heard: (type, news) => this.#hear(model, type, news) });
    this.#paint(model);
    return model;
  }

  async #openModel(model, options) {
    try {
      const { info, size } = await model.client.open(model.file, options);
      if (model.digest && model.digest !== info.content_sha256)
        throw new Error('it is another one than the scene names (its digest differs); get the file that belongs to the scene');
      Object.assign(model, { info, size });
    } catch (error) {
      model.error = error;
      model.client.close();
      this.failed(model, error);
    }
    this.news(model);
  }

  #hear(model, type, news) {
    if (news.traffic)
      model.traffic = news.traffic;
    if (type === 'tiles' && model.info) {
      model.tiles.set(news.set, news.removed);
      model.stats = news.stats;
      this.changed();
    } else if (type === 'idle') {
      model.idle = news.want === model.client.want && !model.client.pending;
    } else if (type === 'line') {
      model.line = news;
    } else if (type === 'failed' && model.info) {
      model.error = news.error;
      this.failed(model, news.error);
    }
    this.news(model);
  }

  // The box of all instances at all times of their routes (at keys, and between): what is looked at, not a promise.
  #measure() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const instance of this.instances) {
      const { info } = this.models[instance.model], { route } = instance;
      if (!info)
        continue;
      const between = route && this.to > this.from ? Array.from({ length: TIMES }, (_, i) => this.from + (this.to - this.from) * i / (TIMES - 1)) : [];
      for (const time of [...(route?.keys ?? [{ time: 0 }]).slice(0, 1000).map((key) => key.time), ...between])
        for (let c = 0; c < 8; c++)
          placed(poseAt(instance, time), info.box_origin.map((o, k) => o + (c >> k & 1) * info.box_size[k])).forEach((x, k) => {
            low[k] = Math.min(low[k], x);
            high[k] = Math.max(high[k], x);
          });
    }
    if (low[0] > high[0]) {
      this.box = undefined;
      return;
    }
    const size = high.map((x, k) => x - low[k]);
    this.box = { origin: low, size };
    this.scene = { center: low.map((x, k) => x + size[k] / 2), scale: 2 / Math.hypot(...size), up: this.up };
  }

  setTime(time) {
    this.time = time;
    for (const instance of this.instances)
      if (!instance.matrix || instance.route)
        this.#place(instance);
    this.changed();
  }

  // From the coordinates of a model's scene (cut.js: its box centred, its half diagonal 1) to those of the picture.
  #place(instance) {
    const { client, info } = this.models[instance.model], { scene } = this;
    if (!info || !scene)
      return;
    const pose = instance.now = poseAt(instance, this.time), s = pose.scale * scene.scale / client.scene.scale, r = pose.rotation;
    const axis = (k) => upright([r[k], r[3 + k], r[6 + k]].map((x) => x * s), this.up), at = upright(placed(pose, client.scene.center).map((x, k) => (x - scene.center[k]) * scene.scale), this.up);
    const [x, y, z] = [0, 1, 2].map(axis);
    instance.matrix = new kit.Matrix4().set(x[0], y[0], z[0], at[0], x[1], y[1], z[1], at[1], x[2], y[2], z[2], at[2], 0, 0, 0, 1);
    instance.at = at;
    instance.radius = s;
  }

  /** To be called when the camera, the time or what is visible has changed. `want`: { pixels, triangles, mesh }; `height` of the picture in pixels of the page. */
  update(camera, height, want) {
    camera.updateMatrixWorld();
    const m = camera.matrixWorldInverse.elements, frustum = new kit.Frustum().setFromProjectionMatrix(new kit.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
    const planes = frustum.planes.filter((_, i) => i !== 4 && i !== 5), pixels = camera.projectionMatrix.elements[5] * height / 2, sphere = new kit.Sphere();
    for (const model of this.models) {
      model.shown = !model.visible ? [] : model.instances.filter((instance) => {
        if (!instance.visible || !instance.matrix)
          return false;
        const [x, y, z] = instance.at, away = Math.max(-(m[2] * x + m[6] * y + m[10] * z + m[14]), instance.radius);
        instance.pixels = instance.radius / away * pixels;
        sphere.center.set(x, y, z);
        sphere.radius = instance.radius;
        return instance.pixels >= SEEN_PIXELS && planes.every((p) => p.distanceToPoint(sphere.center) >= -sphere.radius);
      });
      this.#fill(model);
    }
    this.#ask(camera, height, want);
  }

  #fill(model) {
    const { shown } = model;
    if (model.matrices.count < shown.length) {
      model.matrices = new kit.InstancedBufferAttribute(new Float32Array(16 * Math.max(shown.length, 2 * model.matrices.count)), 16);
      model.tiles.byKey.forEach(({ mesh }) => (mesh.instanceMatrix = model.matrices));
    }
    shown.forEach((instance, i) => instance.matrix.toArray(model.matrices.array, 16 * i));
    model.matrices.needsUpdate = true;
    model.look.uniforms.chosen.value = shown.indexOf(this.chosen);
    model.tiles.byKey.forEach(({ mesh }) => {
      mesh.count = shown.length;
      mesh.boundingSphere = null; // three.js keeps one for rays
    });
  }

  #ask(camera, height, { pixels, triangles, mesh }) {
    this.asked = true;
    const seen = this.models.filter((model) => model.info && model.shown.length);
    for (const model of seen) {
      const largest = model.shown.length > VIEWS_MOST ? [...model.shown].sort((a, b) => b.pixels - a.pixels).slice(0, VIEWS_MOST) : model.shown;
      const [first, ...also] = largest.map((instance) => lookOf(camera, height, instance.matrix)).sort((a, b) => weightOf(b) - weightOf(a));
      model.view = { ...first, also };
    }
    const shares = sharesOf(triangles, seen.map(({ view, shown, info }) => ({ weight: shown.length / (1 + view.also.length) * [view, ...view.also].reduce((sum, v) => sum + weightOf(v), 0),
      copies: shown.length, faces: 2 * info.face_count })));
    seen.forEach((model, i) => {
      const wanted = { level: 99, mesh: mesh && model.info.parts.has('mesh'), pixels, triangles: pixels === 0 ? Infinity : shares[i], black: this.cut !== undefined, lines: false, cells: false };
      if (model.client.look(model.view, wanted))
        model.idle = false;
    });
  }

  /** Whether all that is in sight is as fine as it gets. */
  get idle() {
    return this.asked === true && this.models.every((model) => model.error || !model.shown.length || model.idle);
  }

  // --- how it looks ---

  #paint(model) {
    setTheme(model.look, this.dark);
    model.look.uniforms.plain.value.set(model.colour);
    setCut(model.look, this.cut?.low, this.cut?.high);
  }

  setTheme(dark) {
    this.dark = dark;
    this.models.forEach((model) => this.#paint(model));
  }

  setColour(model, colour) {
    model.colour = colour;
    this.#paint(model);
  }

  setColouring(mode) {
    this.models.forEach(({ look }) => (look.uniforms.colouring.value = { plain: 0, level: 1, type: 2 }[mode]));
  }

  setOwnColours(own) {
    this.models.forEach(({ look }) => (look.uniforms.own.value = own));
  }

  /** Shows what lies between two corners of the picture's coordinates; everything without them. */
  setCut(low, high) {
    this.cut = low && { low, high };
    this.models.forEach((model) => this.#paint(model));
  }

  setWalls(walls) {
    this.models.forEach(({ tiles }) => tiles.setWalls(walls));
  }

  // --- who is where ---

  /** For a Raycaster of three.js; a hit's instance is instanceOf(hit). */
  get meshes() {
    return this.models.flatMap(({ tiles, shown }) => (shown.length ? tiles.meshes : []));
  }

  instanceOf = ({ object, instanceId }) => object.ebpoModel?.shown[instanceId];

  /** Coordinates of the world as those of an instance's model, and back. */
  inModel = (instance, point) => unplaced(instance.now, point);
  inWorld = (instance, point) => placed(instance.now, point);

  get stats() {
    const out = { requests: 0, bytes: 0, size: 0, nodes: 0, triangles: 0, meshTriangles: 0 };
    for (const { traffic, stats, size, shown } of this.models) {
      out.requests += traffic?.requests ?? 0;
      out.bytes += traffic?.bytes ?? 0;
      out.size += size ?? 0;
      for (const name of ['nodes', 'triangles', 'meshTriangles'])
        out[name] += (stats?.[name] ?? 0) * shown.length;
    }
    return out;
  }

  end() {
    for (const { client, tiles, look } of this.models) {
      client.end();
      tiles.clear();
      [look.faces, look.wire, look.cells].forEach((material) => material.dispose());
    }
    this.group.removeFromParent();
    this.models = this.instances = [];
  }
}
