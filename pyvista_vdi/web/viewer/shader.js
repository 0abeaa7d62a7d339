// The raycaster's shaders: the walk of opencl/raycasting/raycast.cl, a ray per fragment.
//
// A ray is clipped, carried into list space, where lists and supersegments are boxes and it stays
// straight, and steps from list to list. r runs along it over an interval of length 1 and is 0 at
// the end that is deeper in V_O, where the interpolated 1/Z is smallest.
//
// PARALLEL, SHIFTED    the depth coordinate: Z - Z_ref; (Z - Z_ref) / Z, for long lenses; else -1/Z
// PACKED               8-byte supersegments
// OPAQUE               rays end at the opaque depth of their pixel
import { STACK_SHIFT, TEXTURE_WIDTH } from "./prepare.js";

/** Planes that a ray can be clipped to: box, viewport, eyes, and eight of the user's. */
export const MOST_PLANES = 20;

/** A triangle that covers the viewport. */
export const VERTEX_SHADER = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

/** The fragment shader with some of the names above defined. */
export function fragmentShader(defines) {
  return `#version 300 es
${defines.map((name) => `#define ${name}`).join("\n")}
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#define MOST_PLANES ${MOST_PLANES}
#define WIDTH_SHIFT ${Math.log2(TEXTURE_WIDTH)}
#define STACK_SHIFT ${STACK_SHIFT}
${SOURCE}`;
}

const SOURCE = `
uniform vec2 corner, middle;      // of the viewport, and half its size: pixels
uniform vec3 formValue[4], formSlope[4]; // u, v, depth coordinate, denominator: for 1, a and b
uniform vec3 planeValue[MOST_PLANES], planeSlope[MOST_PLANES];
uniform int planes;
uniform mat3 direction;           // model' length per t: columns for 1, a and b
uniform ivec2 window;             // lists
uniform ivec2 stacks;
uniform float depthOrigin;        // world'
uniform float firstDepth, slabsPerDepth; // of the occupancy grid, offsets from the depth origin
uniform float cutoff;
uniform usampler2D lists, masks;
#ifdef PACKED
uniform usampler2D faces;         // both words of a supersegment
uniform float codeStep, nearest;  // world'; least offset in front of the eye
#else
uniform sampler2D faces, media;
#endif
#ifdef OPAQUE
uniform sampler2D opaque;         // view depth, world units
uniform float worldScale, reference;
#endif
out vec4 seen;

#define INFINITE 1e30
#define TURNS_PER_LOOK 4

ivec2 texel(int k) { return ivec2(k & ((1 << WIDTH_SHIFT) - 1), k >> WIDTH_SHIFT); }

float coordinate(float offset) {
#if defined(PARALLEL)
  return offset;
#elif defined(SHIFTED)
  return offset / (offset + depthOrigin);
#else
  return -1.0 / (offset + depthOrigin);
#endif
}

float offsetOf(float z) {
#if defined(PARALLEL)
  return z;
#elif defined(SHIFTED)
  return z * depthOrigin / (1.0 - z);
#else
  return -1.0 / z - depthOrigin;
#endif
}

// 1 / Z; in parallel projection lengths are not divided by it.
float reciprocal(float z) {
#if defined(PARALLEL)
  return 1.0;
#elif defined(SHIFTED)
  return (1.0 - z) / depthOrigin;
#else
  return -z;
#endif
}

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

// Straight colour, and extinction per model' length.
vec4 mediumMet(int n) {
#ifdef PACKED
  uvec2 words = texelFetch(faces, place(n), 0).xy;
  uint tau = words.x >> 28 | (words.y & 255u) << 4;
  float thickness = float(int(words.x >> 14 & 16383u) - int(words.x & 16383u));
  float depth = tau > 0u ? uintBitsToFloat((tau + ((127u - 18u) << 7) - 1u) << 16) : 0.0;
  float extinction = min(depth * uintBitsToFloat(list.w) / thickness, 3.4e38);
  return vec4(vec3(words.yyy >> uvec3(8, 16, 24) & 255u) / 255.0, extinction);
#else
  return texelFetch(media, place(n), 0);
#endif
}

// 1 - exp(-tau) without cancellation.
float opacityOf(float tau) {
  return tau < 0.02 ? tau * (1.0 - tau * (0.5 - tau * (1.0 / 6.0))) : 1.0 - exp(-tau);
}

// -- the ray in list space

vec3 deep, along; // point(r) = deep + r along

#define CROSSING(axis, index) (along.axis == 0.0 ? INFINITE \\
    : (float(index) + border.axis - deep.axis) / along.axis)

