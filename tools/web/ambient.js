// Computes ambient occlusion in screen space from the depths around each pixel. Source: McGuire, Mara, Luebke, "Scalable Ambient Obscurance",
// 2012, for the weight of a sample only.
const VERTEX = 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }';
const FRAGMENT = `
  uniform sampler2D depths;
  uniform vec2 size;
  uniform mat4 back; // from the picture to the camera's coordinates
  uniform float across; // size in pixels of a length of 1 at a distance of 1
  vec3 place(vec2 at, float z) {
    vec4 p = back * vec4(at * 2.0 - 1.0, z * 2.0 - 1.0, 1.0);
    return p.xyz / p.w;
  }
  vec3 place(vec2 at) { return place(at, texture2D(depths, at).r); }
  // Returns the step to the neighbour with the smaller depth difference, so that it does not cross an edge.
  vec3 beside(vec3 here, vec2 at, vec2 step) {
    vec3 a = place(at + step) - here, b = here - place(at - step);
    return dot(a, a) < dot(b, b) ? a : b;
  }
  void main() {
    vec2 at = gl_FragCoord.xy / size;
    float z = texture2D(depths, at).r, sum = 0.0;
    gl_FragColor = vec4(1.0);
    if (z >= 1.0) return;
    vec3 here = place(at, z), n = cross(beside(here, at, vec2(1.0, 0.0) / size), beside(here, at, vec2(0.0, 1.0) / size));
    if (!(dot(n, n) > 0.0)) return;
    n = normalize(n);
    float far = -here.z, radius = RADIUS * min(1.0, far / 2.5), square = radius * radius, wide = radius * across / far;
    float turned = dot(mod(floor(gl_FragCoord.xy), 4.0), vec2(1.0, 4.0)) * 0.392699; // a different angle for each of 16 pixels; SMOOTHED takes their mean later
    for (int i = 0; i < SAMPLES; i++) {
      float share = (float(i) + 0.5) / float(SAMPLES), angle = float(i) * 2.399963 + turned;
      vec2 there = at + vec2(cos(angle), sin(angle)) * max(1.0, share * wide) / size;
      float deep = texture2D(depths, there).r;
      if (deep >= 1.0) continue;
      vec3 v = place(there, deep) - here;
      float vv = dot(v, v), open = max(0.0, square - vv);
      sum += open * open * open * max(0.0, (dot(v, n) - 0.004 * far) / (vv + 0.01 * square));
    }
    gl_FragColor = vec4(vec3(max(0.0, 1.0 - 7.0 * radius * sum / (square * square * square * float(SAMPLES)))), 1.0);
  }`;

/**
 * Part of the last step's shader, which also declares `depths` and `size`. Computes the mean over those of 4 by 4 pixels that have a similar distance; `away(at)` is
 * a logarithm of the distance.
 */
export const SMOOTHED = `
  uniform sampler2D ambient;
  float open(vec2 at, float here) {
    float sum = 0.0, weights = 0.0;
    for (int i = 0; i < 16; i++) {
      vec2 there = at + (vec2(float(i & 3), float(i >> 2)) - 1.5) / size;
      float weight = abs(away(there) - here) < 0.03 ? 1.0 : 0.001;
      sum += weight * texture2D(ambient, there).r;
      weights += weight;
    }
    return sum / weights;
  }`;

export class Ambient {
  /** `kit`: as exported by scene.js; `quad(material)`: returns a scene with one triangle that covers the picture. */
  constructor(kit, quad) {
    this.kit = kit;
    this.material = new kit.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, depthTest: false, depthWrite: false, blending: 0, defines: { RADIUS: '0.12', SAMPLES: '16' },
      uniforms: { depths: { value: null }, size: { value: null }, back: { value: new kit.Matrix4() }, across: { value: 1 } } });
    this.last = quad(this.material);
  }

  resize() {
    this.target?.dispose();
    this.target = undefined;
  }

  /** Returns a texture: 1 without occlusion, down to 0. */
  render(renderer, camera, depths, size) {
    const { kit, material: { uniforms } } = this;
    this.target ??= new kit.WebGLRenderTarget(size.x, size.y, { depthBuffer: false });
    Object.assign(uniforms.depths, { value: depths });
    uniforms.size.value = size;
    uniforms.back.value.copy(camera.projectionMatrixInverse);
    uniforms.across.value = camera.projectionMatrix.elements[5] * size.y / 2;
    renderer.setRenderTarget(this.target);
    renderer.render(this.last, camera);
    return this.target.texture;
  }
}
