// Types of "ebpo-viewer/three".
import type { Box3, Camera, Group, Material, MeshStandardMaterial, MeshStandardMaterialParameters, Object3D, Object3DEventMap, Vector3, WebGLRenderer } from 'three';
import type { EbpoInfo } from './element.js';

export interface EbpoModelOptions {
  /** where worker.js is, if it does not lie beside the module */
  worker?: string | URL;
  /** 'standard' (lit by the scene), 'viewer' (as the viewer's page draws), or one of standardMaterial() */
  material?: 'standard' | 'viewer' | Material;
  /** of an EbpoGroup: its make() gives it */
  crew?: unknown;
  detail?: number;
  level?: number;
  mesh?: boolean;
  triangles?: number;
}

export interface EbpoModelEventMap extends Object3DEventMap {
  load: { info: EbpoInfo };
  /** The picture is another: draw a frame. */
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
  /** nodes are refined until their cells are so many pixels of the page; 0: as far as the file goes */
  detail: number;
  /** the deepest level drawn */
  level: number;
  /** whether leaves show the real faces */
  mesh: boolean;
  /** about the most that are drawn */
  triangles: number;
  /** what is shown, in this object's coordinates, which are the file's */
  clip: Box3 | undefined;
  /** the root cell; only when loaded */
  readonly box: Box3;
  load(what: string | URL | Blob): Promise<EbpoInfo>;
  /** to be called before each frame; a number is the picture's height in pixels of the page */
  update(camera: Camera, renderer: WebGLRenderer | number): void;
  probe(point: Vector3): Promise<{ where?: 'in' | 'out' | 'on' | 'maybe'; distance?: number; nearest?: Vector3; lo: number; hi: number; exact: boolean }>;
  dispose(): void;
}

/** Several models that share workers and a budget of triangles. */
export declare class EbpoGroup extends Group {
  constructor(options?: { triangles?: number; worker?: string | URL; workers?: number });
  /** of all models together, about */
  triangles: number;
  readonly models: EbpoModel[];
  make(options?: EbpoModelOptions): EbpoModel;
  /** in place of the models' own update() */
  update(camera: Camera, renderer: WebGLRenderer | number): void;
  dispose(): void;
}

/** A material that knows what the attributes of the model's meshes mean. */
export declare function standardMaterial(parameters?: MeshStandardMaterialParameters): MeshStandardMaterial;
