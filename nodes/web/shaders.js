// Shader programs.

// Cell colours, common to both renderings.
const COLOUR = `
uniform sampler2D u_palette;
uniform int u_colour;        // 0 height, 1 count, 2 label, 3 age, 4 colour
uniform vec2 u_range;        // values of the palette's ends
uniform float u_now;         // seconds
uniform float u_grey;        // 1: what is shown is old
uniform vec3 u_chosen;       // tile (as drawn) and place of the chosen cell, or -1
uniform float u_tile_number;

vec3 colour(uvec4 cell, float height) {
  if (u_chosen.x == u_tile_number && u_chosen.y == float(cell.x)) return vec3(1.0, 0.93, 0.55);
  vec3 shade;
  if (u_colour == 4) shade = mix(vec3(0.45), a_colour.rgb, a_colour.a);
  else if (u_colour == 2) {
    if (cell.y == 65535u) shade = vec3(0.45);
    else {
      float hue = fract(float(cell.y) * 0.61803399) * 6.0;
      vec3 pure = clamp(abs(mod(hue + vec3(0.0, 4.0, 2.0), 6.0) - 3.0) - 1.0, 0.0, 1.0);
      shade = mix(vec3(0.55), pure, 0.6);
    }
  } else {
    float value = u_colour == 0 ? height : u_colour == 1 ? float(cell.z) / 2048.0 : u_now - float(cell.w);
    float t = clamp((value - u_range.x) / max(u_range.y - u_range.x, 1e-6), 0.0, 1.0);
    shade = texture(u_palette, vec2(t, 0.5)).rgb;
  }
  return mix(shade, vec3(dot(shade, vec3(0.3, 0.6, 0.1))) * 0.7, u_grey * 0.85);
}`;

const PLACE = `
layout(location = 0) in uvec4 a_cell;
layout(location = 1) in vec4 a_colour;   // mean colour, alpha 0 without
uniform mat3 u_basis;        // basis of the lattice in the axes of the map, m
uniform vec3 u_tile;         // first cell of the tile, from the eye, m
uniform vec3 u_row;          // height of the first cell, lowest and highest shown, m
uniform mat4 u_clip;
uniform float u_radius;      // of a ball around a cell, m
uniform float u_focal;       // pixels of 1 m at 1 m
uniform vec2 u_screen;       // pixels
uniform float u_most;        // largest point that can be drawn, pixels

uint compact(uint m) {
  return (m & 1u) | (m >> 2 & 2u) | (m >> 4 & 4u) | (m >> 6 & 8u) | (m >> 8 & 16u);
}

vec3 offset(uint place) {
  return u_basis * vec3(compact(place), compact(place >> 1), compact(place >> 2));
}

// Transforms a cell to the screen; false if it is not visible.
bool put(vec3 centre, float height, float size) {
  gl_Position = u_clip * vec4(centre, 1.0);
  gl_PointSize = min(size, u_most);
  bool shown = height >= u_row.y && height <= u_row.z && gl_Position.w > 0.0;
  if (!shown) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  return shown;
}`;

// Cells as point sprites, in which rays are cast against the cell shape.
export const CELL_VERTEX = `#version 300 es
precision highp float;
precision highp int;
${PLACE}
${COLOUR}
flat out vec3 v_centre;
flat out vec3 v_colour;
flat out float v_size;
flat out uint v_place;

void main() {
  vec3 from_first = offset(a_cell.x);
  v_centre = u_tile + from_first;
  v_place = a_cell.x;
  float height = u_row.x + from_first.z;
  float depth = (u_clip * vec4(v_centre, 1.0)).w;
  float size = 2.5 * u_radius * u_focal / max(depth - u_radius, 0.3 * u_radius) + 1.0;
  v_size = size;
  v_colour = colour(a_cell, height);
  if (!put(v_centre, height, size)) return;
  // A point sprite is clipped by its centre: it is moved to the screen edge and enlarged.
  vec2 at = gl_Position.xy / gl_Position.w;
  vec2 over = max(abs(at) - 1.0, 0.0);
  vec2 pixels = over * 0.5 * u_screen;
  float beyond = max(pixels.x, pixels.y);
  if (beyond > 0.0 && beyond < 0.5 * size) {
    gl_Position.xy = clamp(at, -1.0, 1.0) * gl_Position.w;
    gl_PointSize = min(size + 2.0 * beyond, u_most);
  }
}`;

