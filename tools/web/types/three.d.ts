// Types of "ebpo-viewer/three".
import type { Box3, Camera, Group, Material, MeshStandardMaterial, MeshStandardMaterialParameters, Object3D, Object3DEventMap, Ray, Vector3, WebGLRenderer } from 'three';
import type { EbpoInfo } from './element.js';

export interface EbpoModelOptions {
  /** The address of worker.js, if it is not beside the module. */
  worker?: string | URL;
  /** 'standard' (lit by the scene), 'viewer' (shaded as on the viewer's page), or a result of standardMaterial(). */
  material?: 'standard' | 'viewer' | Material;
  /** Shared workers; EbpoGroup.make() sets this option. */
  crew?: unknown;
  detail?: number;
  level?: number;
  mesh?: boolean;
  triangles?: number;
}

export interface EbpoModelEventMap extends Object3DEventMap {
  load: { info: EbpoInfo };
  /** The model has changed; draw a frame. */
  change: { stats: { nodes: number; triangles: number; meshTriangles: number } };
  progress: { got: number; want: number; quiet: number };
  idle: { traffic: { requests: number; bytes: number } };
  error: { error: Error & { code: string } };
}

export declare class EbpoModel extends Object3D<EbpoModelEventMap> {
  constructor(options?: EbpoModelOptions);
  readonly info: EbpoInfo | undefined;
  readonly content: Group;
  readonly material: Material;
  /** Nodes are refined until their cells have this size in pixels of the page; 0: down to the deepest level. */
  detail: number;
  /** The deepest drawn level. */
  level: number;
  /** True when leaves show the real faces. */
  mesh: boolean;
  /** Approximate limit of drawn triangles. */
  triangles: number;
  /** The visible box, in this object's coordinates, which are those of the file. */
  clip: Box3 | undefined;
  /** The root cell; available after load(). */
  readonly box: Box3;
  load(what: string | URL | Blob): Promise<EbpoInfo>;
  /** Call it before each frame. A number as `renderer` is the picture's height in pixels of the page. */
  update(camera: Camera, renderer: WebGLRenderer | number): void;
  /** The first point of the faces on a ray. */
  hit(ray: Ray): Promise<Vector3 | undefined>;
  probe(point: Vector3): Promise<{ where?: 'in' | 'out' | 'on' | 'maybe'; distance?: number; nearest?: Vector3; lo: number; hi: number; exact: boolean }>;
  dispose(): void;
}

/** Several models that share workers and a budget of triangles. */
export declare class EbpoGroup extends Group {
  constructor(options?: { triangles?: number; worker?: string | URL; workers?: number });
  /** Approximate limit for all models together. */
  triangles: number;
  readonly models: EbpoModel[];
  make(options?: EbpoModelOptions): EbpoModel;
  /** Call it instead of the models' update(). */
  update(camera: Camera, renderer: WebGLRenderer | number): void;
  dispose(): void;
}

/** Returns a material that evaluates the attributes of the model's meshes. */
export declare function standardMaterial(parameters?: MeshStandardMaterialParameters): MeshStandardMaterial;