// The index that stepping from one would have reached at r, but not beyond a stack's edge.
int indexReached(int index, int edge, int step, float r, float along, float deep, float half_,
                 float border) {
  if (along == 0.0) return index;
  int behind = edge + step;
  int reached = int(floor(r * along + deep + half_));
  reached = clamp(reached, min(index, behind), max(index, behind));
  float before = (float(reached - step) + border - deep) / along;
  float after = (float(reached) + border - deep) / along;
  bool tooFar = reached != index && before > r;
  return reached + (tooFar ? -step : after <= r && reached != behind ? step : 0);
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

void main() {
  seen = vec4(0.0);
  vec3 pixel = vec3(1.0, gl_FragCoord.xy - corner - middle);
  float t0 = -INFINITE, t1 = INFINITE;
#ifdef OPAQUE
  t1 = min(t1, texelFetch(opaque, ivec2(gl_FragCoord.xy), 0).x * worldScale - reference);
#endif
  for (int k = 0; k < planes; ++k) {
    float value = dot(planeValue[k], pixel), slope = dot(planeSlope[k], pixel);
    float t = -value / slope;
    if (slope > 0.0) t0 = max(t0, t);
    else if (slope < 0.0) t1 = min(t1, t);
    else if (value < 0.0) t1 = -INFINITE;
  }
  if (!(t0 < t1)) return;

  vec3 start, end;
  {
    vec4 value = vec4(dot(formValue[0], pixel), dot(formValue[1], pixel),
                      dot(formValue[2], pixel), dot(formValue[3], pixel));
    vec4 slope = vec4(dot(formSlope[0], pixel), dot(formSlope[1], pixel),
                      dot(formSlope[2], pixel), dot(formSlope[3], pixel));
    vec4 p0 = value + t0 * slope, p1 = value + t1 * slope;
#ifdef PARALLEL
    start = p0.xyz;
    end = p1.xyz;
#else
    start = p0.xyz / p0.w;
    end = p1.xyz / p1.w;
#endif
  }
  along = end - start;
  along = mix(along, vec3(0.0), lessThan(abs(along), vec3(1.2e-38)));
  away = along.z >= 0.0;
  deep = away ? end : start;
  float rEnd = away ? 0.0 : 1.0;
  float r = rEnd - 1.0;
  float scale = (t1 - t0) * length(direction * pixel) * reciprocal(start.z) * reciprocal(end.z);
  float sense = away ? 1.0 : -1.0;
  float inverse = along.z != 0.0 ? sense / along.z : 0.0;
  vec2 lists_ = vec2(window) * 0.5;
  ivec2 step_ = ivec2(along.x > 0.0 ? 1 : -1, along.y > 0.0 ? 1 : -1);
  vec2 border = vec2(along.x > 0.0, along.y > 0.0) - lists_;
  int i = clamp(int(floor(start.x + lists_.x)), 0, window.x - 1);
  int j = clamp(int(floor(start.y + lists_.y)), 0, window.y - 1);
  float depth = sense * start.z;
  bool entered = true;              // a list whose borders are not known yet
  bool fresh = abs(along.x) + abs(along.y) > 2.0; // a stack that has not been looked at
  float rU, rV, rNext, nextDepth;
  int n = 0, low = 0, high = 0x7fffffff, missed = 0;
  vec3 color = vec3(0.0);
  float left = 1.0;

  for (int turn = 0; turn < 1000000; ++turn) {
    if (fresh) { // pass by what is empty
      fresh = false;
      uvec2 mask = texelFetch(masks, ivec2(i, j) >> STACK_SHIFT, 0).xy;
      int slab = int(clamp((offsetOf(sense * depth) - firstDepth) * slabsPerDepth, 0.0, 63.0));
      int nearestOne = nearestSlab(mask, slab);
      if (nearestOne != slab) {
        const int edge = (1 << STACK_SHIFT) - 1;
        int edgeI = step_.x > 0 ? i | edge : i & ~edge, edgeJ = step_.y > 0 ? j | edge : j & ~edge;
        float until = min(CROSSING(x, edgeI), CROSSING(y, edgeJ));
        if (nearestOne >= 0 && along.z != 0.0) {
          float face = firstDepth + float(away ? nearestOne : nearestOne + 1) / slabsPerDepth;
          until = min(until, (sense * coordinate(face) - sense * deep.z) * inverse);
        }
        if (until >= rEnd) break;
        int toI = indexReached(i, edgeI, step_.x, until, along.x, deep.x, lists_.x, border.x);
        int toJ = indexReached(j, edgeJ, step_.y, until, along.y, deep.y, lists_.y, border.y);
        if (toI != i || toJ != j) {
          if (toI != i) r = max(r, CROSSING(x, toI - step_.x));
          if (toJ != j) r = max(r, CROSSING(y, toJ - step_.y));
          if (toI < 0 || toJ < 0 || toI >= window.x || toJ >= window.y) break;
          fresh = ((toI ^ i) | (toJ ^ j)) >> STACK_SHIFT != 0;
          i = toI;
          j = toJ;
          depth = sense * (r * along.z + deep.z);
          if (fresh) continue;
        }
      }
    }
    if (entered) {
      entered = false;
      enter(i, j);
      rU = CROSSING(x, i);
      rV = CROSSING(y, j);
      rNext = max(r, min(rEnd, min(rU, rV)));
      nextDepth = sense * (rNext * along.z + deep.z);
      low = missed = 0;
      high = 0x7fffffff;
    }
    if (count > 0) {
      // The first supersegment that ends behind the depth: guess, and the guess of the list before
      n = min(n, count);
      vec2 face = n < count ? facesMet(n) : vec2(INFINITE);
      bool passed = n < count && face.y <= depth;
      bool beyond = !passed && face.x > depth && n > low && facesMet(n - 1).y > depth;
      if (passed || beyond) {
        if (passed) low = n + 1;
        else high = n - 1;
        n = ++missed < 4 ? n + (passed ? 1 : -1) : (low + min(high, count)) >> 1;
        continue;
      }
      if (n < count && face.x <= nextDepth) {
        float from = face.x > depth ? clamp((face.x - sense * deep.z) * inverse, r, rNext) : r;
        float to = face.y < nextDepth
          ? clamp((face.y - sense * deep.z) * inverse, from, rNext) : rNext;
        vec4 medium = mediumMet(n);
        float crossed = scale * (to - from) /
          (reciprocal(from * along.z + deep.z) * reciprocal(to * along.z + deep.z));
        float weight = left * opacityOf(medium.w * crossed);
        color += weight * medium.rgb;
        left -= weight;
        if (left < cutoff) break;
        if (face.y <= nextDepth) {
          low = ++n;
          continue;
        }
      }
    }
    if (rNext >= rEnd) break;
    int iBefore = i, jBefore = j;
    if (rU <= rV) i += step_.x;
    else j += step_.y;
    if (i < 0 || j < 0 || i >= window.x || j >= window.y) break;
    r = rNext;
    depth = nextDepth;
    entered = true;
    fresh = ((i ^ iBefore) | (j ^ jBefore)) >> STACK_SHIFT != 0;
  }
  seen = vec4(color, 1.0 - left);
}
`;
