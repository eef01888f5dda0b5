// The picture: tiles from the worker, the camera, clipping and the probe's marker. It is drawn only after a change.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { Tiles, lookOf, makeLook, setCut, setTheme } from './shade.js';

/** Classes of three.js for code that is loaded later and must not load a second copy of three.js. */
export const kit = {
  BufferAttribute: THREE.BufferAttribute, BufferGeometry: THREE.BufferGeometry, Color: THREE.Color, DepthTexture: THREE.DepthTexture,
  DoubleSide: THREE.DoubleSide, Frustum: THREE.Frustum, Group: THREE.Group, InstancedBufferAttribute: THREE.InstancedBufferAttribute,
  InstancedBufferGeometry: THREE.InstancedBufferGeometry, InstancedMesh: THREE.InstancedMesh, LineBasicMaterial: THREE.LineBasicMaterial,
  LineSegments: THREE.LineSegments, Matrix4: THREE.Matrix4, Mesh: THREE.Mesh, MeshBasicMaterial: THREE.MeshBasicMaterial, Scene: THREE.Scene,
  ShaderMaterial: THREE.ShaderMaterial, Sphere: THREE.Sphere, Vector2: THREE.Vector2, Vector3: THREE.Vector3,
  WebGLRenderTarget: THREE.WebGLRenderTarget
};

const PICK_ROUNDING = 1e-6; // of a picked point: drawn triangles have coordinates in single precision
const OUTSIDE = 1.05; // all of a model is nearer to the origin
const PAUSE_MS = 30; // a frame that is requested later after the last one does not measure the interval of frames
const TURN = Math.PI / 24, MOVE = 0.06; // steps of the keys: radians, and shares of the distance

