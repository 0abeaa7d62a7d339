// The shaders of meshes, lines and points: the formulas of VTK's OpenGL renderer, so that pictures
// agree. View coordinates are VTK's: x to the right, y up, z to the viewer.
//
// NORMALS      normals at points, else those of triangles
// COLORS       colours at points; COORDINATES: places in a table of colours; PLACES: in a texture
// EDGES        of polygons are seen; WIRES, LINES, POINTS, TUBES, SPHERES: what is drawn
// LIT          lights are looked at; HEADLIGHT: there is one, where the eye is
// BACK         back sides have a material of their own
// CLIPPED      by six planes at most; NEARER: by VTK's offset of polygons
// DEPTH        only view depth is written; LAYERS: translucent, for the sums of McGuire and Bavoil;
// BLENDED      translucent, over what has been drawn before; CODED: without sRGB's curve, else with

/** Lights that are looked at. */
export const MOST_LIGHTS = 8;

const DECLARED = `
#if defined(LINES) || defined(WIRES)
#define STRIPES
#endif
uniform mat3 linear;   // to view coordinates
uniform vec3 offset;
uniform mat3 normals;
uniform vec4 lens;     // half the width and height, and the window's centre
uniform vec2 range;    // clip z: range.x * depth + range.y
uniform bool parallel;
uniform vec2 size;     // pixels
uniform float width;   // of lines and points, pixels
`;

