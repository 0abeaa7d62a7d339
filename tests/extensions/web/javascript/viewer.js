// Where the viewer's modules are: of an installation, where it is named.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const named = process.env.PYVISTA_VDI_VIEWER;
const viewer = named ? pathToFileURL(named).href
  : new URL("../../../../pyvista_vdi/extensions/web/viewer", import.meta.url).href;

export const viewerModule = (name) => import(`${viewer}/${name}`);
export const textOf = (name) => readFileSync(new URL(`${viewer}/${name}`), "utf-8");