export class Scene {
  /**
   * Calls `changed()` when the camera has moved, `drawn(ms)` after each frame, with the interval since the last frame (undefined: after a pause), and `lost(true)`
   * when the browser takes the graphics context away and `lost(false)` when the context is restored.
   */
  constructor(canvas, { context, contextOptions, fieldOfView }, { changed, drawn, lost = () => {} }) {
    this.canvas = canvas;
    this.drawn = drawn;
    this.renderer = new THREE.WebGLRenderer({ canvas, context, ...contextOptions });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(fieldOfView, 1, 0.001, 100);
    this.fieldOfView = fieldOfView;
    this.#control(() => {
      this.redraw();
      changed();
    });
    this.look = makeLook();
    this.uniforms = this.look.uniforms;
    this.tiles = new Tiles(this.scene, this.look);
    this.isClosed = false; // true when the tiles are one closed surface; unless it intersects itself, no back is visible from outside
    this.pipeline = undefined; // { render(scene), resize(scene) } draws instead of the renderer, if present
    this.#warmUp();
    this.#makeProbe();
    for (const [event, gone] of [['webglcontextlost', true], ['webglcontextrestored', false]])
      canvas.addEventListener(event, () => { // three.js uploads everything again at the next frame, but has forgotten the clear colour
        this.renderer.setClearColor(0, 0);
        lost(gone);
        this.redraw();
      });
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement);
    this.resize();
    this.home();
  }

  // Makes the controls of the camera. They keep the upward direction with which they are made.
  #control(changed) {
    this.controls?.dispose();
    const controls = this.controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    controls.dampingFactor = 0.12;
    controls.zoomToCursor = true;
    controls.autoRotateSpeed = 4;
    this.moved = changed;
    controls.addEventListener('change', changed);
    this.#limit();
  }

  // A camera with a narrow lens is far away.
  get #away() {
    return Math.tan(this.fieldOfView * Math.PI / 360) / Math.tan(this.camera.fov * Math.PI / 360);
  }

  #limit() {
    this.controls.minDistance = 0.002 * this.#away;
    this.controls.maxDistance = 12 * this.#away;
  }

  /** Draws without perspective, by a lens of 0.1 degrees; keeps the size of the model in the picture. */
  setOrthographic(on) {
    const { target } = this.controls, before = this.#away;
    this.camera.fov = on ? 0.1 : this.fieldOfView;
    this.#limit();
    this.camera.position.sub(target).multiplyScalar(this.#away / before).add(target);
    this.controls.update();
    this.#offset();
    this.redraw();
    this.moved();
  }

  /** Turns the picture so that the model's z axis, or its y axis, points upwards. */
  setUp(z) {
    const { target, autoRotate } = this.controls;
    this.camera.up.set(0, z ? 0 : 1, z ? 1 : 0);
    this.#control(this.moved);
    this.controls.target.copy(target);
    this.controls.autoRotate = autoRotate;
    this.home();
    this.moved();
  }

  setTurntable(on) {
    this.controls.autoRotate = on;
    this.redraw();
  }

  // Draws a triangle without area, so that the shaders are compiled while the model is being fetched.
  #warmUp() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(9), 3));
    geometry.setAttribute('tag', new THREE.BufferAttribute(new Uint8Array(12), 4));
    geometry.setAttribute('bend', new THREE.BufferAttribute(new Int16Array(6), 2, true));
    this.scene.add(this.warm = new THREE.Mesh(geometry, this.look.faces));
  }

  #makeProbe() {
    this.probe = new THREE.Group();
    const ball = (r, c, o, depth) => new THREE.Mesh(new THREE.SphereGeometry(r, 24, 16), new THREE.MeshBasicMaterial({ color: c, transparent: true, opacity: o, depthTest: depth }));
    this.probeBall = ball(1, '#ffb020', 0.35, false);
    this.probeCore = ball(0.62, '#ffb020', 1, false);
    this.nearBall = ball(0.5, '#ffffff', 1, false);
    this.nearLine = new THREE.Line(new THREE.BufferGeometry().setAttribute('position', new THREE.BufferAttribute(new Float32Array(6), 3)),
      new THREE.LineBasicMaterial({ color: '#ffffff', depthTest: false, transparent: true }));
    this.nearLine.frustumCulled = false;
    this.probe.add(this.nearLine, this.probeBall, this.probeCore, this.nearBall);
    this.probe.children.forEach((o, i) => (o.renderOrder = 10 + i));
    this.probe.visible = false;
    this.scene.add(this.probe);
  }

  /** Shows the probe at a point and, if known, at the nearest point of the surface, both in scene coordinates. Hides the probe without a point. */
  showProbe(point, nearest, tint = '#ffb020') {
    this.probe.visible = Boolean(point);
    if (point) {
      this.probeAt = new THREE.Vector3(...point);
      for (const b of [this.probeBall, this.probeCore]) {
        b.position.copy(this.probeAt);
        b.material.color.set(tint);
      }
      this.nearBall.visible = this.nearLine.visible = Boolean(nearest);
      if (nearest) {
        this.nearBall.position.set(...nearest);
        this.nearLine.geometry.attributes.position.array.set([...point, ...nearest]);
        this.nearLine.geometry.attributes.position.needsUpdate = true;
      }
    }
    this.redraw();
  }

  resize() {
    const { clientWidth: w, clientHeight: h } = this.canvas.parentElement;
    if (!w || !h)
      return;
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / h;
    this.#offset();
    this.pipeline?.resize(this);
    this.redraw();
  }

  /** Sets the size of the panels at the right and at the bottom, in pixels. The model is centred in the rest of the page. */
  setInsets(right, bottom) {
    this.insets = [right, bottom];
    this.#offset();
    this.redraw();
  }

  #offset() {
    const { clientWidth: w, clientHeight: h } = this.canvas.parentElement, [right, bottom] = this.insets ?? [0, 0];
    this.camera.setViewOffset(w, h, right / 2, bottom / 2, w, h);
    this.camera.updateProjectionMatrix();
  }

  /** Moves the camera so that everything is visible. */
  home() {
    const { clientWidth: w, clientHeight: h } = this.canvas.parentElement, [right, bottom] = this.insets ?? [0, 0];
    const narrow = Math.min(h - bottom, w - right) / Math.max(h, 1), distance = 0.98 / Math.sin(this.camera.fov * Math.PI / 360) / Math.max(narrow, 0.25);
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(0.42, 0.32, 0.85).setLength(Math.min(distance, 11 * this.#away));
    if (this.camera.up.z)
      this.camera.position.set(this.camera.position.x, -this.camera.position.z, this.camera.position.y);
    this.controls.update();
    this.redraw();
  }

  lookAt(point) {
    const shift = new THREE.Vector3(...point).sub(this.controls.target);
    this.controls.target.add(shift);
    this.camera.position.add(shift);
    this.controls.update();
  }

  /** Moves the camera by keys. `by`: [right, up] turns around the target, or with `move` moves the target; a number is a factor of the distance. */
  steer(by, move) {
    const { target, minDistance, maxDistance } = this.controls, offset = this.camera.position.clone().sub(target), distance = offset.length();
    if (typeof by === 'number') {
      offset.setLength(Math.min(maxDistance, Math.max(minDistance, distance * by)));
    } else if (move) {
      const step = new THREE.Vector3(by[0], by[1], 0).multiplyScalar(distance * MOVE).applyQuaternion(this.camera.quaternion);
      target.add(step);
    } else {
      const upright = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
      const around = new THREE.Spherical().setFromVector3(offset.applyQuaternion(upright));
      around.theta += by[0] * TURN;
      around.phi = Math.min(Math.PI - 0.01, Math.max(0.01, around.phi - by[1] * TURN));
      offset.setFromSpherical(around).applyQuaternion(upright.invert());
    }
    this.place = { eye: offset.add(target).toArray(), target: target.toArray() };
  }

  /** The camera: { eye, target }. */
  get place() {
    return { eye: this.camera.position.toArray(), target: this.controls.target.toArray() };
  }

  set place({ eye, target }) {
    this.controls.target.set(...target);
    this.camera.position.set(...eye);
    this.controls.update();
    this.redraw();
  }

  /** Returns the view data with which the worker chooses nodes. */
  view() {
    return lookOf(this.camera, this.canvas.clientHeight, this.scene.matrixWorld);
  }

  clear() {
    this.tiles.clear();
    this.showProbe();
  }

  /** Applies all changes of one pass together. */
  setTiles(set, removed) {
    this.scene.remove(this.warm);
    this.tiles.set(set, removed);
    this.redraw();
  }

  get cellFaces() {
    return this.tiles.cellFaces;
  }

  setCellFaces(cellFaces) {
    this.tiles.setCellFaces(cellFaces);
    this.redraw();
  }

  setColouring(mode) {
    this.uniforms.colouring.value = { plain: 0, level: 1, type: 2 }[mode];
    this.redraw();
  }

  /** `own`: true when faces and envelopes show the model's colours in plain colouring. */
  setOwnColours(own) {
    this.uniforms.own.value = own;
    this.redraw();
  }

  /** Shows only the box between two corners; everything without corners. */
  setCut(low, high) {
    this.cut = low && { low, high };
    setCut(this.look, low, high);
    this.redraw();
  }

  setTheme(dark) {
    this.scene.background = null;
    this.renderer.setClearColor(0, 0);
    setTheme(this.look, dark);
    this.nearBall.material.color.set(dark ? '#ffffff' : '#111827');
    this.nearLine.material.color.set(dark ? '#ffffff' : '#111827');
    this.redraw();
  }

  /** Returns the visible point at a pixel, in scene coordinates: on the drawn surface, or on the section where the ray enters the visible box inside a body. */
  pick(x, y) {
    const box = this.canvas.getBoundingClientRect(), ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height), this.camera);
    const found = pickAlong(ray, (this.others ?? this.tiles).meshes, this.cut); // `others`: several models instead of one
    this.picked = found?.hit;
    this.pickedCut = found?.onCut ?? false; // the point is on the section, not on the surface
    return found?.point;
  }

  /**
   * Returns the eye if the last picked point is where its ray meets the drawn surface first, in scene coordinates; undefined with a visible box. From the eye, the
   * worker finds the point of the real faces.
   */
  get pickedFrom() {
    return this.cut ? undefined : this.camera.position.toArray();
  }

  /** Returns the accuracy of the last picked point, as a length of the scene: half a pixel for a point on the drawn surface, and 0 on a section. */
  pickPrecision(point) {
    return this.pickedCut ? 0 : Math.max(0.5 / this.pixelsAt(point), PICK_ROUNDING);
  }

  /** Returns the size of a length of 1 at a point, in pixels of the page. */
  pixelsAt(point) {
    return this.canvas.clientHeight / (2 * Math.tan(this.camera.fov * Math.PI / 360)) / Math.max(1e-6, this.camera.position.distanceTo(new THREE.Vector3(...point)));
  }

  /** Returns the position [x, y] on the page of a point of the scene; undefined for a point behind the camera. */
  project(point) {
    const p = new THREE.Vector3(...point).project(this.camera), { clientWidth: w, clientHeight: h } = this.canvas;
    return p.z < 1 ? [(p.x + 1) / 2 * w, (1 - p.y) / 2 * h] : undefined;
  }

  /** Frees the memory of the graphics card. */
  end() {
    this.observer.disconnect();
    cancelAnimationFrame(this.requested);
    this.clear();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  redraw() {
    if (!this.requested) {
      this.asked = performance.now();
      this.requested = requestAnimationFrame(() => this.#draw());
    }
  }

  /** Draws at once. Use it rarely: frames of the browser wait until the graphics card is ready for them. */
  draw() {
    cancelAnimationFrame(this.requested);
    this.asked = Infinity; // the interval since the last frame is not measured
    this.#draw();
  }

  #draw() {
    const began = performance.now(), interval = this.asked - this.ended < PAUSE_MS ? began - this.began : undefined; // the browser begins a frame when the last one is on its way to the screen
    this.began = began;
    this.requested = undefined;
    this.controls.update(); // damping and the turntable request the next frame
    const distance = this.camera.position.length();
    this.camera.near = Math.max(0.0005, (distance - OUTSIDE) * 0.5);
    this.camera.far = distance + 1.5;
    this.look.faces.side = this.isClosed && !this.cut && distance > OUTSIDE ? THREE.FrontSide : THREE.DoubleSide; // backs would take a quarter of the time
    this.camera.updateProjectionMatrix();
    if (this.probe.visible) {
      const size = this.camera.position.distanceTo(this.probeAt) * 0.008;
      for (const ball of [this.probeBall, this.probeCore, this.nearBall])
        ball.scale.setScalar(size);
    }
    if (this.pipeline)
      this.pipeline.render(this);
    else
      this.renderer.render(this.scene, this.camera);
    this.ended = performance.now();
    this.drawn(interval, this.renderer.info.render);
  }
}

// Returns the normal of a hit in world coordinates, of any length. The normal of an instance is rotated by the instance's matrix.
function normalOf({ face, object, instanceId }) {
  if (instanceId === undefined)
    return face.normal;
  const placed = new THREE.Matrix4();
  object.getMatrixAt(instanceId, placed);
  return face.normal.clone().transformDirection(placed);
}

function pickAlong(ray, meshes, cut) {
  const { origin, direction } = ray.ray, o = origin.toArray(), d = direction.toArray();
  let enter = 0, leave = Infinity;
  for (let k = 0; cut && k < 3; k++) {
    const [a, b] = [cut.low[k], cut.high[k]].map((bound) => (bound - o[k]) / (d[k] || 1e-30)).sort((x, y) => x - y);
    enter = Math.max(enter, a);
    leave = Math.min(leave, b);
  }
  for (const hit of ray.intersectObjects(meshes, false)) {
    if (hit.distance < enter || hit.distance > leave)
      continue;
    const onCut = Boolean(cut) && enter > 0 && normalOf(hit).dot(direction) > 0;
    return { hit, onCut, point: (onCut ? ray.ray.at(enter, new THREE.Vector3()) : hit.point).toArray() };
  }
  return undefined;
}
