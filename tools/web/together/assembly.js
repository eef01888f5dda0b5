// Several models in one picture, each with one or more instances. A file is read once for all its instances and refined for the instances that are largest in the picture.
import { cutOf } from '../address.js';
import { Client, Crew } from '../client.js';
import { kit } from '../scene.js';
import { Tiles, lookOf, makeLook, setCut, setTheme } from '../shade.js';
import { upright } from '../state.js';
import { sharesOf, weightOf } from './budget.js';
import { boundsOf } from './bounds.js';
import { placed, poseAt, unplaced } from './poses.js';

const VIEWS_MOST = 8;                    // most views for which a model is refined: those of its largest instances
const SEEN_PIXELS = 0.5;                 // smaller instances are not drawn
const WHOLE_FILES = 4, FEW_BYTES = 1 << 17, MANY_BYTES = 1 << 20; // bytes of first requests: FEW_BYTES with more than WHOLE_FILES files
const CACHE_BYTES = 64 << 20, CACHE_LEAST = 4 << 20;              // decoded chunks: limit for all files together, and least limit of a file
const OPENING_MOST = 16;                 // files that are opened at the same time; a browser sends few requests to a server at once, and waiting requests would time out

// Colours with different hues that are visible in both themes.
export const COLOURS = ['#8fb3d9', '#e0a96d', '#8cc084', '#c792c9', '#d98c8c', '#6dbfb8', '#c9bd6a', '#a6a3dc', '#b9bfca', '#d9a0b8'];

// All meshes of a model share one array of matrices. The renderer frees the array when a drawn mesh is disposed.
const freeMatrices = ({ tiles }) => tiles.byKey.forEach(({ mesh }) => mesh.dispose());

export class Assembly {
  /**
   * `crew`: a shared Crew; by default a new one. Calls `news(model)` when a state of a model changed, `failed(model, error)` on errors, and `changed()` when the
   * picture must be drawn again.
   */
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
   * Opens all files. `models`: [{ name, file (an address or a File), digest, colour }]; `instances`: as from readScene(); `up`: 1 or 2, the axis that is drawn
   * upwards. Resolves when all headers have been read or have failed; to true when at least one instance can be shown.
   */
  async open({ models, instances, up = 1, from = 0, to = 0 }) {
    Object.assign(this, { up, from, to, time: from });
    this.models = models.map((m, i) => this.#model(m, i));
    this.instances = instances.map((instance, number) => ({ ...instance, number, visible: !instance.hidden }));
    this.instances.forEach((instance) => this.models[instance.model].instances.push(instance));
    const ahead = models.length > WHOLE_FILES ? FEW_BYTES : MANY_BYTES, cacheBytes = Math.max(CACHE_LEAST, Math.floor(CACHE_BYTES / models.length));
    this.options = { ahead, cacheBytes };
    await this.#openAll(this.models.filter((m) => m.instances.length));
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
      mesh.frustumCulled = false; // update() omits each instance that is out of sight
      mesh.ebpoModel = model;
      return mesh;
    });
    model.client = new Client({ crew: this.crew, heard: (type, news) => this.#hear(model, type, news) });
    this.#paint(model);
    return model;
  }

  async #openAll(models) {
    const rest = models.values(); // the concurrent loops below share this iterator
    await Promise.all(Array.from({ length: OPENING_MOST }, async () => {
      for (const model of rest)
        await this.#openModel(model);
    }));
  }

  async #openModel(model) {
    try {
      const { info, size } = await model.client.open(model.file, this.options);
      if (model.digest && model.digest !== info.content_sha256)
        throw new Error('not the file of the scene (its digest differs); get the file that belongs to the scene');
      Object.assign(model, { info, size });
    } catch (error) {
      if (!this.models.includes(model)) // end() was called meanwhile
        return;
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

  /** Repeats all failed requests, and opens failed files again. */
  async retry() {
    const failed = this.models.filter((m) => m.error);
    failed.forEach((m) => (m.error = undefined));
    failed.filter((m) => m.info).forEach((m) => m.client.retry());
    const fresh = failed.filter((m) => !m.info);
    await this.#openAll(fresh);
    if (fresh.some((m) => m.info)) {
      this.#measure();
      this.instances.forEach((instance) => (instance.matrix = undefined));
      this.setTime(this.time);
    }
    this.changed();
  }

  #measure() {
    this.box = boundsOf(this.instances.flatMap((instance) => {
      const { info } = this.models[instance.model];
      return info ? [{ instance, origin: info.box_origin, size: info.box_size }] : [];
    }), this);
    if (this.box)
      this.scene = { center: this.box.origin.map((x, k) => x + this.box.size[k] / 2), scale: 2 / Math.hypot(...this.box.size), up: this.up };
  }

  setTime(time) {
    this.time = time;
    for (const instance of this.instances)
      if (!instance.matrix || instance.route)
        this.#place(instance);
    this.changed();
  }

  /** Changes the pose of an instance. The box of all instances is not updated. */
  setPose(instance, pose) {
    instance.pose = pose;
    this.#place(instance);
    this.changed();
  }

