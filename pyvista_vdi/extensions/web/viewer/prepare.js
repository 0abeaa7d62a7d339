// A VDI's arrays to what the shader reads: textures as typed arrays, made off the main thread.
import { frameOf, listSpace, modelPoint, pixelRays } from "./rays.js";

/** Texels in a row of the textures that hold supersegments. */
export const TEXTURE_WIDTH = 4096;
/** Lists along an edge of a stack of the occupancy grid, and its slabs: bits of two words. */
export const STACK_SHIFT = 4;
const SLABS = 64;
/** Bins of the histogram of values. */
const BINS = 128;
const LARGEST = 3.4028234663852886e38;
const SMALLEST = 1.1754943508222875e-38;

/** Prepare what decode.js made for a Raycaster: lists as textures, list space, and what it is. */
export function prepare(vdi) {
  const frame = frameOf(vdi);
  const space = listSpace(frame, vdi);
  const packed = vdi.precision === "8-byte";
  const n = vdi.offsets[vdi.offsets.length - 1];
  const arrays = packed ? packedLists(vdi, frame, space, n) : exactLists(vdi, frame, space, n);
  const { windowSize, camera, bounds, level, precision, metadata } = vdi;
  return {
    windowSize, camera, bounds, level, precision, metadata, n, frame, space, packed,
    ...arrays, boxes: occupiedBoxes(vdi, frame, space, arrays), step: packed ? vdi.depthStep * frame.scale : 0,
    ...(vdi.values && { values: preparedValues(vdi, frame, space) }),
  };
}

/** The buffers of what {@link prepare} made, to be handed over between threads. */
export function transferables(prepared) {
  return ["lists", "faces", "media", "masks"]
    .filter((name) => prepared[name]).map((name) => prepared[name].buffer);
}

const texels = (n) => TEXTURE_WIDTH * Math.max(1, Math.ceil(n / TEXTURE_WIDTH));

// Model' length of a list's centre ray per unit of view depth (world').
function centreRay(space, [width, height], list) {
  const a = (list % width) + 0.5 - width / 2;
  const b = Math.floor(list / width) + 0.5 - height / 2;
  const [one, ofA, ofB] = space.perDepth;
  return Math.hypot(one[0] + a * ofA[0] + b * ofB[0], one[1] + a * ofA[1] + b * ofB[1],
    one[2] + a * ofA[2] + b * ofB[2]);
}

function exactLists(vdi, frame, space, n) {
  const { offsets, windowSize, front, back, color, opticalDepth } = vdi;
  const lists = new Uint32Array(2 * windowSize[0] * windowSize[1]);
  const faces = new Float32Array(2 * texels(n));
  const media = new Float32Array(4 * texels(n));
  const coordinate = (offset) => {
    const [a, b, c, d] = space.depths, x = Math.max(offset, space.nearest);
    return (a * x + b) / (c * x + d);
  };
  const slabs = occupancy(vdi, frame, space);
  for (let list = 0; list < lists.length / 2; ++list) {
    const begin = offsets[list], end = offsets[list + 1];
    lists[2 * list] = begin;
    lists[2 * list + 1] = end - begin;
    if (begin === end) continue;
    const perDepth = centreRay(space, windowSize, list);
    for (let k = begin; k < end; ++k) {
      const length = Math.max((back[k] - front[k]) * frame.scale * perDepth, SMALLEST);
      faces[2 * k] = coordinate(front[k] * frame.scale);
      faces[2 * k + 1] = coordinate(back[k] * frame.scale);
      media[4 * k] = color[3 * k];
      media[4 * k + 1] = color[3 * k + 1];
      media[4 * k + 2] = color[3 * k + 2];
      media[4 * k + 3] = vdi.values ? opticalDepth[k] : Math.min(opticalDepth[k] / length, LARGEST);
      slabs.occupy(list, front[k], back[k]);
    }
  }
  return { lists, faces, media, ...slabs.grid };
}

// Lists of 8-byte supersegments: (first, count and stride, origin, 1 over a code's model' length).
function packedLists(vdi, frame, space, n) {
  const { offsets, windowSize, words, origin, stride, depthStep } = vdi;
  const lists = new Uint32Array(4 * windowSize[0] * windowSize[1]);
  const floats = new Float32Array(lists.buffer);
  const slabs = occupancy(vdi, frame, space);
  for (let list = 0; list < lists.length / 4; ++list) {
    const begin = offsets[list], end = offsets[list + 1];
    lists[4 * list] = begin;
    lists[4 * list + 1] = (end - begin) | (stride[list] << 16);
    lists[4 * list + 2] = origin[list];
    if (begin === end) continue;
    const code = stride[list] * depthStep * frame.scale * centreRay(space, windowSize, list);
    floats[4 * list + 3] = Math.min(1 / Math.max(code, SMALLEST), LARGEST);
    for (let k = begin; k < end; ++k) {
      const word = words[2 * k];
      const depth = (c) => (origin[list] + c * stride[list]) * depthStep;
      slabs.occupy(list, depth(word & 16383), depth((word >>> 14) & 16383));
    }
  }
  let faces = words;
  if (words.length !== 2 * texels(n)) {
    faces = new Uint32Array(2 * texels(n));
    faces.set(words);
  }
  return { lists, faces, ...slabs.grid };
}

