// Shades faces, envelopes and lines, and converts tiles from the worker to meshes, for the viewer's pages and for other three.js scenes.
import * as THREE from 'three';

// Colours by node type (white, black, leaf, gray), of real faces, and by level from coarse to fine.
export const TYPE_COLOURS = ['#ffffff', '#52525b', '#2f9e8f', '#7c8db5'];
export const MESH_COLOUR = '#d9b48f';
export const LEVEL_COLOURS = ['#3d2c6b', '#473f8c', '#4257a0', '#3a6fa8', '#3387aa', '#319ea6', '#3fb49b', '#62c88a', '#93d975', '#c6e564', '#f2e960',
  '#f8c957', '#f6a64f', '#ee8149', '#dd5d46', '#c43d4b', '#a32653', '#7f1857', '#5f1253', '#430d49', '#2c083b'];

const VERTEX = `
  attribute vec4 tag;
  attribute vec2 bend;
  attribute vec4 hue; // a colour, sRGB; the last component is 0 for the model's colours, 0.25 for caps, and 1 where there is no colour
  varying vec3 eyeSpace;
  varying vec3 scenePlace;
  varying vec3 colour;
  centroid varying vec3 lent;
  varying float turned;
  flat varying int kind;
  uniform int colouring, chosen; // chosen: the highlighted instance
  uniform bool own; // use the model's colours instead of the plain colour
  uniform vec3 plain, mesh, accent, types[4], levels[21];
  void main() {
    kind = int(tag.y + 0.5) & 3;
    bool face = int(tag.y + 0.5) > 3;
    vec3 n = vec3(bend, 1.0 - abs(bend.x) - abs(bend.y)); // octahedral
    if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    vec4 placed = vec4(position, 1.0);
    #ifdef USE_INSTANCING
      placed = instanceMatrix * placed;
      n = mat3(instanceMatrix) * n; // rotates and scales
    #endif
    vec4 at = modelViewMatrix * placed;
    eyeSpace = at.xyz;
    scenePlace = placed.xyz;
    lent = normalMatrix * normalize(n) * (tag.z / 255.0);
    turned = face ? 1.0 : 0.0;
    colour = colouring == 0 ? plain : colouring == 1 ? levels[int(tag.x + 0.5)] : face ? mesh : types[kind];
    if (hue.w < 0.2 ? own && colouring == 0 : hue.w < 0.5)
      colour = mix(hue.rgb / 12.92, pow((hue.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, hue.rgb)); // linear light
    #ifdef USE_INSTANCING
      if (gl_InstanceID == chosen) colour = mix(colour, accent, 0.55);
    #endif
    gl_Position = projectionMatrix * at;
  }`;