/** The vertex shader with some of the names above defined. */
export function meshVertexShader(defines) {
  return `#version 300 es
${defines.map((name) => `#define ${name}`).join("\n")}
${DECLARED}
in vec3 position;
in vec3 normal;
in vec4 color;
in vec2 coordinate;
in vec2 place;
in float edges;
in vec3 other;         // end of a segment
uniform vec4 planes[6];
out vec3 seenFrom;     // view coordinates
out vec3 seenNormal;
out vec4 tint;
out vec2 inTable, inTexture;
out vec3 corner;
flat out float sides;
out vec3 kept, keptToo;
out float across;      // a stripe, -1 to 1
out vec3 alongStripe, acrossStripe;

vec4 clipped(vec3 at) {
  float depth = -at.z, w = parallel ? 1.0 : depth;
  return vec4(at.xy / lens.xy - lens.zw * w, range.x * depth + range.y, w);
}

void main() {
  seenFrom = linear * position + offset;
  seenNormal = normals * normal;
  tint = color;
  inTable = coordinate;
  inTexture = place;
  corner = vec3(equal(ivec3(gl_VertexID % 3), ivec3(0, 1, 2)));
  sides = edges;
#ifdef CLIPPED
  vec4 point = vec4(position, 1.0);
  kept = vec3(dot(planes[0], point), dot(planes[1], point), dot(planes[2], point));
  keptToo = vec3(dot(planes[3], point), dot(planes[4], point), dot(planes[5], point));
#endif
#ifdef STRIPES
  vec3 end = linear * other + offset;
  float nearest = -1e-6 * abs(offset.z) - 1e-30;
  if (!parallel && seenFrom.z > nearest && end.z < nearest) {
    seenFrom = mix(end, seenFrom, (nearest - end.z) / (seenFrom.z - end.z));
  }
  if (!parallel && end.z > nearest && seenFrom.z < nearest) {
    end = mix(seenFrom, end, (nearest - seenFrom.z) / (end.z - seenFrom.z));
  }
  gl_Position = clipped(seenFrom);
  vec4 to = clipped(end);
  vec2 along = (to.xy / to.w - gl_Position.xy / gl_Position.w) * size;
  along = dot(along, along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
  // The second end looks back, so its sides are the other way round
  int k = gl_VertexID & 3;
  across = k == 0 || k == 3 ? 1.0 : -1.0;
  gl_Position.xy += across * vec2(-along.y, along.x) * width / size * gl_Position.w;
  if (k > 1) across = -across;
  float sense = k > 1 ? -1.0 : 1.0;
  alongStripe = normalize(sense * (end - seenFrom));
  acrossStripe = vec3(sense * vec2(-along.y, along.x), 0.0);
#else
  gl_Position = clipped(seenFrom);
#endif
  gl_PointSize = width;
}`;
}

/** The fragment shader with some of the names above defined. */
export function meshFragmentShader(defines) {
  return `#version 300 es
${defines.map((name) => `#define ${name}`).join("\n")}
precision highp float;
precision highp int;
#define LIGHTS ${MOST_LIGHTS}
${DECLARED}
${FRAGMENT}`;
}

// Of sRGB, which VTK's windows take the mean of a pixel's samples by (nearly: a power of 2.2).
const DECODED = `vec3 decoded(vec3 c) {
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}`;

const FRAGMENT = `
${DECODED}
in vec3 seenFrom, seenNormal;
in vec4 tint;
in vec2 inTable, inTexture;
in vec3 corner;
flat in float sides;
in vec3 kept, keptToo;
in float across;
in vec3 alongStripe, acrossStripe;

uniform vec3 ambient[2], diffuse[2], specular[2];  // of the front and of the back
uniform vec2 strength[2];                          // ambient and diffuse: of colours
uniform vec2 shine[2];                             // specular power, opacity
uniform vec4 edgeColor;
uniform float edgeWidth, nearer;
uniform int lights;
uniform vec3 lightDirection[LIGHTS], lightColor[LIGHTS], lightPosition[LIGHTS];
uniform vec4 lightShape[LIGHTS];                   // positional, cone, exponent
uniform vec3 lightFading[LIGHTS];
uniform sampler2D table, image;
layout(location = 0) out vec4 seen;
#ifdef LAYERS
layout(location = 1) out vec4 sum;
#endif

void main() {
  float depth = -seenFrom.z;
#ifdef CLIPPED
  if (any(lessThan(kept, vec3(0.0))) || any(lessThan(keptToo, vec3(0.0)))) discard;
#endif
  bool front = true;
#if !defined(STRIPES) && !defined(POINTS)
  front = gl_FrontFacing;
#endif
  vec3 normal = vec3(0.0, 0.0, 1.0);
#if defined(SPHERES)
  vec2 on = vec2(2.0 * gl_PointCoord.x - 1.0, 1.0 - 2.0 * gl_PointCoord.y);
  float beyond = dot(on, on);
  if (beyond > 1.0) discard;
  normal = vec3(on, sqrt(1.0 - beyond));
#elif defined(TUBES)
  vec3 outwards = normalize(cross(alongStripe, acrossStripe));
  outwards *= outwards.z < 0.0 ? -1.0 : 1.0;
  normal = normalize(acrossStripe * across + outwards * sqrt(max(0.0, 1.0 - across * across)));
#elif defined(NORMALS)
  normal = normalize(seenNormal);
  if (!front) normal = -normal;
#elif defined(WIRES)
  // To the line, and as near to the viewer's direction as that goes
  vec3 line = normalize(alongStripe);
  normal = cross(vec3(line.y, -line.x, 0.0), line);
  normal = dot(normal, normal) > 0.0 ? normalize(normal) : vec3(0.0, 0.0, 1.0);
#elif !defined(POINTS) && !defined(STRIPES)
  normal = normalize(cross(dFdx(seenFrom), dFdy(seenFrom)));
  if (parallel ? normal.z < 0.0 : dot(normal, seenFrom) > 0.0) normal = -normal;
#endif
#if defined(SPHERES) || defined(TUBES)
  // The nearer surface: a radius is as wide there as on the screen
  float perPixel = 2.0 * lens.y / size.y * (parallel ? 1.0 : depth);
  depth -= normal.z * 0.5 * width * perPixel;
#endif
#if defined(SPHERES) || defined(TUBES) || defined(NEARER)
  float z = (range.x * depth + range.y) / (parallel ? 1.0 : depth);
#ifdef NEARER
  z = max(z + nearer, -1.0);
  depth = parallel ? (z - range.y) / range.x : range.y / (z - range.x);
#endif
  gl_FragDepth = 0.5 * z + 0.5;
#endif
#ifdef DEPTH
  seen = vec4(depth);
#else
  int side = 0;
  bool plain = false;
#ifdef BACK
  side = front ? 0 : 1;
  plain = !front;
#endif
  vec3 ambientColor = ambient[side], diffuseColor = diffuse[side];
  float opacity = shine[side].y;
  vec4 mapped = vec4(1.0);
#if defined(COLORS) || defined(COORDINATES)
#ifdef COLORS
  mapped = tint;
#else
  mapped = texture(table, inTable);
#endif
  if (!plain) {
    ambientColor = strength[0].x * mapped.rgb;
    diffuseColor = strength[0].y * mapped.rgb;
    opacity *= mapped.a;
  }
#endif
#ifdef EDGES
  vec3 from = corner.zxy; // the sides 0-1, 1-2 and 2-0 are opposite to the corners 2, 0 and 1
  from /= sqrt(dFdx(from) * dFdx(from) + dFdy(from) * dFdy(from));
  int flags = int(sides);
  from = mix(vec3(1e9), from, notEqual(ivec3(flags) & ivec3(1, 2, 4), ivec3(0)));
  float edge = clamp(0.5 + 0.5 * edgeWidth - min(min(from.x, from.y), from.z), 0.0, 1.0);
  diffuseColor = mix(diffuseColor, vec3(0.0), edge * edgeColor.a);
  ambientColor = mix(ambientColor, edgeColor.rgb, edge * edgeColor.a);
#endif
#ifdef LIT
#ifdef HEADLIGHT
  float straight = max(0.000001, normal.z);
  vec3 color = ambientColor + straight * diffuseColor * lightColor[0] +
    pow(straight, shine[side].x) * specular[side] * lightColor[0];
#else
  vec3 shed = vec3(0.0), shone = vec3(0.0), toEye = normalize(-seenFrom);
  for (int k = 0; k < LIGHTS; ++k) {
    if (k >= lights) break;
    vec3 direction = lightDirection[k];
    float fading = 1.0;
    if (lightShape[k].x > 0.0) {
      vec3 ray = seenFrom - lightPosition[k];
      float far = length(ray);
      ray /= far;
      fading = 1.0 / dot(lightFading[k], vec3(1.0, far, far * far));
      if (lightShape[k].y <= 90.0) {
        float inCone = dot(ray, direction);
        fading *= inCone >= cos(radians(lightShape[k].y)) ? pow(inCone, lightShape[k].z) : 0.0;
      }
      direction = ray;
    }
    float straight = max(0.0, fading * dot(normal, -direction));
    shed += straight * lightColor[k];
    if (straight > 0.0) {
      shone += fading * lightColor[k] *
        pow(max(1e-5, dot(reflect(direction, normal), toEye)), shine[side].x);
    }
  }
  vec3 color = ambientColor + shed * diffuseColor + shone * specular[side];
#endif
#else
  vec3 color = ambientColor + diffuseColor;
#endif
  seen = vec4(color, opacity);
#ifdef PLACES
  seen *= texture(image, inTexture);
#endif
#ifdef LAYERS
  seen.rgb *= seen.a;
  sum = vec4(seen.a);
#elif defined(BLENDED)
  seen.rgb *= seen.a;
#else
  seen.a = 1.0;
#ifndef CODED
  seen.rgb = decoded(clamp(seen.rgb, 0.0, 1.0));
#endif
#endif
#endif
}
`;

/** Lays translucent layers over what is there. */
export const LAYERS_SHADER = `#version 300 es
precision highp float;
uniform sampler2D layers, sums;
out vec4 seen;
void main() {
  vec4 layer = texelFetch(layers, ivec2(gl_FragCoord.xy), 0);
  float sum = texelFetch(sums, ivec2(gl_FragCoord.xy), 0).r;
  seen = vec4(layer.rgb / max(sum, 0.01) * (1.0 - layer.a), 1.0 - layer.a);
}`;

/** Lays a picture, whose first row is the upper one, over what is there. */
export const PICTURE_SHADER = `#version 300 es
precision highp float;
uniform sampler2D picture;
out vec4 seen;
void main() {
  ivec2 size = textureSize(picture, 0), at = ivec2(gl_FragCoord.xy);
  seen = texelFetch(picture, ivec2(at.x, size.y - 1 - at.y), 0);
}`;

/** Lays a picture of the same pixels over what is there, from a corner on. */
export const COPY_SHADER = `#version 300 es
precision highp float;
uniform sampler2D picture;
uniform ivec2 corner;
out vec4 seen;
void main() { seen = texelFetch(picture, ivec2(gl_FragCoord.xy) - corner, 0); }`;

/** Takes over a picture of mean light as it is seen before a ground, or another such picture. */
export const RESOLVED_SHADER = `#version 300 es
precision highp float;
uniform sampler2D picture, behind;
uniform ivec2 corner, cornerBehind;
uniform bool pictured;  // whether there is one behind
uniform vec3 ground[2]; // at the bottom and at the top
uniform float height;
out vec4 seen;
${DECODED}
vec3 coded(vec3 c) {
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}
void main() {
  vec4 mean = texelFetch(picture, ivec2(gl_FragCoord.xy) - corner, 0);
  vec3 under = mix(ground[0], ground[1], clamp(gl_FragCoord.y / height, 0.0, 1.0));
  if (pictured) under = coded(texelFetch(behind, ivec2(gl_FragCoord.xy) - cornerBehind, 0).rgb);
  vec3 over = coded(mean.rgb + (1.0 - mean.a) * decoded(under));
  vec3 least = max((over - under) / max(1.0 - under, 1e-6), 1.0 - over / max(under, 1e-6));
  float opacity = min(1.0, max(max(mean.a, least.r), max(least.g, least.b)));
  seen = mean.a > 0.0 ? vec4(over - (1.0 - opacity) * under, opacity) : vec4(0.0);
}`;
