// Vectors as arrays of numbers.

/** a + s b. */
export const add = (a, b, s = 1) => a.map((x, k) => x + s * b[k]);

/** a - b. */
export const subtract = (a, b) => a.map((x, k) => x - b[k]);

/** s a. */
export const times = (a, s) => a.map((x) => x * s);

/** The scalar product, of as many components as b has. */
export const dot = (a, b) => b.reduce((sum, x, k) => sum + a[k] * x, 0);

/** The cross product. */
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
];

/** The vector of length 1 in the same direction; NaN where there is none. */
export const unit = (a) => times(a, 1 / Math.hypot(...a));
