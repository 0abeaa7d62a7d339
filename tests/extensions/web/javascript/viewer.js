// Where the viewer's modules are: of an installation, where it is named.
import { pathToFileURL } from "node:url";

const named = process.env.PYVISTA_VDI_VIEWER;
const viewer = named ? pathToFileURL(named).href
  : new URL("../../../../pyvista_vdi/extensions/web/viewer", import.meta.url).href;

export const viewerModule = (name) => import(`${viewer}/${name}`);