  // Computes the matrix of an instance: from the coordinates of the model's scene (cut.js: box centred, half diagonal 1) to the coordinates of the picture.
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

  /**
   * Selects the visible instances and requests their detail. Call it when the camera, the time or the visibility of an instance has changed. `want`: { pixels,
   * triangles, mesh }; `height`: height of the picture in pixels of the page.
   */
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
    this.#request(camera, height, want);
  }

  #fill(model) {
    const { shown } = model;
    if (model.matrices.count < shown.length) {
      freeMatrices(model);
      model.matrices = new kit.InstancedBufferAttribute(new Float32Array(16 * Math.max(shown.length, 2 * model.matrices.count)), 16);
      model.tiles.byKey.forEach(({ mesh }) => (mesh.instanceMatrix = model.matrices));
    }
    shown.forEach((instance, i) => instance.matrix.toArray(model.matrices.array, 16 * i));
    model.matrices.needsUpdate = true;
    model.look.uniforms.chosen.value = shown.indexOf(this.chosen);
    model.tiles.byKey.forEach(({ mesh }) => {
      mesh.count = shown.length;
      mesh.boundingSphere = null; // three.js caches a sphere for ray casting
    });
  }

  #request(camera, height, { pixels, triangles, mesh }) {
    this.requested = true;
    const seen = this.models.filter((model) => model.info && model.shown.length);
    for (const model of seen) {
      const largest = model.shown.length > VIEWS_MOST ? [...model.shown].sort((a, b) => b.pixels - a.pixels).slice(0, VIEWS_MOST) : model.shown;
      const [first, ...also] = largest.map((instance) => lookOf(camera, height, instance.matrix)).sort((a, b) => weightOf(b) - weightOf(a));
      model.view = { ...first, also };
    }
    const shares = sharesOf(triangles, seen.map(({ view, shown, info }) => ({ weight: shown.length / (1 + view.also.length) * [view, ...view.also].reduce((sum, v) => sum + weightOf(v), 0),
      copies: shown.length, faces: 2 * info.face_count })));
    seen.forEach((model, i) => {
      const wanted = { level: 99, mesh: mesh && model.info.parts.has('mesh'), surface: model.look.uniforms.colouring.value === 0,
        pixels, triangles: pixels === 0 ? Infinity : shares[i], black: this.cut !== undefined, lines: false, cells: false };
      if (model.client.look(model.view, wanted))
        model.idle = false;
    });
  }

  /** Returns true when all visible instances have their final detail. */
  get idle() {
    return this.requested === true && this.models.every((model) => model.error || !model.shown.length || model.idle);
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

  /** Sets the colours of models from the text of an address: NAME:RRGGBB, separated by bars. */
  setColours(text) {
    for (const pair of (text ?? '').split('|')) {
      const [, name, hex] = /^(.*):([0-9a-f]{6})$/i.exec(pair) ?? [], model = this.models.find((m) => m.name === name);
      if (model)
        this.setColour(model, `#${hex.toLowerCase()}`);
    }
  }

  /**
   * Shows only the section box, given as shares [x, y, z, x, y, z] of the box's sides in world coordinates; without `box`, everything. Returns the corners in the
   * picture's coordinates, or undefined when everything is shown.
   */
  setBox(box) {
    // With z upwards, the picture's z axis is the world's -y axis.
    const turned = box && this.up === 2 ? [box[0], box[2], 1 - box[4], box[3], box[5], 1 - box[1]] : box;
    this.cut = cutOf(upright(this.box.size, this.up).map(Math.abs), this.scene.scale, undefined, turned);
    this.models.forEach((model) => this.#paint(model));
    return this.cut;
  }

  setCellFaces(cellFaces) {
    this.models.forEach(({ tiles }) => tiles.setCellFaces(cellFaces));
  }

  // --- instances ---

  /** The visible meshes, for a Raycaster of three.js. instanceOf(hit) returns the instance of a hit. */
  get meshes() {
    return this.models.flatMap(({ tiles, shown }) => (shown.length ? tiles.meshes : []));
  }

  instanceOf = ({ object, instanceId }) => object.ebpoModel?.shown[instanceId];

  /** Converts a point from world coordinates to those of an instance's model; inWorld() converts back. */
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

  /** Returns the progress of all files together, in the form that showLine() of line.js displays. */
  get line() {
    const all = this.models.map((m) => m.line).filter((line) => line?.want > 0), sum = (of) => all.reduce((total, line) => total + of(line), 0);
    return { got: sum((l) => l.got), want: sum((l) => l.want), quiet: all.length ? Math.min(...all.map((l) => l.quiet)) : 0, what: 'the models', trouble: all.find((l) => l.trouble)?.trouble };
  }

  end() {
    for (const model of this.models) {
      const { client, tiles, look } = model;
      client.end();
      freeMatrices(model);
      tiles.clear();
      [look.faces, look.wire, look.cells].forEach((material) => material.dispose());
    }
    this.group.removeFromParent();
    this.models = this.instances = [];
  }
}
