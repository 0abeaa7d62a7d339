// What ESLint holds the viewer's modules to: mistakes, not taste.
const names = (text) => Object.fromEntries(text.split(" ").map((name) => [name, "readonly"]));

export default [{
  files: ["**/*.js"],
  languageOptions: {
    ecmaVersion: 2024,
    sourceType: "module",
    globals: names("window document self console performance navigator location history screen URL Blob Worker " +
      "Response ReadableStream DecompressionStream TextDecoder WebSocket HTMLElement Element Node CSSStyleSheet CSS " +
      "CustomEvent EventTarget AbortController AbortSignal ResizeObserver IntersectionObserver MutationObserver " +
      "matchMedia getComputedStyle requestAnimationFrame cancelAnimationFrame setTimeout clearTimeout setInterval " +
      "clearInterval queueMicrotask structuredClone customElements fetch atob btoa createImageBitmap ImageData " +
      "DOMException OffscreenCanvas globalThis process Buffer TextEncoder setImmediate"),
  },
  linterOptions: { reportUnusedDisableDirectives: "error" },
  rules: {
    "no-undef": "error",
    "no-unused-vars": ["error", { argsIgnorePattern: "^_" }],
    "no-var": "error",
    "prefer-const": ["error", { destructuring: "all" }],
    "eqeqeq": "error",
    "no-redeclare": "error",
    "no-dupe-keys": "error",
    "no-unreachable": "error",
    "no-self-assign": "error",
    "no-loss-of-precision": "error",
    "no-unsafe-finally": "error",
    "no-useless-escape": "error",
    "no-throw-literal": "error",
    "valid-typeof": "error",
  },
}];