const FRAGMENT = `
  varying vec3 eyeSpace;
  varying vec3 scenePlace;
  varying vec3 colour;
  centroid varying vec3 lent;
  varying float turned; // 1 for real faces, whose back is lit like the front; the back of an envelope is visible only through cracks
  flat varying int kind;
  uniform vec3 low, high; // the visible box
  uniform bool clipping;
  uniform vec3 section, sky, ground;
  void main() {
    if (clipping && (any(lessThan(scenePlace, low)) || any(greaterThan(scenePlace, high)))) discard;
    if (clipping && kind == 1 && gl_FrontFacing) discard; // black nodes are visible only where they are cut
    vec3 toEye = normalize(-eyeSpace), flatly = cross(dFdx(eyeSpace), dFdy(eyeSpace));
    float size = dot(flatly, flatly); // zero or invalid on triangles smaller than a pixel
    vec3 n = size > 0.0 && size < 1.0 ? flatly * inversesqrt(size) : toEye;
    float weight = min(length(lent), 1.0);
    // Backs of faces are small dots where triangles are folded over at borders of patches (the normal points to the eye), and at contours, where front and back have
    // equal depth (the normal is almost perpendicular to the view). These are lit as the front; other backs have the opposite normal.
    float facing = dot(lent, toEye);
    bool back = !gl_FrontFacing && !(turned > 0.5 && facing > 0.0);
    vec3 smoothly = gl_FrontFacing ? lent : turned < 0.5 ? -lent : mix(lent - 2.0 * min(facing, 0.0) * toEye, -lent, smoothstep(0.1, 0.4, -facing));
    n = normalize(mix(n, smoothly / max(weight, 0.001), weight) + 0.0001 * toEye);
    if (back && turned < 0.5) n = normalize(lent + toEye); // as bright as the surface around the crack
    n = normalize(n + toEye * max(0.0, 0.15 - dot(n, toEye)));
    if (back && clipping) { // the back of a closed body, visible through the cut, fills the section
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
  uniform vec3 low, high; // the visible box
  uniform bool clipping;
  uniform vec3 line;
  uniform float opacity;
  void main() {
    if (clipping && (any(lessThan(scenePlace, low)) || any(greaterThan(scenePlace, high)))) discard;
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

/** Returns materials and their shared uniforms: { uniforms, faces, wire, cells }. Coordinates are those of the scene (cut.js). */
export function makeLook() {
  const uniforms = {
    colouring: { value: 0 }, own: { value: true }, plain: { value: colour('#c9cdd6') }, mesh: { value: colour(MESH_COLOUR) }, chosen: { value: -1 }, accent: { value: colour('#e8784f') },
    types: { value: TYPE_COLOURS.map(colour) }, levels: { value: LEVEL_COLOURS.map(colour) },
    low: { value: new THREE.Vector3() }, high: { value: new THREE.Vector3() }, clipping: { value: false }, section: { value: colour('#d97757') },
    sky: { value: colour('#59616f') }, ground: { value: colour('#23252b') },
  };
  const faces = new THREE.ShaderMaterial({ uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
  faces.defaultAttributeValues = { ...faces.defaultAttributeValues, ...NO_HUE };
  const lines = (text, opacity) => new THREE.ShaderMaterial({ vertexShader: LINE_VERTEX, fragmentShader: LINE_FRAGMENT, transparent: true, depthWrite: false,
    uniforms: { line: { value: colour(text) }, opacity: { value: opacity }, low: uniforms.low, high: uniforms.high, clipping: uniforms.clipping } });
  return { uniforms, faces, wire: lines('#0b0d12', 0.55), cells: lines('#4cc2ff', 0.35) };
}

export const NO_HUE = { hue: [0, 0, 0, 1] }; // for tiles without colours

export function setTheme({ uniforms, wire, cells }, dark) {
  uniforms.plain.value.set(dark ? '#bcc3cf' : '#b9bfca');
  uniforms.sky.value.set(dark ? '#59616f' : '#8f97a6');
  uniforms.ground.value.set(dark ? '#23252b' : '#4a4d55');
  wire.uniforms.line.value.set(dark ? '#0b0d12' : '#1b2130');
  cells.uniforms.line.value.set(dark ? '#5cc8ff' : '#0a6fb8');
}

/** Shows only the box between two corners; everything without corners. */
export function setCut({ uniforms }, low, high) {
  uniforms.clipping.value = Boolean(low);
  if (low) {
    uniforms.low.value.set(...low);
    uniforms.high.value.set(...high);
  }
}

/** Returns the view with which the worker chooses nodes, for a picture of `height` pixels. `placed`: the matrix from the scene's coordinates to the camera's world. */
export function lookOf(camera, height, placed) {
  camera.updateMatrixWorld();
  const toCamera = new THREE.Matrix4().multiplyMatrices(camera.matrixWorldInverse, placed), frustum = new THREE.Frustum();
  frustum.setFromProjectionMatrix(new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, toCamera));
  const back = toCamera.clone().invert(), scale = toCamera.getMaxScaleOnAxis(), away = camera.isOrthographicCamera ? ORTHOGRAPHIC_AWAY : 0;
  return {
    eye: new THREE.Vector3(0, 0, away / scale).applyMatrix4(back).toArray(),
    planes: frustum.planes.filter((_, i) => i !== 4 && i !== 5).map((p) => [...p.normal.toArray(), p.constant]), // without near and far, which depend on the model
    pixels: camera.projectionMatrix.elements[5] * height / 2 * (away || 1),
  };
}
const ORTHOGRAPHIC_AWAY = 1000; // distance of the eye that stands for an orthographic camera

/** Converts the worker's tiles to meshes below `parent`. `make(geometry, material)` creates a mesh; the default is a THREE.Mesh. */
export class Tiles {
  constructor(parent, { faces, wire, cells }, make = (geometry, material) => new THREE.Mesh(geometry, material)) {
    Object.assign(this, { parent, faces, wire, cells, make });
    this.byKey = new Map();
    this.cellFaces = true;
  }

  /** Applies all changes of one pass together, so that no gap becomes visible. */
  set(set, removed) {
    this.faces.polygonOffset = set.some((t) => t.lines) || (this.faces.polygonOffset && !set.length); // only with lines, because the offset would move steep cell faces into cracks
    removed.forEach((key) => this.#remove(key));
    for (const t of set) {
      this.#remove(t.key);
      this.#add(t);
    }
  }

  #add(t) {
    const tile = { inner: 3 * t.inner, all: t.index.length }, geometry = new THREE.BufferGeometry(), position = new THREE.BufferAttribute(t.position, 3);
    geometry.setAttribute('position', position);
    geometry.setAttribute('tag', new THREE.BufferAttribute(t.tag, 4));
    geometry.setAttribute('bend', new THREE.BufferAttribute(t.normal, 2, true));
    if (t.hue)
      geometry.setAttribute('hue', new THREE.BufferAttribute(t.hue, 4, true));
    geometry.setIndex(new THREE.BufferAttribute(t.index, 1));
    geometry.computeBoundingSphere();
    tile.mesh = this.make(geometry, this.faces);
    tile.mesh.castShadow = tile.mesh.receiveShadow = true;
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
      tile.cells = new THREE.LineSegments(cells, this.cells);
    }
    this.byKey.set(t.key, tile);
    for (const object of [tile.mesh, tile.lines, tile.cells].filter(Boolean)) {
      object.matrixAutoUpdate = false;
      this.parent.add(object);
    }
    this.#range(tile);
  }

  #remove(key) {
    const tile = this.byKey.get(key);
    if (!tile)
      return;
    this.byKey.delete(key);
    for (const object of [tile.mesh, tile.lines, tile.cells].filter(Boolean)) {
      this.parent.remove(object);
      object.geometry.dispose();
    }
  }

  clear() {
    [...this.byKey.keys()].forEach((key) => this.#remove(key));
  }

  #range(tile) {
    tile.mesh.geometry.setDrawRange(0, this.cellFaces ? tile.all : tile.inner);
    tile.mesh.visible = (this.cellFaces ? tile.all : tile.inner) > 0;
  }

  setCellFaces(cellFaces) {
    this.cellFaces = cellFaces;
    this.byKey.forEach((tile) => this.#range(tile));
  }

  /** The visible meshes, for a THREE.Raycaster. */
  get meshes() {
    return [...this.byKey.values()].filter((t) => t.mesh.visible).map((t) => t.mesh);
  }
}
