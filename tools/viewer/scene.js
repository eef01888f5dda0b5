// The picture: tiles from the worker as meshes, a camera, lines, a clipping plane and the probe's marker. Drawn only when something changed.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

// By node type (white, black, leaf, gray) and for real faces; by level from coarse to fine.
export const TYPE_COLOURS = ['#ffffff', '#52525b', '#2f9e8f', '#7c8db5'];
export const MESH_COLOUR = '#d9b48f';
export const LEVEL_COLOURS = ['#3d2c6b', '#473f8c', '#4257a0', '#3a6fa8', '#3387aa', '#319ea6', '#3fb49b', '#62c88a', '#93d975', '#c6e564', '#f2e960',
  '#f8c957', '#f6a64f', '#ee8149', '#dd5d46', '#c43d4b', '#a32653', '#7f1857', '#5f1253', '#430d49', '#2c083b'];

const VERTEX = `
  attribute vec4 tag;
  attribute vec2 bend;
  attribute vec4 hue; // of the model, sRGB; the last one is 1 where there is none
  varying vec3 eyeSpace;
  varying vec3 scenePlace;
  varying vec3 colour;
  varying vec3 lent;
  varying float turned;
  flat varying int kind;
  uniform int colouring;
  uniform bool own; // the model's colours rather than the plain one
  uniform vec3 plain, mesh, types[4], levels[21];
  void main() {
    vec4 at = modelViewMatrix * vec4(position, 1.0);
    eyeSpace = at.xyz;
    scenePlace = position;
    kind = int(tag.y + 0.5) & 3;
    bool face = int(tag.y + 0.5) > 3;
    vec3 n = vec3(bend, 1.0 - abs(bend.x) - abs(bend.y)); // octahedral
    if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    lent = normalMatrix * normalize(n) * (tag.z / 255.0);
    turned = face ? 1.0 : 0.0;
    colour = colouring == 0 ? plain : colouring == 1 ? levels[int(tag.x + 0.5)] : face ? mesh : types[kind];
    if (own && colouring == 0 && hue.w < 0.5)
      colour = mix(hue.rgb / 12.92, pow((hue.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, hue.rgb)); // as light
    gl_Position = projectionMatrix * at;
  }`;

const FRAGMENT = `
  varying vec3 eyeSpace;
  varying vec3 scenePlace;
  varying vec3 colour;
  varying vec3 lent;
  varying float turned; // 1 for faces, whose back is lit from there; that of an envelope is seen through cracks only
  flat varying int kind;
  uniform vec4 clip;
  uniform bool clipping;
  uniform vec3 section, sky, ground;
  void main() {
    if (clipping && dot(clip.xyz, scenePlace) > clip.w) discard;
    if (clipping && kind == 1 && gl_FrontFacing) discard; // what is full inside shows where it is cut only
    vec3 toEye = normalize(-eyeSpace), flatly = cross(dFdx(eyeSpace), dFdy(eyeSpace));
    float size = dot(flatly, flatly); // nothing to go by on slivers below a pixel
    vec3 n = size > 0.0 && size < 1.0 ? flatly * inversesqrt(size) : toEye;
    float weight = min(length(lent), 1.0);
    vec3 smoothly = lent * (gl_FrontFacing ? 1.0 : -1.0);
    n = normalize(mix(n, smoothly / max(weight, 0.001), weight) + 0.0001 * toEye);
    if (!gl_FrontFacing && turned < 0.5) n = normalize(lent + toEye); // neither darker nor lighter than what is around the crack
    n = normalize(n + toEye * max(0.0, 0.15 - dot(n, toEye)));
    if (!gl_FrontFacing && clipping) { // the back of a closed body seen through the cut: fills the section
      float hatch = abs(fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0) - 0.5) < 0.07 ? 0.82 : 1.0;
      gl_FragColor = vec4(mix(section, colour, 0.22) * hatch, 1.0);
    } else {
      float up = n.y * 0.5 + 0.5;
      float key = max(dot(n, normalize(vec3(0.45, 0.65, 0.75))), 0.0), fill = max(dot(n, normalize(vec3(-0.8, 0.1, 0.4))), 0.0);
      float rim = pow(1.0 - max(dot(n, toEye), 0.0), 3.0);
      float shine = pow(max(dot(n, normalize(normalize(vec3(0.45, 0.65, 0.75)) + toEye)), 0.0), 28.0);
      vec3 light = mix(ground, sky, up) + vec3(0.78) * key + vec3(0.16, 0.18, 0.22) * fill;
      gl_FragColor = vec4(colour * light + vec3(0.10) * shine + sky * 0.25 * rim, 1.0);
    }
    #include <colorspace_fragment>
  }`;

const LINE_FRAGMENT = `
  varying vec3 scenePlace;
  uniform vec4 clip;
  uniform bool clipping;
  uniform vec3 line;
  uniform float opacity;
  void main() {
    if (clipping && dot(clip.xyz, scenePlace) > clip.w) discard;
    gl_FragColor = vec4(line, opacity);
    #include <colorspace_fragment>
  }`;