// How long the values are that lie in each bin of their range; and steps per model' length.
function preparedValues(vdi, frame, space) {
  const { offsets, windowSize, words, stride, bounds, values } = vdi;
  const histogram = new Float32Array(BINS);
  for (let list = 0; list + 1 < offsets.length; ++list) {
    if (offsets[list] === offsets[list + 1]) continue;
    const code = (words ? stride[list] * vdi.depthStep : 1) * centreRay(space, windowSize, list);
    for (let k = offsets[list]; k < offsets[list + 1]; ++k) {
      const [mean, spread, share, depth] = words ? valuesOfWords(words[2 * k], words[2 * k + 1])
        : [vdi.color[3 * k] + vdi.color[3 * k + 1] / 255, vdi.opticalDepth[k], vdi.color[3 * k + 2],
          vdi.back[k] - vdi.front[k]];
      const bin = (x) => Math.min(Math.max(Math.floor(x * BINS), 0), BINS - 1);
      const first = bin(mean - Math.sqrt(3) * spread), last = bin(mean + Math.sqrt(3) * spread);
      const length = depth * code * share / (last - first + 1);
      for (let b = first; b <= last; ++b) histogram[b] += length;
    }
  }
  const diagonal = Math.hypot(...[0, 2, 4].map((k) => bounds[k + 1] - bounds[k])) || 1;
  return { ...values, histogram, stepsPerLength: diagonal / values.sampleDistance };
}

const spreadRead = new Float32Array(1), spreadBits = new Uint32Array(spreadRead.buffer);

// Mean, spread, share and thickness in codes, as mediumMet of shader.js has them.
function valuesOfWords(first, second) {
  const tau = (first >>> 28) | ((second & 255) << 4);
  spreadBits[0] = tau ? (tau + (109 << 7) - 1) << 16 : 0;
  return [((second >>> 8) & 255) / 255 + ((second >>> 16) & 255) / 65025, spreadRead[0], (second >>> 24) / 255,
    ((first >>> 14) & 16383) - (first & 16383)];
}

// The occupancy grid (paper, section 4): one bit for each slab of equal view depth of each stack.
function occupancy({ windowSize, depthOrigin }, frame, space) {
  const [near, far] = space.range.map((offset) => offset / frame.scale);
  const perDepth = far > near ? SLABS / (far - near) : 1;
  // Depths that are looked up are rounded: a tenth of a slab, and as many units in the last place
  // of the depth as a ray's coordinates are off by
  const margin = 0.1 + 64 * 2 ** -23 * perDepth * Math.max(Math.abs(near), Math.abs(far),
    Math.abs(far + depthOrigin));
  const stacks = windowSize.map((lists) => ((lists - 1) >> STACK_SHIFT) + 1);
  const masks = new Uint32Array(2 * stacks[0] * stacks[1]);
  const slab = (x) => Math.min(Math.max(Math.floor(x), 0), SLABS - 1);
  return {
    grid: { masks, stacks, firstDepth: space.range[0], slabsPerDepth: perDepth / frame.scale },
    occupy(list, front, back) {
      const i = (list % windowSize[0]) >> STACK_SHIFT;
      const j = Math.floor(list / windowSize[0]) >> STACK_SHIFT;
      const at = 2 * (j * stacks[0] + i);
      const first = slab((front - near) * perDepth - margin);
      const last = slab((back - near) * perDepth + margin);
      if (first < 32) masks[at] |= bits(first, Math.min(last, 31));
      if (last >= 32) masks[at + 1] |= bits(Math.max(first - 32, 0), last - 32);
    },
  };
}

// Corners, model', of a box in list space for each row of stacks that has something.
function occupiedBoxes({ windowSize, camera, depthOrigin }, frame, space, { masks, stacks: [wide, high] }) {
  const rays = pixelRays(frame, camera, windowSize), boxes = [];
  const ends = (axis, first, last) => [first << STACK_SHIFT, (last + 1) << STACK_SHIFT]
    .map((list, k) => Math.min(list, windowSize[axis]) - windowSize[axis] / 2 + 2 * k - 1);
  const depths = space.range.map((offset) => offset + depthOrigin * frame.scale)
    .map((depth) => (space.parallel ? depth : Math.max(depth, 0)) - rays.reference);
  for (let row = 0; row < high; ++row) {
    const has = (k) => masks[2 * (row * wide + k)] | masks[2 * (row * wide + k) + 1];
    const here = Array.from({ length: wide }, (_, k) => k).filter(has);
    if (!here.length) continue;
    boxes.push(depths.flatMap((t) => ends(0, here[0], here.at(-1)).flatMap((a) =>
      ends(1, row, row).map((b) => modelPoint(rays, [a, b], t)))));
  }
  return boxes;
}

// Bits first to last of a word, both included.
function bits(first, last) {
  return (-1 << first) & (-1 >>> (31 - last));
}
