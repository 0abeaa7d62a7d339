// How a viewer looks: its parts, the bar and its panels, the editor, the controls of a series.

/** One for all viewers of a page. No markup in text: pages may forbid it. */
export const STYLE_SHEET = new CSSStyleSheet();
STYLE_SHEET.replaceSync(`
:host { display: block; position: relative; width: 100%; aspect-ratio: 16 / 9; overflow: hidden;
  background: black; print-color-adjust: exact;
  --bar: #f8f8f8e0; --ink: #181818; --edge: #0003; --mark: #0b57d0; --paper: #fff; }
:host([hidden]) { display: none; }
.box { position: absolute; inset: 0; container-type: size; }
canvas, img { position: absolute; width: 100%; height: 100%; inset: 0; }
canvas { touch-action: none; outline-offset: -2px; }
.over { pointer-events: none; }
.without { object-fit: contain; }
p, .hint { position: absolute; inset: auto 0 0 0; margin: 0; padding: 0.5em 1em; font: 14px sans-serif;
  color: white; background: #000a; }
.controls { position: absolute; inset: auto 0 0 0; display: flex; align-items: center; gap: 0.5em;
  padding: 2px 0.5em; font: 14px sans-serif; color: white; background: #0008; }
.controls input { flex: 1; min-width: 3em; height: 36px; margin: 0; accent-color: white; }
.controls output { min-width: 3em; overflow: hidden; text-align: right;
  font-variant-numeric: tabular-nums; }
.controls:not([hidden]) ~ :is(p, .hint) { bottom: 40px; }
progress { position: absolute; inset: auto 0 0 0; width: 100%; height: 3px; border: 0; }

.frame { position: absolute; inset: 0; display: flex; align-items: start; justify-content: end;
  padding: 6px; pointer-events: none; font: 14px/1.4 sans-serif; color: var(--ink); }
.bar, .panel { background: var(--bar); border-radius: 6px;
  box-shadow: 0 0 0 1px var(--edge); pointer-events: auto; }
.bar { display: flex; opacity: 0; transition: opacity .3s; }
:host(:hover) .bar, canvas:focus-visible ~ .frame .bar, .bar:focus-within, .bar:has(details[open]) {
  opacity: 1; }
:is(button, summary) { box-sizing: border-box; min-width: 36px; min-height: 36px; margin: 0;
  padding: 8px; border: 0; border-radius: 6px; font: inherit; color: inherit; background: none;
  list-style: none; cursor: pointer; }
.frame :is(button, summary):hover, details[open] > summary { background: #8884; }
.frame :focus-visible, .controls :focus-visible { outline: 2px solid var(--mark); outline-offset: -2px; }
.bar svg { display: block; width: 20px; height: 20px; fill: none; stroke: currentColor;
  stroke-width: 1.6; stroke-linecap: round; stroke-linejoin: round; }
.panel { position: absolute; top: 48px; right: 6px; box-sizing: border-box; width: 300px;
  max-height: calc(100% - 54px); overflow: auto; padding: 8px 12px; }
.panel button { border: 1px solid var(--edge); }
.panel .row { display: flex; gap: 4px; margin: 4px 0; }
.panel .row button { flex: 1; min-width: 0; padding: 0 2px; }
.panel :is(label, fieldset) { display: flex; gap: 8px; align-items: center; min-width: 0;
  min-height: 32px; margin: 0; padding: 0; border: 0; }
.panel legend { float: inline-start; min-width: 80px; padding: 0; }
.panel label > span:first-child { min-width: 80px; }
.panel input { flex: 1; width: 0; min-width: 0; height: 32px; margin: 0; accent-color: var(--mark); }

.curve { position: relative; height: 120px; margin: 6px 0; touch-action: none; cursor: crosshair;
  box-shadow: 0 0 0 1px var(--edge); }
.curve svg { position: absolute; inset: 0; width: 100%; height: 100%; overflow: clip;
  overflow-clip-margin: 2px; }
.curve path { vector-effect: non-scaling-stroke; }
.curve .lengths { fill: #8886; }
.curve .line { fill: none; stroke: currentColor; stroke-width: 2; }
.point { position: absolute; width: 24px; height: 24px; margin: -12px; border-radius: 12px;
  cursor: move; }
.point::after { content: ""; position: absolute; inset: 6px; border: 2px solid currentColor;
  border-radius: 50%; background: var(--paper); }
.point.last::after { background: var(--mark); }
.colors { height: 10px; margin: 6px 0; }
.ends { display: flex; justify-content: space-between; min-height: 20px; font-size: 12px;
  font-variant-numeric: tabular-nums; }
.panel button:disabled { opacity: 0.6; cursor: default; }
.editor select { flex: 1; min-width: 0; height: 32px; font: inherit; color: inherit;
  background: var(--paper); border: 1px solid var(--edge); border-radius: 6px; }

:host([controls="none"]) :is(.frame, .controls) { display: none; }
[hidden] { display: none !important; }
@container (max-width: 479px) { /* the settings stand below the picture, not over it */
  .box:has(details[open]) > :is(canvas, img) { height: 50%; }
  .panel { inset: auto 0 0; width: auto; height: 50%; max-height: none; border-radius: 0;
    padding-bottom: 44px; }
}
@container (max-width: 279px) or (max-height: 139px) { .bar, .panel { display: none; } }
@media (prefers-color-scheme: dark) {
  :host { --bar: #1c1c1ee0; --ink: #f2f2f2; --edge: #fff4; --mark: #a8c7fa; --paper: #2c2c2e; }
}
@media (hover: none) { .bar { opacity: 1; } }
@media (prefers-reduced-motion: reduce) { .bar { transition: none; } }
@media print {
  .box > canvas { height: 100% !important; object-fit: contain; }
  .frame, .controls, .hint { display: none; }
}`);
