// Sphere tracing of the smooth union of all visible parts, in the normalised frame.
//
// `parts` has one row a visible part, in the order of the union, and eight columns:
//   0 centre, blend          1 rotation (x, y, z, w), local to world      2, 3 shape
//   4 bounding sphere        5 family, arc, arc centre, step factor       6 colour (linear), sign of the bend
//   7 margin of the join, slack of the sphere's bound, 1 if selected
// Put together by html.py: WORDS and family_distance(family, p, s) stand before this text.

uniform sampler2D parts;
uniform int partCount;
uniform vec3 eye, right, upward, forward;
uniform float slope;
uniform vec2 resolution;
uniform vec2 pixel;      // the pixel to pick; only for mode 1
uniform int mode;        // 0 picture, 1 the part at one pixel, 2 the part at every pixel
uniform int samples;     // rays along each side of a pixel
uniform int shadowSteps; // 0 leaves shadows and ambient occlusion out
uniform vec3 key, fill, rim, vertical;
uniform vec4 ground;     // centre of the ground, and its radius
uniform float dark;      // 1 for a dark backdrop
out vec4 result;

const float NONE = 1e30;

vec4 entry(int part, int column) { return texelFetch(parts, ivec2(column, part), 0); }

// Which parts the current ray or place has to look at, one bit each.
uint wanted[WORDS];

// How near to the sphere's middle line a ray passes; where it is inside the sphere goes to `span`.
bool meets(vec3 origin, vec3 direction, vec4 ball, float widen, inout vec2 span) {
  vec3 to = ball.xyz - origin;
  float along = dot(to, direction);
  float wide = ball.w + widen;
  float rest = wide * wide - dot(to, to) + along * along;
  if (rest < 0.0 || along + sqrt(rest) < 0.0) return false;
  span = vec2(min(span.x, along - sqrt(rest)), max(span.y, along + sqrt(rest)));
  return true;
}

// Choose the parts that can show along a ray, and the span in which they do; `spread` widens with the distance.
// Margins are such that the union's surface is the same without the other parts (see spheres.js).
vec2 choose_along(vec3 origin, vec3 direction, float spread) {
  vec2 span = vec2(NONE, -NONE);
  for (int w = 0; w < WORDS; w++) wanted[w] = 0u;
  for (int i = 0; i < partCount; i++) {
    vec4 ball = entry(i, 4);
    float widen = entry(i, 7).x + spread * length(ball.xyz - origin);
    if (meets(origin, direction, ball, widen, span)) wanted[i >> 5] |= 1u << (i & 31);
  }
  return vec2(max(span.x, 0.0), span.y);
}

void choose_near(vec3 p, float radius) {
  for (int w = 0; w < WORDS; w++) wanted[w] = 0u;
  for (int i = 0; i < partCount; i++) {
    vec4 ball = entry(i, 4);
    if (length(p - ball.xyz) < ball.w + entry(i, 7).x + radius) wanted[i >> 5] |= 1u << (i & 31);
  }
}

int lowest_bit(uint bits) { return (floatBitsToInt(float(bits & (~bits + 1u))) >> 23) - 127; }

// Distance of one part, and a step that is safe: bent fields are steeper than a distance near their arc's centre.
vec2 part_distance(int i, vec3 p, vec3 centre) {
  vec4 turn = entry(i, 1), a = entry(i, 2), b = entry(i, 3), steps = entry(i, 5);
  vec3 v = p - centre;
  vec3 q = v + 2.0 * cross(turn.xyz, cross(turn.xyz, v) - turn.w * v);
  float s[8] = float[8](a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w);
  float f = family_distance(int(steps.x), q, s);
  float safe = f * steps.w;
  if (steps.y > 0.0 && f > 0.0) {
    // |grad| <= max(1, arc / r) at distance r from the arc's centre: after this step r has not shrunk too far.
    float r = length(vec2(q.x - steps.z, q.z));
    safe = min(f, f * r / (steps.y + f));
    // Behind the centre the two ends of the arc meet, and the field is up to three times as steep.
    float behind = (q.x - steps.z) * entry(i, 6).w;
    safe = max(safe / 3.0, min(safe, -behind));
  }
  return vec2(f, safe);
}

