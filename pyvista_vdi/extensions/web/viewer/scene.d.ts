// What a plotter shows beside a VDI: docs/web.md, "Scenes".
export class Scene {
  /** @param bytes What pyvista_vdi.extensions.web.scene.scene_of makes. */
  constructor(bytes: Uint8Array);
  readonly loaded: Promise<unknown>;
  readonly whole: Promise<void>;
  readonly complete: boolean;
}
