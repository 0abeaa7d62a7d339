// A viewer whose VDIs a server makes: docs/web.md, "Served".
import type { VDIViewer } from "./element.js";

export class RemoteVDI extends EventTarget {
  constructor(viewer: VDIViewer, url: string);
  setLook(look: { cmap?: string; opacity?: string | number[]; clim?: [number, number] }): void;
  setStep(step: number): void;
  close(): void;
}

export function connectPage(viewer: VDIViewer, panel: HTMLElement, line: HTMLElement): RemoteVDI;
