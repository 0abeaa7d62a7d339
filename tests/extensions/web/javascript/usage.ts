// What somebody writes with the viewer's types: tsc checks it, and the types themselves. It is not run.
import { VDIViewer, type ViewerCamera } from "../../../../pyvista_vdi/extensions/web/viewer/element";
import { Scene } from "../../../../pyvista_vdi/extensions/web/viewer/scene";

const viewer = document.querySelector("vdi-viewer")!;
const same: VDIViewer = await viewer.ready;
const camera: ViewerCamera | null = same.camera;
if (camera) viewer.camera = { ...camera, view_angle: 20 };
viewer.look = { opacity: 2, clip: [0, 1, 0, 0.5, 0, 1] };
viewer.scene = new Scene(new Uint8Array(8));
viewer.addEventListener("camerachange", ({ detail }) => detail.camera.position[0].toFixed());
const { data } = await viewer.screenshot({ width: 320, height: 180 });
data.fill(0);

// @ts-expect-error three numbers
viewer.camera = { position: [1, 2], focal_point: [0, 0, 0], view_up: [0, 0, 1] };
// @ts-expect-error it is read only
viewer.playing = true;
// @ts-expect-error a factor
viewer.look = { brightness: "2" };