const LINE_VERTEX = `
  varying vec3 scenePlace;
  void main() {
    scenePlace = position;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;

const colour = (text) => new THREE.Color(text);

export class Scene {
  /** `changed()` is called when the camera moved, `drawn(ms)` after each frame. */
  constructor(canvas, { context, contextOptions, fieldOfView }, { changed, drawn }) {
    this.canvas = canvas;
    this.drawn = drawn;
    this.renderer = new THREE.WebGLRenderer({ canvas, context, ...contextOptions });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(fieldOfView, 1, 0.001, 100);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.controls.dampingFactor = 0.12;
    this.controls.zoomToCursor = true;
    this.controls.minDistance = 0.002;
    this.controls.maxDistance = 12;
    this.controls.addEventListener('change', () => {
      this.redraw();
      changed();
    });
    this.uniforms = {
      colouring: { value: 0 }, own: { value: true }, plain: { value: colour('#c9cdd6') }, mesh: { value: colour(MESH_COLOUR) },
      types: { value: TYPE_COLOURS.map(colour) }, levels: { value: LEVEL_COLOURS.map(colour) },
      clip: { value: new THREE.Vector4(1, 0, 0, 0) }, clipping: { value: false }, section: { value: colour('#d97757') },
      sky: { value: colour('#59616f') }, ground: { value: colour('#23252b') },
    };
    this.faces = new THREE.ShaderMaterial({ uniforms: this.uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide,
      polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    this.faces.defaultAttributeValues = { ...this.faces.defaultAttributeValues, hue: [0, 0, 0, 1] }; // of tiles without
    this.wire = this.#lineMaterial('#0b0d12', 0.55);
    this.cellLines = this.#lineMaterial('#4cc2ff', 0.35);
    this.tiles = new Map();
    this.walls = true;
    this.#warmUp();
    this.#makeProbe();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
    this.home();
  }

  // The program is made while the model is on its way, by a triangle without area.
  #warmUp() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(9), 3));
    geometry.setAttribute('tag', new THREE.BufferAttribute(new Uint8Array(12), 4));
    geometry.setAttribute('bend', new THREE.BufferAttribute(new Int16Array(6), 2, true));
    this.scene.add(this.warm = new THREE.Mesh(geometry, this.faces));
  }

  #lineMaterial(text, opacity) {
    return new THREE.ShaderMaterial({ vertexShader: LINE_VERTEX, fragmentShader: LINE_FRAGMENT, transparent: true, depthWrite: false,
      uniforms: { line: { value: colour(text) }, opacity: { value: opacity }, clip: this.uniforms.clip, clipping: this.uniforms.clipping } });
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

  /** Shows the probe at a point and, if known, the nearest point of the surface; nothing without a point. Scene coordinates. */
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
    this.redraw();
  }

  /** Room that panels take at the right and the bottom, in pixels: the model is centred in the rest. */
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

  /** A view of everything. */
  home() {
    const { clientWidth: w, clientHeight: h } = this.canvas.parentElement, [right, bottom] = this.insets ?? [0, 0];
    const narrow = Math.min(h - bottom, w - right) / Math.max(h, 1), distance = 0.98 / Math.sin(this.camera.fov * Math.PI / 360) / Math.max(narrow, 0.25);
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(0.42, 0.32, 0.85).setLength(Math.min(distance, 11));
    this.controls.update();
    this.redraw();
  }

  lookAt(point) {
    const shift = new THREE.Vector3(...point).sub(this.controls.target);
    this.controls.target.add(shift);
    this.camera.position.add(shift);
    this.controls.update();
  }

  /** What the worker needs to choose nodes. */
  view() {
    this.camera.updateMatrixWorld();
    const matrix = new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    const frustum = new THREE.Frustum().setFromProjectionMatrix(matrix);
    return {
      eye: this.camera.position.toArray(),
      planes: frustum.planes.filter((_, i) => i !== 4 && i !== 5).map((p) => [...p.normal.toArray(), p.constant]), // near and far follow the model
      pixels: this.canvas.clientHeight / (2 * Math.tan(this.camera.fov * Math.PI / 360)),
    };
  }

  clear() {
    for (const key of [...this.tiles.keys()])
      this.#remove(key);
    this.showProbe();
  }

  #remove(key) {
    const tile = this.tiles.get(key);
    if (!tile)
      return;
    this.tiles.delete(key);
    for (const object of [tile.mesh, tile.lines, tile.cells].filter(Boolean)) {
      this.scene.remove(object);
      object.geometry.dispose();
    }
  }

  /** All changes of one pass together, so that no gap is ever seen. */
  setTiles(set, removed) {
    this.faces.polygonOffset = set.some((t) => t.lines) || (this.faces.polygonOffset && !set.length); // for lines only: steep walls would sink into cracks
    this.scene.remove(this.warm);
    removed.forEach((key) => this.#remove(key));
    for (const t of set) {
      this.#remove(t.key);
      const tile = { inner: 3 * t.inner, all: t.index.length }, geometry = new THREE.BufferGeometry();
      const position = new THREE.BufferAttribute(t.position, 3);
      geometry.setAttribute('position', position);
      geometry.setAttribute('tag', new THREE.BufferAttribute(t.tag, 4));
      geometry.setAttribute('bend', new THREE.BufferAttribute(t.normal, 2, true));
      if (t.hue)
        geometry.setAttribute('hue', new THREE.BufferAttribute(t.hue, 4, true));
      geometry.setIndex(new THREE.BufferAttribute(t.index, 1));
      geometry.computeBoundingSphere();
      tile.mesh = new THREE.Mesh(geometry, this.faces);
      if (t.lines) {
        const lines = new THREE.BufferGeometry();
        lines.setAttribute('position', position);
        lines.setIndex(new THREE.BufferAttribute(t.lines, 1));
        lines.boundingSphere = geometry.boundingSphere;
        tile.lines = new THREE.LineSegments(lines, this.wire);
      }
      if (t.cells) {
        const cells = new THREE.BufferGeometry();
        cells.setAttribute('position', new THREE.BufferAttribute(t.cells, 3));
        tile.cells = new THREE.LineSegments(cells, this.cellLines);
      }
      this.tiles.set(t.key, tile);
      for (const object of [tile.mesh, tile.lines, tile.cells].filter(Boolean)) {
        object.matrixAutoUpdate = false;
        this.scene.add(object);
      }
      this.#range(tile);
    }
    this.redraw();
  }

  #range(tile) {
    tile.mesh.geometry.setDrawRange(0, this.walls ? tile.all : tile.inner);
    tile.mesh.visible = (this.walls ? tile.all : tile.inner) > 0;
  }

  setWalls(walls) {
    this.walls = walls;
    this.tiles.forEach((tile) => this.#range(tile));
    this.redraw();
  }

  setColouring(mode) {
    this.uniforms.colouring.value = { plain: 0, level: 1, type: 2 }[mode];
    this.redraw();
  }

  /** Whether faces and envelopes show the model's colours in plain colouring. */
  setOwnColours(own) {
    this.uniforms.own.value = own;
    this.redraw();
  }

  /** Keeps normal . p <= offset; nothing is cut without a normal. */
  setClip(normal, offset) {
    this.uniforms.clipping.value = Boolean(normal);
    if (normal)
      this.uniforms.clip.value.set(...normal, offset);
    this.redraw();
  }

  setTheme(dark) {
    this.scene.background = null;
    this.renderer.setClearColor(0, 0);
    this.uniforms.plain.value.set(dark ? '#bcc3cf' : '#b9bfca');
    this.uniforms.sky.value.set(dark ? '#59616f' : '#8f97a6');
    this.uniforms.ground.value.set(dark ? '#23252b' : '#4a4d55');
    this.wire.uniforms.line.value.set(dark ? '#0b0d12' : '#1b2130');
    this.cellLines.uniforms.line.value.set(dark ? '#5cc8ff' : '#0a6fb8');
    this.nearBall.material.color.set(dark ? '#ffffff' : '#111827');
    this.nearLine.material.color.set(dark ? '#ffffff' : '#111827');
    this.redraw();
  }

  /** The point seen at a pixel, in scene coordinates: on the surface drawn, or on the clipping plane where that cuts a body. */
  pick(x, y) {
    const box = this.canvas.getBoundingClientRect(), ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height), this.camera);
    const { clip, clipping } = this.uniforms, normal = new THREE.Vector3(clip.value.x, clip.value.y, clip.value.z);
    const hits = ray.intersectObjects([...this.tiles.values()].filter((t) => t.mesh.visible).map((t) => t.mesh), false);
    for (const hit of hits) {
      if (clipping.value && normal.dot(hit.point) > clip.value.w)
        continue;
      if (clipping.value && hit.face.normal.dot(ray.ray.direction) > 0) {
        const onPlane = ray.ray.intersectPlane(new THREE.Plane(normal, -clip.value.w), new THREE.Vector3());
        if (onPlane)
          return onPlane.toArray();
      }
      return hit.point.toArray();
    }
    return undefined;
  }

  redraw() {
    if (!this.asked)
      this.asked = requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    this.asked = undefined;
    this.controls.update(); // damping asks for the next frame
    const distance = this.camera.position.length();
    this.camera.near = Math.max(0.0005, (distance - 1.05) * 0.5);
    this.camera.far = distance + 1.5;
    this.camera.updateProjectionMatrix();
    if (this.probe.visible) {
      const size = this.camera.position.distanceTo(this.probeAt) * 0.008;
      for (const ball of [this.probeBall, this.probeCore, this.nearBall])
        ball.scale.setScalar(size);
    }
    const began = performance.now();
    this.renderer.render(this.scene, this.camera);
    this.drawn(performance.now() - began, this.renderer.info.render);
  }
}