// The union of the wanted parts: its distance, and a safe step. Parts too far to blend in are left out, exactly.
vec2 field(vec3 p) {
  vec2 whole = vec2(NONE);
  for (int w = 0; w < WORDS; w++) {
    for (uint bits = wanted[w]; bits != 0u; bits &= bits - 1u) {
      int i = 32 * w + lowest_bit(bits);
      vec4 ball = entry(i, 4), place = entry(i, 0);
      float low = entry(i, 7).y * (length(p - ball.xyz) - ball.w);
      if (low > max(whole.x + place.w, 0.0)) continue;
      vec2 part = part_distance(i, p, place.xyz);
      whole = vec2(combine(whole.x, part.x, place.w, 1.0), combine(whole.y, part.y, place.w, 1.0));
    }
  }
  return whole;
}

// Colour of the union at a point, mixed at smooth joins as their distances are; how much of it is selected; the part.
vec4 paint(vec3 p, out int owner) {
  float whole = NONE;
  vec4 mixed = vec4(0.0);
  float largest = 0.0;
  owner = -1;
  for (int w = 0; w < WORDS; w++) {
    for (uint bits = wanted[w]; bits != 0u; bits &= bits - 1u) {
      int i = 32 * w + lowest_bit(bits);
      vec4 place = entry(i, 0), ball = entry(i, 4);
      float low = entry(i, 7).y * (length(p - ball.xyz) - ball.w);
      if (low > max(whole + place.w, 0.0)) continue;
      float f = part_distance(i, p, place.xyz).x;
      float old = combine_share(whole, f, place.w, 1.0);
      if (owner < 0) old = 0.0;
      mixed = mix(vec4(entry(i, 6).rgb, entry(i, 7).z), mixed, old);
      largest *= old;
      if (1.0 - old > largest) {
        largest = 1.0 - old;
        owner = i;
      }
      whole = combine(whole, f, place.w, 1.0);
    }
  }
  return mixed;
}

// Distance along a ray to the surface, or -1. A step that was too long is taken back by halving.
float trace(vec3 origin, vec3 direction, vec2 span, float tolerance) {
  float t = span.x, before = span.x;
  for (int step = 0; step < 240; step++) {
    if (t > span.y) return -1.0;
    vec2 f = field(origin + t * direction);
    float fine = tolerance * max(t, 0.1);
    if (f.x < fine) {
      if (f.x < -fine && t > before) {
        float outside = before, inside = t;
        for (int i = 0; i < 10; i++) {
          float middle = 0.5 * (outside + inside);
          if (field(origin + middle * direction).x < 0.0) inside = middle; else outside = middle;
        }
        t = inside;
      }
      return t;
    }
    before = t;
    t += max(max(f.y, 0.25 * f.x), 0.5 * fine);
  }
  return -1.0;
}

vec3 normal_at(vec3 p, float e) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < 4; i++) {
    vec3 corner = vec3((i & 1) == 0 ? -1.0 : 1.0, (i & 2) == 0 ? -1.0 : 1.0, i == 0 || i == 3 ? 1.0 : -1.0);
    sum += corner * field(p + e * corner).x;
  }
  return sum / max(length(sum), 1e-20);
}

// Share of the light that passes: the narrowest clearance, relative to the distance.
float light_at(vec3 p, vec3 towards) {
  if (shadowSteps == 0) return 1.0;
  const float softness = 0.16;
  vec2 span = choose_along(p, towards, softness);
  float light = 1.0, t = max(span.x, 0.004);
  for (int i = 0; i < shadowSteps && t < span.y; i++) {
    vec2 f = field(p + t * towards);
    light = min(light, f.x / (softness * t));
    if (light < 0.01) return 0.0;
    t += max(f.y, 0.004 + 0.25 * softness * t);
  }
  return light * light * (3.0 - 2.0 * light);
}

// Share of the sky that is open, from the distances above the surface.
float openness_at(vec3 p, vec3 n) {
  if (shadowSteps == 0) return 1.0;
  choose_near(p, 0.32);
  float closed = 0.0, weight = 1.0;
  for (int i = 1; i <= 5; i++) {
    float h = 0.012 + 0.012 * float(i * i);
    closed += weight * max(h - field(p + h * n).x, 0.0) / h;
    weight *= 0.72;
  }
  return clamp(1.0 - 0.42 * closed, 0.0, 1.0);
}

