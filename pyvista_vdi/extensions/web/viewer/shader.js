// The raycaster's shaders: the walk of opencl/raycasting/raycast.cl, a ray per fragment.
//
// A ray is clipped, carried into list space, where lists and supersegments are boxes and it stays
// straight, and steps from list to list. r runs along it over an interval of length 1 and is 0 at
// the end that is deeper in V_O, where the interpolated 1/Z is smallest.
//
// PACKED    8-byte supersegments
// OPAQUE    rays end at the opaque depth of their pixel
// VALUES    supersegments keep values, which a table makes media of
import { STACK_SHIFT, TEXTURE_WIDTH } from "./prepare.js";
import { FIRST_SPREAD, MEAN_STEPS, SPREADS } from "./values.js";

/** Planes of the user's, and of a scene's VDI, that a ray can be clipped to: WebGL has room for them. */
export const MOST_CLIPPING_PLANES = 24;

/** A triangle that covers the viewport. */
export const VERTEX_SHADER = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

/** The fragment shader with some of the names above defined. */
export function fragmentShader(defines, planes) {
  // Unrolled: SwiftShader looks up arrays by constants in a tenth of the time
  const clipping = Array.from({ length: planes },
    (_, k) => `  clip(pixel, planeValue[${k}], planeSlope[${k}]);`);
  return `#version 300 es
${defines.map((name) => `#define ${name}`).join("\n")}
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#define PLANES ${planes}
#define WIDTH_SHIFT ${Math.log2(TEXTURE_WIDTH)}
#define STACK_SHIFT ${STACK_SHIFT}
#define MEAN_STEPS ${MEAN_STEPS}
#define SPREADS ${SPREADS}
#define FIRST_SPREAD ${FIRST_SPREAD}
${SOURCE.replace("CLIPPING", clipping.join("\n"))}`;
}

const SOURCE = `
uniform vec2 middle;              // half the viewport's size, pixels
uniform vec3 formValue[4], formSlope[4]; // u, v, depth coordinate, denominator: for 1, a and b
uniform vec3 planeValue[PLANES], planeSlope[PLANES];
uniform mat3 direction;           // model' length per t: columns for 1, a and b
uniform ivec2 window;             // lists
uniform vec4 depths;              // of rays.js, depthForms: the depth coordinate of an offset
uniform vec2 reciprocals;         // and 1 / Z of a depth coordinate
uniform float firstDepth, slabsPerDepth; // of the occupancy grid, offsets from the depth origin
uniform float cutoff;
uniform float brightness, thickness; // factors of colours and of optical depths
uniform usampler2D lists, masks;
#ifdef PACKED
uniform usampler2D faces;         // both words of a supersegment
uniform float codeStep, nearest;  // world'; least offset in front of the eye
#else
uniform sampler2D faces, media;
#endif
#ifdef VALUES
uniform sampler2D table;          // of values.js: media by mean and spread
#endif
#ifdef OPAQUE
uniform sampler2D opaque;         // view depth, world units
uniform float worldScale, reference;
#endif
out vec4 seen;

#define INFINITE 1e30

ivec2 texel(int k) { return ivec2(k & ((1 << WIDTH_SHIFT) - 1), k >> WIDTH_SHIFT); }

float coordinate(float offset) {
  return (depths.x * offset + depths.y) / (depths.z * offset + depths.w);
}

float offsetOf(float z) {
  return (depths.w * z - depths.y) / (depths.x - depths.z * z);
}

// 1 / Z; in parallel projection lengths are not divided by it.
float reciprocal(float z) { return reciprocals.x + reciprocals.y * z; }

// -- a list, and its supersegments in the ray's sense: depths are negated for rays that come back

uvec4 list;
int count;
bool away;

#ifdef PACKED
float depthOfCode(uint code) {
  float offset = float(int(list.z) + int(code) * int(list.y >> 16)) * codeStep;
  return coordinate(max(offset, nearest));
}
#endif

void enter(int i, int j) {
  list = texelFetch(lists, ivec2(i, j), 0);
#ifdef PACKED
  count = int(list.y & 0xffffu);
#else
  count = int(list.y);
#endif
}

ivec2 place(int n) { return texel(int(list.x) + (away ? n : count - 1 - n)); }

// Where the ray enters and leaves the n-th supersegment that it comes to.
vec2 facesMet(int n) {
#ifdef PACKED
  uint word = texelFetch(faces, place(n), 0).x;
  vec2 face = vec2(depthOfCode(word & 16383u), depthOfCode(word >> 14 & 16383u));
#else
  vec2 face = texelFetch(faces, place(n), 0).xy;
#endif
  return away ? face : -face.yx;
}

#ifdef VALUES
// The medium of a mean, a spread and the share of the length that holds them.
vec4 classified(float mean, float spread, float share) {
  int row = int(floatBitsToUint(spread) + (1u << 19) >> 20) - FIRST_SPREAD;
  ivec2 at = ivec2(int(mean * float(MEAN_STEPS) + 0.5), clamp(row, 0, SPREADS - 1));
  vec4 medium = texelFetch(table, min(at, ivec2(MEAN_STEPS, SPREADS - 1)), 0);
  return vec4(medium.rgb, medium.a * share);
}
#endif

// Straight colour, and extinction per model' length.
vec4 mediumMet(int n) {
#ifdef PACKED
  uvec2 words = texelFetch(faces, place(n), 0).xy;
  uint tau = words.x >> 28 | (words.y & 255u) << 4;
  float thickness = float(int(words.x >> 14 & 16383u) - int(words.x & 16383u));
  float depth = tau > 0u ? uintBitsToFloat((tau + ((127u - 18u) << 7) - 1u) << 16) : 0.0;
#ifdef VALUES
  vec3 bytes = vec3(words.yyy >> uvec3(8, 16, 24) & 255u) / 255.0;
  return classified(bytes.x + bytes.y / 255.0, depth, bytes.z);
#else
  float extinction = min(depth * uintBitsToFloat(list.w) / thickness, 3.4e38);
  return vec4(vec3(words.yyy >> uvec3(8, 16, 24) & 255u) / 255.0, extinction);
#endif
#else
  vec4 medium = texelFetch(media, place(n), 0);
#ifdef VALUES
  medium = classified(medium.x + medium.y / 255.0, medium.w, medium.z);
#endif
  return medium;
#endif
}

// 1 - exp(-tau) without cancellation, as by opencl/lib/opacity.cl: 1 - 2^-k exp(-rest).
float opacityOf(float tau) {
  float x = min(tau, 32.0);
  float k = floor(x * 1.44269504 + 0.5);
  float rest = x - k * 0.693147182;
  float left = intBitsToFloat(127 - int(k) << 23);
  float q = 0.5 + rest * (-0.16666543 + rest * (0.041666284 + rest * (-0.008366566 +
    rest * 0.0013946417)));
  return (1.0 - left) + left * (rest - rest * rest * q);
}

// -- the ray in list space

vec3 deep, along; // point(r) = deep + r along

vec2 inverse, zero; // of crossings: by a component that does not change, they are at infinity
vec2 ahead;         // from a list's index to its border ahead, from the window's middle

// Where the ray leaves the lists of these indices: from the border's number, never accumulated.
vec2 crossings(vec2 cell) { return (cell + ahead - zero) * inverse; }

// The indices that stepping from some would have reached at r, but not beyond a stack's edge.
vec2 cellReached(vec2 cell, vec2 edge, vec2 step_, float r, vec2 middle_) {
  vec2 behind = edge + step_;
  vec2 reached = floor(r * along.xy + deep.xy + middle_);
  reached = clamp(reached, min(cell, behind), max(cell, behind));
  bvec2 moved = notEqual(reached, cell);
  bvec2 tooFar = greaterThan(crossings(reached - step_), vec2(r));
  bvec2 farther = lessThanEqual(crossings(reached), vec2(r));
  vec2 back = vec2(moved) * vec2(tooFar);
  vec2 on = (1.0 - back) * vec2(farther) * vec2(notEqual(reached, behind));
  return mix(reached + (on - back) * step_, cell, equal(along.xy, vec2(0.0)));
}

int highestBit(uint v) { // of a word that is not 0, without a rounding
  uint high = v >> 8;
  return high != 0u ? int(floatBitsToUint(float(high)) >> 23) - 127 + 8
                    : int(floatBitsToUint(float(v)) >> 23) - 127;
}

// The nearest occupied slab from one on, in the ray's sense; -1: none.
int nearestSlab(uvec2 mask, int slab) {
  int bit = slab & 31;
  uint own = (slab < 32 ? mask.x : mask.y) &
             (away ? 0xffffffffu << uint(bit) : 0xffffffffu >> uint(31 - bit));
  uint behind = away ? (slab < 32 ? mask.y : 0u) : (slab < 32 ? 0u : mask.x);
  uint ahead = own != 0u ? own : behind;
  if (ahead == 0u) return -1;
  if (away) ahead &= ~ahead + 1u;
  bool high = own != 0u ? slab >= 32 : away;
  return highestBit(ahead) + (high ? 32 : 0);
}

float t0 = -INFINITE, t1 = INFINITE; // the ray's part, view depth of its camera

void clip(vec3 pixel, vec3 atValue, vec3 atSlope) {
  float value = dot(atValue, pixel), slope = dot(atSlope, pixel);
  float t = -value / slope;
  t0 = slope > 0.0 ? max(t0, t) : t0;
  t1 = slope < 0.0 ? min(t1, t) : slope == 0.0 && value < 0.0 ? -INFINITE : t1;
}

void main() {
  seen = vec4(0.0);
  vec3 pixel = vec3(1.0, gl_FragCoord.xy - middle);
#ifdef OPAQUE
  t1 = min(t1, texelFetch(opaque, ivec2(gl_FragCoord.xy), 0).x * worldScale - reference);
#endif
CLIPPING
  if (!(t0 < t1)) return;

  vec3 start, end;
  {
    vec4 value = vec4(dot(formValue[0], pixel), dot(formValue[1], pixel),
                      dot(formValue[2], pixel), dot(formValue[3], pixel));
    vec4 slope = vec4(dot(formSlope[0], pixel), dot(formSlope[1], pixel),
                      dot(formSlope[2], pixel), dot(formSlope[3], pixel));
    vec4 p0 = value + t0 * slope, p1 = value + t1 * slope;
    start = p0.xyz / p0.w;
    end = p1.xyz / p1.w;
  }
  along = end - start;
  along = mix(along, vec3(0.0), lessThan(abs(along), vec3(1.2e-38)));
  away = along.z >= 0.0;
  deep = away ? end : start;
  float rEnd = away ? 0.0 : 1.0;
  float r = rEnd - 1.0;
  float scale = (t1 - t0) * length(direction * pixel) * reciprocal(start.z) * reciprocal(end.z) * thickness;
  float sense = away ? 1.0 : -1.0;
  float perDepth = along.z != 0.0 ? sense / along.z : 0.0;
  vec2 half_ = vec2(window) * 0.5, last = vec2(window - 1);
  bvec2 changes = notEqual(along.xy, vec2(0.0));
  inverse = mix(vec2(1.0), 1.0 / along.xy, changes);
  zero = mix(vec2(-INFINITE), deep.xy, changes);
  bvec2 upwards = greaterThan(along.xy, vec2(0.0));
  vec2 step_ = mix(vec2(-1.0), vec2(1.0), upwards);
  ahead = vec2(upwards) - half_;
  vec2 cell = clamp(floor(start.xy + half_), vec2(0.0), last);
  const float stackEdge = float(1 << STACK_SHIFT); // of a stack, lists
  float depth = sense * start.z;
  bool goes = true;
  bool fresh = abs(along.x) + abs(along.y) > 2.0; // a stack that has not been looked at
  int n = 0, low = 0;
  vec3 color = vec3(0.0);
  float left = 1.0;

  for (int look = 0; goes && look < 100000; ++look) {
    if (fresh) { // pass by what is empty
      for (int stack = 0; stack < 100000; ++stack) {
        uvec2 mask = texelFetch(masks, ivec2(cell) >> STACK_SHIFT, 0).xy;
        int slab = int(clamp((offsetOf(sense * depth) - firstDepth) * slabsPerDepth, 0.0, 63.0));
        int nearestOne = nearestSlab(mask, slab);
        if (nearestOne == slab) break;
        vec2 first = floor(cell / stackEdge) * stackEdge;
        vec2 edge = mix(first, first + (stackEdge - 1.0), upwards);
        vec2 border = crossings(edge);
        float until = min(border.x, border.y);
        if (nearestOne >= 0 && along.z != 0.0) {
          float face = firstDepth + float(away ? nearestOne : nearestOne + 1) / slabsPerDepth;
          until = min(until, (sense * coordinate(face) - sense * deep.z) * perDepth);
        }
        vec2 to = cellReached(cell, edge, step_, until, half_);
        bvec2 moves = notEqual(to, cell);
        goes = until < rEnd && all(greaterThanEqual(to, vec2(0.0))) &&
          all(lessThanEqual(to, last));
        if (!goes || !any(moves)) break;
        vec2 entered = crossings(to - step_);
        if (moves.x) r = max(r, entered.x);
        if (moves.y) r = max(r, entered.y);
        depth = sense * (r * along.z + deep.z);
        cell = to;
        if (floor(to / stackEdge) * stackEdge == first) break;
      }
    }
    fresh = false;
    bool entered = true;
    int high = 0x7fffffff, missed = 0;
    low = 0;
    for (int turn = 0; goes && !fresh && turn < 100000; ++turn) {
      if (entered) enter(int(cell.x), int(cell.y));
      vec2 border = crossings(cell);
      float rNext = max(r, min(rEnd, min(border.x, border.y)));
      float nextDepth = sense * (rNext * along.z + deep.z);
      // The first supersegment that ends behind the depth: guess, and the guess of the list before
      n = min(n, count);
      vec2 face = n < count ? facesMet(n) : vec2(INFINITE);
      bool passed = face.y <= depth;
      bool beyond = face.x > depth && n > low && facesMet(n - 1).y > depth;
      bool stays = passed || beyond, met = false;
      if (!stays && face.x <= nextDepth) {
        float from = face.x > depth ? clamp((face.x - sense * deep.z) * perDepth, r, rNext) : r;
        float to = face.y < nextDepth
          ? clamp((face.y - sense * deep.z) * perDepth, from, rNext) : rNext;
        vec4 medium = mediumMet(n);
        float crossed = scale * (to - from) /
          (reciprocal(from * along.z + deep.z) * reciprocal(to * along.z + deep.z));
        float weight = left * opacityOf(medium.w * crossed);
        color += weight * medium.rgb;
        left -= weight;
        met = stays = passed = face.y <= nextDepth;
      }
      if (stays) {
        if (passed) low = n + 1;
        else high = n - 1;
        n += passed ? 1 : -1;
        if (!met && ++missed >= 4) n = (low + min(high, count)) >> 1;
        goes = left >= cutoff;
      } else {
        vec2 next = cell + (border.x <= border.y ? vec2(step_.x, 0.0) : vec2(0.0, step_.y));
        fresh = floor(next / stackEdge) != floor(cell / stackEdge);
        goes = rNext < rEnd && left >= cutoff && all(greaterThanEqual(next, vec2(0.0))) &&
          all(lessThanEqual(next, last));
        cell = next;
        r = goes ? rNext : r;
        depth = nextDepth;
        low = missed = 0;
        high = 0x7fffffff;
      }
      entered = !stays;
    }
  }
  if (brightness != 1.0) color = min(color * brightness, vec3(1.0 - left));
  seen = vec4(color, 1.0 - left);
}
`;
