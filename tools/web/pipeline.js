// Draws a picture in two steps: first the scene with its depths, then effects from the depths: shading by depth ("eye-dome lighting", Boucheny 2009), ambient
// occlusion, and paint.
import { Ambient, SMOOTHED } from './ambient.js';

const FLOAT = 1015, HALF_FLOAT = 1016; // three.js' constants
const SAMPLES = 4; // samples of a pixel; not used without a graphics card, because they would take most of the time

function isSoftware(gl) {
  const names = gl.getExtension('WEBGL_debug_renderer_info');
  return names !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(names.UNMASKED_RENDERER_WEBGL));
}

const VERTEX = 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }';
const FRAGMENT = `
  uniform sampler2D picture, depths, paint;
  uniform vec2 size, nearFar;
  uniform float strength, plain; // strength of the shading by depth; luminance of the model's plain colour
  uniform bool painted, surrounded;
  float away(vec2 at) {
    float z = texture2D(depths, at).r;
    return z >= 1.0 ? -1.0 : log2(nearFar.x * nearFar.y / (nearFar.y - z * (nearFar.y - nearFar.x)));
  }
  ${SMOOTHED}
  vec3 light(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
  void main() {
    vec2 at = gl_FragCoord.xy / size;
    vec4 c = texture2D(picture, at);
    vec3 colour = c.a > 0.0 ? c.rgb / c.a : vec3(0.0);
    if (painted) {
      vec4 p = texture2D(paint, at); // sRGB, times its alpha
      float lit = clamp(dot(colour, vec3(0.2126, 0.7152, 0.0722)) / plain, 0.3, 1.5);
      if (p.a > 0.0) colour = mix(colour, light(p.rgb / p.a) * lit, p.a);
    }
    float here = away(at), behind = 0.0;
    if (strength > 0.0 && here > -1.0e3) {
      for (int i = 0; i < 8; i++) {
        float angle = float(i) * 0.785398;
        float there = away(at + vec2(cos(angle), sin(angle)) * RADIUS / size);
        if (here != -1.0 && there != -1.0) behind += max(0.0, here - there);
      }
      colour *= max(0.4, exp(-strength * behind));
    }
    if (surrounded && here > -1.0e3 && c.a > 0.0) colour *= open(at, here);
    gl_FragColor = vec4(colour, 1.0);
    #include <colorspace_fragment>
    gl_FragColor *= c.a; // the page's background shows through
  }`;
const STRENGTH = 9;
const UNIFORMS = ['picture', 'depths', 'paint', 'size', 'nearFar', 'strength', 'plain', 'painted', 'ambient', 'surrounded'];

export class Pipeline {
  /** `kit`: as exported by scene.js. */
  constructor(kit) {
    this.kit = kit;
    this.dome = this.surroundings = false; // enabled effects: shading by depth, ambient occlusion
    this.layers = undefined; // { render(renderer, camera, depths, size) -> texture or undefined }
    this.material = new kit.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, depthTest: false, depthWrite: false, transparent: true, blending: 0,
      premultipliedAlpha: true, defines: { RADIUS: '1.6' }, uniforms: Object.fromEntries(UNIFORMS.map((name) => [name, { value: null }])) });
    this.last = this.#over(this.material);
    this.ambient = new Ambient(kit, (material) => this.#over(material));
  }

  // Returns a scene with one triangle that covers the picture.
  #over(material) {
    const { kit } = this, scene = new kit.Scene(), geometry = (this.geometry ??= new kit.BufferGeometry().setAttribute('position',
      new kit.BufferAttribute(Float32Array.of(-1, -1, 0, 3, -1, 0, -1, 3, 0), 3))), triangle = new kit.Mesh(geometry, material);
    triangle.frustumCulled = false;
    return scene.add(triangle);
  }

  /** Returns true when direct drawing gives the same picture. */
  get idle() {
    return !this.dome && !this.surroundings && !this.layers?.any;
  }

  resize() {
    this.target?.dispose();
    this.target?.depthTexture.dispose();
    this.target = undefined;
    this.ambient.resize();
    this.layers?.resize();
  }

  render(scene) {
    const { kit } = this, { renderer, camera } = scene;
    if (this.idle) {
      renderer.render(scene.scene, camera);
      return;
    }
    const size = renderer.getDrawingBufferSize(new kit.Vector2());
    this.samples ??= isSoftware(renderer.getContext()) ? 0 : SAMPLES;
    this.target ??= new kit.WebGLRenderTarget(size.x, size.y, { samples: this.samples, type: HALF_FLOAT, depthTexture: new kit.DepthTexture(size.x, size.y, FLOAT) });
    const { probe } = scene, marked = probe.visible;
    probe.visible = false; // the probe is drawn over the effects
    renderer.setRenderTarget(this.target);
    renderer.clear();
    renderer.render(scene.scene, camera);
    const paint = this.layers?.any ? this.layers.render(renderer, camera, this.target.depthTexture, size) : undefined, { uniforms } = this.material;
    const ambient = this.surroundings ? this.ambient.render(renderer, camera, this.target.depthTexture, size) : null;
    const linear = scene.uniforms.plain.value;
    Object.entries({ picture: this.target.texture, depths: this.target.depthTexture, paint: paint ?? null, size, nearFar: new kit.Vector2(camera.near, camera.far),
      strength: this.dome ? STRENGTH : 0, plain: 0.2126 * linear.r + 0.7152 * linear.g + 0.0722 * linear.b, painted: Boolean(paint), ambient,
      surrounded: this.surroundings }).forEach(([name, value]) => (uniforms[name].value = value));
    renderer.setRenderTarget(null);
    renderer.clear();
    renderer.render(this.last, camera);
    probe.visible = marked;
    if (marked) {
      renderer.autoClear = false;
      renderer.render(probe, camera);
      renderer.autoClear = true;
    }
  }
}