vec3 backdrop(vec2 at) {
  float away = length((at - vec2(0.5, 0.55)) * vec2(0.9, 0.75));
  vec3 near = mix(vec3(0.90, 0.905, 0.915), vec3(0.055, 0.06, 0.07), dark);
  vec3 far = mix(vec3(0.70, 0.715, 0.74), vec3(0.018, 0.02, 0.025), dark);
  return mix(near, far, smoothstep(0.05, 0.85, away));
}

vec3 lit(vec3 p, vec3 n, vec3 view, vec4 painted) {
  vec3 lifted = p + 0.002 * n;
  float open = openness_at(p, n);
  float facing = dot(n, key);
  float light = facing > 0.0 ? light_at(lifted, key) : 0.0;
  vec3 sky = mix(vec3(0.30, 0.285, 0.27), vec3(0.62, 0.66, 0.72), 0.5 + 0.5 * dot(n, vertical));
  vec3 sum = sky * open * 0.75;
  sum += vec3(1.28, 1.22, 1.12) * max(facing, 0.0) * light;
  sum += vec3(0.16, 0.18, 0.22) * max(dot(n, fill), 0.0) * open;
  vec3 colour = painted.rgb * sum;
  float edge = pow(1.0 - max(dot(n, view), 0.0), 4.0);
  vec3 halfway = normalize(key + view);
  colour += vec3(0.11) * pow(max(dot(n, halfway), 0.0), 48.0) * light;
  colour += vec3(0.16) * edge * (0.3 + max(dot(n, rim), 0.0)) * open;
  // The selected part glows along its outline.
  return mix(colour, vec3(1.0, 0.62, 0.12), painted.a * (0.12 + 0.8 * pow(1.0 - max(dot(n, view), 0.0), 2.5)));
}

vec3 displayed(vec3 x) {
  vec3 shown = mix(max(x, 0.0), 0.7 + 0.3 * (1.0 - exp(-(x - 0.7) / 0.3)), step(0.7, x));
  return mix(1.055 * pow(max(shown, 1e-6), vec3(1.0 / 2.4)) - 0.055, 12.92 * shown, step(shown, vec3(0.0031308)));
}

vec3 shade_ground(vec3 direction, vec3 colour) {
  float steep = dot(direction, vertical);
  if (steep > -1e-4) return colour;
  float t = dot(ground.xyz - eye, vertical) / steep;
  vec3 p = eye + t * direction;
  float away = length(p - ground.xyz) / ground.w;
  if (t < 0.0 || away > 1.0 || shadowSteps == 0) return colour;
  float fade = smoothstep(0.0, 1.0, 2.0 * (1.0 - away));
  float shade = 1.0 - (0.42 + 0.58 * light_at(p, key)) * (0.35 + 0.65 * openness_at(p, vertical));
  return colour * (1.0 - 0.62 * fade * shade);
}

vec3 ray_at(vec2 at) {
  vec2 xy = (2.0 * at - resolution) * slope / resolution.y;
  return normalize(forward + xy.x * right + xy.y * upward);
}

void main() {
  if (mode > 0) {
    vec3 direction = ray_at(mode == 1 ? pixel : gl_FragCoord.xy);
    float t = trace(eye, direction, choose_along(eye, direction, 0.0), 2e-4);
    int owner = -1;
    if (t >= 0.0) paint(eye + t * direction, owner);
    owner += 1;
    result = vec4(float(owner & 255), float((owner >> 8) & 255), 0.0, 255.0) / 255.0;
    return;
  }
  vec3 sum = vec3(0.0);
  for (int i = 0; i < samples * samples; i++) {
    vec2 at = floor(gl_FragCoord.xy) + (vec2(float(i % samples), float(i / samples)) + 0.5) / float(samples);
    vec3 direction = ray_at(at);
    float t = trace(eye, direction, choose_along(eye, direction, 0.0), 2e-4);
    vec3 colour;
    if (t >= 0.0) {
      vec3 p = eye + t * direction;
      int owner;
      vec4 painted = paint(p, owner);
      colour = lit(p, normal_at(p, 2e-4 * max(t, 1.0)), -direction, painted);
    } else {
      colour = shade_ground(direction, backdrop(at / resolution));
    }
    sum += displayed(colour);
  }
  result = vec4(sum / float(samples * samples), 1.0);
}