const RAY = `
uniform mat3 u_rays;         // directions seen, by place on the screen
uniform vec4 u_slabs[7];     // normals and half distances of the faces, m
uniform int u_slab_count;
uniform mat4 u_clip;
uniform float u_near;
uniform vec4 u_window;       // place and size of the picture, pixels

// Casts the ray of this pixel against the cell: distance, face that is hit, and distance in m to the
// previous plane: 0 at an edge between two visible faces.
bool meet(vec3 centre, out float t, out vec3 normal, out float edge) {
  vec2 at = (gl_FragCoord.xy - u_window.xy) / u_window.zw * 2.0 - 1.0;
  vec3 ray = u_rays * vec3(at, 1.0);
  float enter = -1e30;
  float before = -1e30;
  float slant = 0.0;
  float slant_before = 0.0;
  float leave = 1e30;
  for (int i = 0; i < 7; i++) {
    if (i >= u_slab_count) break;
    vec3 n = u_slabs[i].xyz;
    float along = dot(ray, n);
    along = abs(along) < 1e-7 ? 1e-7 : along;
    float middle = dot(centre, n) / along;
    float half_way = abs(u_slabs[i].w / along);
    float here = middle - half_way;
    if (here > enter) {
      before = enter;
      slant_before = slant;
      enter = here;
      slant = along;
      normal = along > 0.0 ? -n : n;
    } else if (here > before) {
      before = here;
      slant_before = along;
    }
    leave = min(leave, middle + half_way);
  }
  t = enter;
  edge = (enter - before) * abs(slant_before);
  vec4 clip = u_clip * vec4(ray * t, 1.0);
  gl_FragDepth = clamp(clip.z / clip.w * 0.5 + 0.5, 0.0, 1.0);
  return enter <= leave && enter > u_near;
}`;

export const CELL_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
${RAY}
uniform float u_pixel;       // size of a pixel at 1 m, m
flat in vec3 v_centre;
flat in vec3 v_colour;
flat in float v_size;
out vec4 o_colour;

void main() {
  vec3 normal;
  float t, edge;
  if (!meet(v_centre, t, normal, edge)) discard;
  float light = 0.52 + 0.30 * normal.z + 0.22 * dot(normal, normalize(vec3(0.55, -0.75, 0.2)));
  // Edges are dark, a pixel or two wide, where cells are large enough.
  float line = 1.0 - smoothstep(0.6, 2.2, edge / (t * u_pixel));
  light *= 1.0 - 0.5 * line * smoothstep(8.0, 24.0, v_size);
  o_colour = vec4(v_colour * light, 1.0);
}`;

// Picking: the same with cell indices as output.
export const PICK_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
${RAY}
uniform float u_tile_number;
flat in vec3 v_centre;
flat in uint v_place;
out uvec4 o_cell;

void main() {
  vec3 normal;
  float t, edge;
  if (!meet(v_centre, t, normal, edge)) discard;
  o_cell = uvec4(uint(u_tile_number) + 1u, v_place, floatBitsToUint(t), 0u);
}`;

// Cells as plain points, for small cells and slow machines.
export const FLAT_VERTEX = `#version 300 es
precision highp float;
precision highp int;
${PLACE}
${COLOUR}
uniform float u_enlarge;
flat out vec3 v_colour;

void main() {
  vec3 from_first = offset(a_cell.x);
  vec3 centre = u_tile + from_first;
  float height = u_row.x + from_first.z;
  float depth = (u_clip * vec4(centre, 1.0)).w;
  v_colour = colour(a_cell, height) * 0.78;
  put(centre, height, max(1.0, 1.7 * u_enlarge * u_radius * u_focal / max(depth, u_radius)));
}`;

export const FLAT_FRAGMENT = `#version 300 es
precision mediump float;
flat in vec3 v_colour;
out vec4 o_colour;
void main() { o_colour = vec4(v_colour, 1.0); }`;

// Lines, cloud points and triangles of one colour.
export const PLAIN_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 a_place;
uniform mat4 u_clip;
uniform mat3 u_turn;
uniform vec3 u_origin;       // from the eye, m
uniform float u_size;
uniform vec3 u_fade;         // where lines fade out, from the eye; 0: nowhere
uniform float u_reach;
out float v_far;
void main() {
  vec3 p = u_origin + u_turn * a_place;
  v_far = u_reach > 0.0 ? length(p - u_fade) / u_reach : 0.0;
  gl_Position = u_clip * vec4(p, 1.0);
  gl_PointSize = u_size;
}`;

export const PLAIN_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 u_ink;
in float v_far;
out vec4 o_colour;
void main() { o_colour = vec4(u_ink.rgb, u_ink.a * (1.0 - smoothstep(0.3, 1.0, v_far))); }`;

// A text panel in front of the eyes.
export const SIGN_VERTEX = `#version 300 es
layout(location = 0) in vec3 a_place;
uniform mat4 u_clip;
uniform vec2 u_half;         // half width and height of the panel, m
out vec2 v_at;
void main() {
  v_at = a_place.xy * 0.5 + 0.5;
  gl_Position = u_clip * vec4(a_place.xy * u_half, 0.0, 1.0);
}`;

export const SIGN_FRAGMENT = `#version 300 es
precision mediump float;
uniform sampler2D u_text;
in vec2 v_at;
out vec4 o_colour;
void main() { o_colour = texture(u_text, v_at); }`;
